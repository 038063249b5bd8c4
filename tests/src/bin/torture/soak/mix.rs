//! Writers of a soak: readings into sessions that come and go, and the work of a trainer and
//! an admin.

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::time::{Duration, Instant};

use anyhow::bail;
use palpate_core::rng::{Purpose, Stream};
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::http::{Outcome, answer, send};
use crate::material::{Material, off_box};
use crate::robot::Robot;

/// Number of readings of one request.
const BATCH: usize = 25;
/// Number of readings of one session.
const SESSION_READINGS: u64 = 400;
/// One session in this many is kept longer.
const KEPT_EVERY: u64 = 10;
/// Time between two changes of objects or keys.
const TEACH_EVERY: Duration = Duration::from_secs(2);
/// One change in this many is a training.
const TRAIN_EVERY: u64 = 15;
/// Number of different labels of sessions.
const LABELS: u64 = 8;
/// Time between two searches by a label.
const SEARCH_EVERY: Duration = Duration::from_millis(500);
/// Pause of a writer after the server refused it as overloaded.
const BUSY_PAUSE: Duration = Duration::from_millis(50);

/// State shared by all writers.
pub(super) struct Mix {
    pub(super) url: String,
    /// Lifetime of a session that is not kept.
    pub(super) life: Duration,
    /// Lifetime of a kept session.
    pub(super) kept_for: Duration,
    pub(super) ends: Instant,
    pub(super) acknowledged: Acknowledged,
}

/// Acknowledged readings, and the longest time without any while writes waited.
#[derive(Debug, Default)]
pub(super) struct Acknowledged(Mutex<Counts>);

/// The counts of [`Acknowledged`].
#[derive(Clone, Debug, Default)]
pub(super) struct Counts {
    pub(super) readings: u64,
    pub(super) requests: u64,
    pub(super) refused: u64,
    /// The longest time without an acknowledgement while a request waited for one.
    pub(super) longest_pause: Duration,
    pub(super) longest_pause_at: Duration,
    /// Longest time of one request.
    pub(super) longest_request: Duration,
    /// Number of searches by a label, and the longest of them.
    pub(super) searches: u64,
    pub(super) longest_search: Duration,
    /// Number of pauses longer than 250 ms.
    pub(super) long_pauses: u64,
    begun: Option<Instant>,
    last: Option<Instant>,
    /// Send times of the waiting requests.
    waiting: BTreeSet<(Instant, u64)>,
    n_sent: u64,
    has_ended: bool,
}

/// Minimum length of a long pause of acknowledged writes.
const LONG_PAUSE: Duration = Duration::from_millis(250);

impl Acknowledged {
    fn change(&self, change: impl FnOnce(&mut Counts)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    pub(super) fn counts(&self) -> Counts {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Starts counting.
    pub(super) fn begin(&self) {
        let begun = Some(Instant::now());
        self.change(|counts| *counts = Counts { begun, last: begun, ..Counts::default() });
    }

    /// Ends all writers.
    pub(super) fn end(&self) {
        self.change(|counts| counts.has_ended = true);
    }

    pub(super) fn readings(&self) -> u64 {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).readings
    }

    fn has_ended(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).has_ended
    }

    /// Records a request that is sent.
    fn sent(&self) -> (Instant, u64) {
        let mut sent = (Instant::now(), 0);
        self.change(|counts| {
            counts.n_sent += 1;
            sent.1 = counts.n_sent;
            counts.waiting.insert(sent);
        });
        sent
    }

    /// Records an answer that acknowledges `n_readings`.
    fn note(&self, sent: (Instant, u64), n_readings: u64) {
        self.change(|counts| {
            let now = Instant::now();
            let oldest = counts.waiting.first().map_or(now, |(sent, _)| *sent);
            counts.waiting.remove(&sent);
            if counts.has_ended || n_readings == 0 {
                counts.refused += u64::from(!counts.has_ended);
                return;
            }
            let waited = now - sent.0;
            let pause = now - counts.last.map_or(oldest, |last| last.max(oldest));
            if pause > counts.longest_pause {
                counts.longest_pause = pause;
                counts.longest_pause_at = counts.begun.map_or(Duration::ZERO, |begun| now - begun);
            }
            counts.long_pauses += u64::from(pause > LONG_PAUSE);
            counts.longest_request = counts.longest_request.max(waited);
            counts.last = Some(now);
            counts.readings += n_readings;
            counts.requests += 1;
        });
    }
}

