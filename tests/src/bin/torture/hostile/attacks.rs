//! The attacks, each of which once worked in a review of the server.

use std::sync::PoisonError;

use reqwest::Method;
use serde_json::{Value, json};

use super::foe::Foe;
use super::honest::Now;
use super::second;

/// Connections opened by an attacker in one attack.
const CONNECTIONS: usize = 400;
/// Connections held by an attacker with long answers or long bodies.
const LONG: usize = 40;
/// Sessions and streams requested by an attacker.
const SESSIONS: usize = 3000;
/// Snapshots started by an attacker.
pub(super) const DOWNLOADS: usize = 4;
/// Control characters that must not reach a terminal unescaped.
const ESCAPE: &str = "\u{1b}[2J\u{1b}]0;owned\u{7}";

/// An attack, with the number of its finding: in the second review, those that begin with 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Attack {
    /// 1: endless computations whose callers hang up.
    Computation,
    /// 2: long answers that are never read.
    UnreadAnswers,
    /// 3: headers that never end.
    HalfOpen,
    /// 6: failing changes that push entries out of the audit log.
    WashedAudit,
    /// 7: bodies that are announced and never sent.
    PromisedBodies,
    /// 8: answers that take long to make, and listings.
    LongAnswers,
    /// 9: readings in another robot's name.
    Posing,
    /// 10: requests without a key.
    Strangers,
    /// 11: control characters for the operator's terminal.
    Escapes,
    /// 13: downloads that stall.
    Downloads,
    /// 14: every available session and stream.
    SessionsAndStreams,
    /// 17: a key in place of a path.
    KeyInPath,
    /// 2.1: unknown methods, as labels of metrics.
    InventedMethods,
    /// 2.2: lists whose items weigh more in memory than on the wire.
    Nothings,
    /// 2.4: many robots with loose bases.
    LooseBases,
    /// 2.5: long batches that no object explains.
    Contradictions,
    /// 2.6: silent connections from many addresses.
    ManyAddresses,
    /// 2.8: another robot's name, and times to come, by forwarding.
    Forwarded,
    /// 2.10: decisions that push events out of a webhook's outbox.
    WashedOutbox,
    /// 2.11: packages of sensors with many calibrations.
    Packages,
    /// 2.12: trainings that need more memory than there is.
    LargeTraining,
    /// 2.13: streams that follow many sessions.
    WideStreams,
    /// 2.15: a second host, and tunnels in addresses of webhooks.
    Disguised,
}

impl Attack {
    pub(super) const ALL: [Self; 23] = [
        Self::Computation,
        Self::UnreadAnswers,
        Self::HalfOpen,
        Self::WashedAudit,
        Self::PromisedBodies,
        Self::LongAnswers,
        Self::Posing,
        Self::Strangers,
        Self::Escapes,
        Self::Downloads,
        Self::SessionsAndStreams,
        Self::KeyInPath,
        Self::InventedMethods,
        Self::Nothings,
        Self::LooseBases,
        Self::Contradictions,
        Self::ManyAddresses,
        Self::Forwarded,
        Self::WashedOutbox,
        Self::Packages,
        Self::LargeTraining,
        Self::WideStreams,
        Self::Disguised,
    ];

    /// Whether the attack is of a review; of any without one.
    pub(super) fn is_of(self, review: Option<u8>) -> bool {
        review.is_none_or(|review| self.name().1.starts_with("2.") == (review == 2))
    }

    /// The name in the report, and the number of the finding.
    pub(super) fn name(self) -> (&'static str, &'static str) {
        match self {
            Self::Computation => ("endless_computation", "1"),
            Self::UnreadAnswers => ("unread_answers", "2"),
            Self::HalfOpen => ("half_open_connections", "3"),
            Self::WashedAudit => ("washed_audit_log", "6"),
            Self::PromisedBodies => ("promised_bodies", "7"),
            Self::LongAnswers => ("long_answers", "8"),
            Self::Posing => ("posing_as_a_robot", "9"),
            Self::Strangers => ("strangers_without_a_key", "10"),
            Self::Escapes => ("terminal_escapes", "11"),
            Self::Downloads => ("stalled_downloads", "13"),
            Self::SessionsAndStreams => ("every_session_and_stream", "14"),
            Self::KeyInPath => ("key_in_a_path", "17"),
            Self::InventedMethods => ("invented_methods", "2.1"),
            Self::Nothings => ("lists_of_nothings", "2.2"),
            Self::LooseBases => ("loose_bases", "2.4"),
            Self::Contradictions => ("contradictions", "2.5"),
            Self::ManyAddresses => ("many_addresses", "2.6"),
            Self::Forwarded => ("forwarded_names_and_times", "2.8"),
            Self::WashedOutbox => ("washed_outbox", "2.10"),
            Self::Packages => ("sensor_packages", "2.11"),
            Self::LargeTraining => ("large_trainings", "2.12"),
            Self::WideStreams => ("wide_streams", "2.13"),
            Self::Disguised => ("disguised_requests", "2.15"),
        }
    }
}