/// A session and its number of acknowledged readings.
struct Session {
    id: String,
    acknowledged: u64,
    sent: u64,
    /// Time of its removal, if any.
    removed: Option<Instant>,
}

/// One client that writes.
pub(super) struct Writer {
    name: String,
    client: Client,
    stream: Stream,
    sessions: Vec<Session>,
    n_begun: u64,
}

impl Writer {
    pub(super) fn new(robot: &Robot, seed: u64) -> Self {
        let name = robot.name.clone();
        let number = name.bytes().fold(0, |sum, byte| sum * 31 + u64::from(byte));
        let stream = Stream::new(seed, Purpose::ReadingChoice, number);
        let client = robot.client.clone();
        Self { name, client, stream, sessions: Vec::new(), n_begun: 0 }
    }

    /// Stores readings that are kept; returns their number.
    pub(super) async fn fill(
        &mut self,
        mix: &Mix,
        material: &Material,
        n_readings: u64,
    ) -> anyhow::Result<u64> {
        let mut n_filled = 0;
        while n_filled < n_readings {
            let Some(mut session) = self.begin(mix, None).await else {
                bail!("{} cannot begin a session", self.name);
            };
            while session.sent < SESSION_READINGS && n_filled < n_readings {
                match self.touch(mix, material, &mut session).await {
                    Outcome::Done(_) => n_filled += BATCH as u64,
                    Outcome::Refused(503, _) => tokio::time::sleep(BUSY_PAUSE).await,
                    other => bail!("{} cannot add readings: {other:?}", self.name),
                }
            }
            self.sessions.push(session);
        }
        Ok(n_filled)
    }

    /// Writes until the mix ends.
    pub(super) async fn write(&mut self, mix: &Mix, material: &Material) {
        while !mix.acknowledged.has_ended() {
            self.n_begun += 1;
            let life =
                if self.n_begun.is_multiple_of(KEPT_EVERY) { mix.kept_for } else { mix.life };
            let Some(mut session) = self.begin(mix, Some(Instant::now() + life)).await else {
                tokio::time::sleep(BUSY_PAUSE).await;
                continue;
            };
            while session.sent < SESSION_READINGS && !mix.acknowledged.has_ended() {
                let sent = mix.acknowledged.sent();
                let outcome = self.touch(mix, material, &mut session).await;
                let is_done = matches!(outcome, Outcome::Done(_));
                mix.acknowledged.note(sent, if is_done { BATCH as u64 } else { 0 });
                if !is_done {
                    tokio::time::sleep(BUSY_PAUSE).await;
                }
            }
            self.sessions.push(session);
            self.remove_old(mix).await;
        }
    }

    async fn begin(&mut self, mix: &Mix, removed: Option<Instant>) -> Option<Session> {
        let path = format!("{}/v1/sessions", mix.url);
        let batch = (self.n_begun % LABELS).to_string();
        let request = json!({"method": "appearance", "labels": {"batch": batch}});
        let begun = send(&self.client, Method::POST, path, Some(&request)).await.done()?;
        let id = begun["id"].as_str()?.to_owned();
        Some(Session { id, acknowledged: 0, sent: 0, removed })
    }