/// Attackers' knowledge of the honest robots.
pub(super) struct Prey {
    /// Robots with the current session of each and the number of its next reading.
    pub(super) robots: Vec<(String, Now)>,
    /// A session with many readings.
    pub(super) long_session: String,
    /// A touch that sessions accept.
    pub(super) touch: Value,
    /// Touches of all objects, which no single object explains.
    pub(super) touches: Vec<Value>,
    /// What the attacks of the second review need.
    pub(super) set: Option<second::Set>,
}

/// Attacks until the time is over. Returns requests that should have been refused and were not.
pub(super) async fn attack(what: Attack, foe: &Foe, prey: &Prey) -> Vec<String> {
    match what {
        Attack::Computation => computation(foe, prey).await,
        Attack::UnreadAnswers => unread_answers(foe, prey).await,
        Attack::HalfOpen => {
            let said = "GET /v1/sessions HTTP/1.1\r\nHost: localhost\r\nX-Never: ";
            many(foe, CONNECTIONS, said).await
        }
        Attack::WashedAudit => {
            let nobody = "/v1/sessions/00000000-0000-7000-8000-000000000000";
            again(foe, |foe| foe.ask(&foe.robot, Method::DELETE, nobody, None)).await
        }
        Attack::PromisedBodies => {
            let said = format!(
                "POST /v1/sessions HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {}\r\n\
                 Content-Type: application/json\r\nContent-Length: 3000000\r\n\r\n{{\"catalog",
                foe.robot_key
            );
            many(foe, CONNECTIONS, &said).await
        }
        Attack::LongAnswers => long_answers(foe, prey).await,
        Attack::Posing => posing(foe, prey).await,
        Attack::Strangers => {
            again(foe, |foe| foe.ask(&foe.stranger, Method::POST, "/v1/keys", None)).await
        }
        Attack::Escapes => escapes(foe, prey).await,
        Attack::Downloads => {
            let said = format!(
                "POST /v1/snapshots HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {}\r\n\
                 Connection: close\r\nContent-Length: 0\r\n\r\n",
                foe.admin_key
            );
            many(foe, DOWNLOADS, &said).await
        }
        Attack::SessionsAndStreams => sessions_and_streams(foe).await,
        Attack::KeyInPath => {
            let path = format!("/v1/sessions/{}/belief", foe.viewer_key);
            again(foe, |foe| foe.ask(&foe.robot, Method::GET, &path, None)).await
        }
        Attack::InventedMethods => second::invented_methods(foe).await,
        Attack::Nothings => second::nothings(foe, prey).await,
        Attack::LooseBases => second::loose_bases(foe, prey).await,
        Attack::Contradictions => second::contradictions(foe, prey).await,
        Attack::ManyAddresses => second::many_addresses(foe).await,
        Attack::Forwarded => second::forwarded(foe, prey).await,
        Attack::WashedOutbox => second::washed_outbox(foe, prey).await,
        Attack::Packages => second::packages(foe).await,
        Attack::LargeTraining => second::large_training(foe, prey).await,
        Attack::WideStreams => second::wide_streams(foe, prey).await,
        Attack::Disguised => second::disguised(foe, prey).await,
    }
}