    /// Sends the next readings of a session; unanswered ones are sent again.
    async fn touch(&mut self, mix: &Mix, material: &Material, session: &mut Session) -> Outcome {
        let touches = &material.touches[0];
        let readings: Vec<Value> = (session.sent..session.sent + BATCH as u64)
            .map(|seq| {
                let mut reading = touches[self.stream.index(touches.len())].clone();
                (reading["robot"], reading["seq"]) = (json!(self.name), json!(seq));
                reading
            })
            .collect();
        let path = format!("{}/v1/sessions/{}/readings?belief=none", mix.url, session.id);
        let body = json!({ "readings": readings });
        let outcome = send(&self.client, Method::POST, path, Some(&body)).await;
        if matches!(outcome, Outcome::Done(_)) {
            session.sent += BATCH as u64;
            session.acknowledged = session.sent;
        } else if matches!(outcome, Outcome::Unknown) {
            // They may be stored: the next batch follows them.
            session.sent += BATCH as u64;
        }
        outcome
    }

    /// Removes the sessions whose time has come.
    async fn remove_old(&mut self, mix: &Mix) {
        let now = Instant::now();
        let is_old = |session: &Session| session.removed.is_some_and(|removed| removed <= now);
        let (old, kept): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.sessions).into_iter().partition(is_old);
        self.sessions = kept;
        for session in old {
            let path = format!("{}/v1/sessions/{}", mix.url, session.id);
            if send(&self.client, Method::DELETE, path, None).await.refused() == Some(503) {
                self.sessions.push(session);
            }
        }
    }
}

/// Trains, replaces a mesh, creates a key and revokes the one before, until the mix ends.
pub(super) async fn teach(mix: &Mix, robot: &Robot) {
    let url = &mix.url;
    let (teacher, Some(keeper)) = (&robot.teacher, &robot.keeper) else { return };
    for turn in 1_u64.. {
        if mix.acknowledged.has_ended() {
            return;
        }
        let key = json!({"name": format!("key-{turn}"), "role": "viewer"});
        send(keeper, Method::POST, format!("{url}/v1/keys"), Some(&key)).await;
        send(keeper, Method::DELETE, format!("{url}/v1/keys/key-{}", turn - 1), None).await;
        let name = format!("object-{}", turn % 4);
        let object = json!({ "name": name });
        send(teacher, Method::POST, format!("{url}/v1/objects"), Some(&object)).await;
        let file = off_box([30.0, 20.0, 10.0], 1 + (turn as usize * 97) % 1500);
        let mesh = teacher.put(format!("{url}/v1/objects/{name}/mesh?unit=mm"));
        answer(mesh.header("content-type", "model/off").body(file)).await;
        if turn % TRAIN_EVERY == 1 {
            let training = json!({"objects": ["cube", "bar"], "readings_per_object": 40,
                "n_classes": 4, "seed": turn});
            let path = format!("{url}/v1/catalogues/own/trainings");
            send(teacher, Method::POST, path, Some(&training)).await;
        }
        tokio::time::sleep(TEACH_EVERY).await;
    }
}

/// Searches sessions by a label until the mix ends.
pub(super) async fn search(mix: &Mix, robot: &Robot) {
    for turn in 0_u64.. {
        if mix.acknowledged.has_ended() {
            return;
        }
        let label = turn % LABELS;
        let path = format!("{}/v1/sessions?labels=batch:{label}&limit=100", mix.url);
        let begun = Instant::now();
        if let Outcome::Done(_) = send(&robot.client, Method::GET, path, None).await {
            mix.acknowledged.change(|counts| {
                counts.searches += 1;
                counts.longest_search = counts.longest_search.max(begun.elapsed());
            });
        }
        tokio::time::sleep(SEARCH_EVERY).await;
    }
}

/// Number of acknowledged readings of a writer's sessions that are missing.
pub(super) async fn lost(writer: &Writer, url: &str, say: &dyn Fn(String)) -> u64 {
    let mut lost = 0;
    for session in &writer.sessions {
        let path = format!("{url}/v1/sessions/{}", session.id);
        let shown = send(&writer.client, Method::GET, path, None).await.done();
        let there = shown.and_then(|shown| shown["n_readings"].as_u64()).unwrap_or_default();
        if there < session.acknowledged {
            let (id, acknowledged) = (&session.id, session.acknowledged);
            say(format!("FAULT: {there} readings of session {id}, {acknowledged} acknowledged"));
            lost += acknowledged - there;
        }
    }
    lost
}