/// Repeats a request.
async fn again<'a, F>(foe: &'a Foe, ask: impl Fn(&'a Foe) -> F) -> Vec<String>
where
    F: Future<Output = Option<(u16, Value)>>,
{
    let mut worked = Vec::new();
    while foe.goes_on() {
        if let Some((status, body)) = ask(foe).await
            && (200..300).contains(&status)
        {
            worked.push(format!("was let in: {status} {body}"));
        }
    }
    worked
}

/// Opens `n` connections that send the same bytes.
async fn many(foe: &Foe, n: usize, said: &str) -> Vec<String> {
    for _ in 0..n {
        if !foe.goes_on() {
            break;
        }
        foe.open(said).await;
    }
    rest(foe).await
}

/// Waits until the attack ends.
pub(super) async fn rest(foe: &Foe) -> Vec<String> {
    tokio::time::sleep_until(foe.until.into()).await;
    Vec::new()
}

async fn computation(foe: &Foe, prey: &Prey) -> Vec<String> {
    let at = json!({"position": [0.2, 0.1, 0.3], "orientation": [0.0, 0.0, 0.0, 1.0]});
    let session = json!({"catalogue": "solid", "method": "geometric_particles",
        "particles": 100_000, "seed": foe.number, "pose_prior": {"kind": "bounded", "pose": at,
        "half_extents": [0.01, 0.01, 0.01], "half_angle": 0.001}});
    while foe.goes_on() {
        let made = foe.ask(&foe.robot, Method::POST, "/v1/sessions", Some(&session)).await;
        let Some((201, made)) = made else { continue };
        let path = format!("/v1/sessions/{}", made["id"].as_str().unwrap_or_default());
        let readings = json!({"readings": vec![prey.touch.clone(); 8]});
        let readings_path = format!("{path}/readings");
        foe.ask(&foe.robot, Method::POST, &readings_path, Some(&readings)).await;
        foe.ask(&foe.robot, Method::DELETE, &path, None).await;
    }
    Vec::new()
}

async fn unread_answers(foe: &Foe, prey: &Prey) -> Vec<String> {
    let paths = [
        "/v1/objects/large/mesh",
        &format!("/v1/sessions/{}/readings?limit=1000", prey.long_session),
    ];
    for n in 0..LONG {
        if !foe.goes_on() {
            break;
        }
        let said = format!(
            "GET {} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {}\r\n\r\n",
            paths[n % paths.len()],
            foe.viewer_key
        );
        foe.open(&said).await;
    }
    rest(foe).await
}

async fn long_answers(foe: &Foe, prey: &Prey) -> Vec<String> {
    let session = format!("/v1/sessions/{}", prey.long_session);
    let [explain, replay] = [format!("{session}/explain"), format!("{session}/replay?poses=100")];
    let lists = ["/v1/sessions?limit=1000", "/v1/objects/large/readings?limit=1000"];
    let ask = |path: &str| {
        let path = path.to_owned();
        async move {
            while foe.goes_on() {
                foe.ask(&foe.viewer, Method::GET, &path, None).await;
            }
        }
    };
    futures::join!(ask(&explain), ask(&replay), ask(lists[0]), ask(lists[1]));
    Vec::new()
}

async fn posing(foe: &Foe, prey: &Prey) -> Vec<String> {
    let mut worked = Vec::new();
    let mut turn = usize::from(foe.number);
    while foe.goes_on() {
        turn += 1;
        let (name, now) = &prey.robots[turn % prey.robots.len()];
        let (session, seq) = now.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let mut reading = prey.touch.clone();
        (reading["robot"], reading["seq"]) = (json!(name), json!(seq + 1));
        let body = json!({ "readings": [reading] });
        let path = format!("/v1/sessions/{session}/readings");
        let answer = foe.ask(&foe.robot, Method::POST, &path, Some(&body)).await;
        if let Some((200, body)) = answer {
            worked.push(format!("wrote as {name} into {session}: {body}"));
        }
    }
    worked
}

async fn escapes(foe: &Foe, prey: &Prey) -> Vec<String> {
    let mut reading = prey.touch.clone();
    reading["robot"] = json!(ESCAPE);
    let body = json!({ "readings": [reading] });
    let path = format!("/v1/sessions/{}/readings", prey.long_session);
    let session = json!({"catalogue": "default", "frame_id": ESCAPE});
    let mut worked = again(foe, |foe| foe.ask(&foe.robot, Method::POST, &path, Some(&body))).await;
    let answer = foe.ask(&foe.robot, Method::POST, "/v1/sessions", Some(&session)).await;
    if let Some((201, made)) = answer {
        worked.push(format!("a frame of escapes was taken: {made}"));
    }
    worked
}

async fn sessions_and_streams(foe: &Foe) -> Vec<String> {
    let mut streams = Vec::new();
    for _ in 0..SESSIONS {
        if !foe.goes_on() {
            break;
        }
        let session = json!({ "catalogue": "default" });
        foe.ask(&foe.robot, Method::POST, "/v1/sessions", Some(&session)).await;
        let stream = foe.viewer.get(format!("{}/v1/events", foe.url)).send();
        if let Ok(stream) = stream.await
            && stream.status().is_success()
        {
            streams.push(stream);
        }
    }
    rest(foe).await
}
