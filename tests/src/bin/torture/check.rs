//! Checks after a restart: everything acknowledged is stored, and nothing that no client sent.

use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::Counts;
use crate::http::{Outcome, send};
use crate::keys;
use crate::ledger::{Fate, Ledger, Session};
use crate::robot::Robot;

/// A fault, its description, and the count it belongs to.
pub(crate) enum Fault {
    /// An acknowledged item is missing.
    Lost(String),
    /// An item exists that no client sent.
    Invented(String),
    /// An answer that no client should get.
    Unexpected(String),
}

/// Faults found by a check.
#[derive(Default)]
pub(crate) struct Found(pub(crate) Vec<Fault>);

impl Found {
    pub(crate) fn lost(&mut self, what: String) {
        self.0.push(Fault::Lost(what));
    }

    pub(crate) fn invented(&mut self, what: String) {
        self.0.push(Fault::Invented(what));
    }

    fn unexpected(&mut self, what: String) {
        self.0.push(Fault::Unexpected(what));
    }

    /// Adds the faults to the counts and prints each.
    pub(crate) fn add_to(&self, counts: &mut Counts, say: &dyn Fn(String)) {
        for fault in &self.0 {
            let (count, what) = match fault {
                Fault::Lost(what) => (&mut counts.acknowledged_lost, what),
                Fault::Invented(what) => (&mut counts.invented, what),
                Fault::Unexpected(what) => (&mut counts.unexpected_answers, what),
            };
            *count += 1;
            say(format!("FAULT: {what}"));
        }
    }
}

/// Checks everything that a robot did, its older sessions only if `all`. Requests without an
/// answer are looked up, so that their fate is known afterwards.
pub(crate) async fn check(robot: &mut Robot, url: &str, all: bool) -> Found {
    let mut found = Found::default();
    let client = robot.client.clone();
    let name = robot.name.clone();
    for session in robot.ledger.sessions.iter_mut().filter(|session| all || session.is_fresh) {
        check_session(&client, url, &name, session, &mut found).await;
        session.is_fresh = false;
    }
    let teacher = robot.teacher.clone();
    check_objects(&teacher, url, &mut robot.ledger, &mut found).await;
    let sensor = robot.sensor();
    check_calibrations(&client, url, &sensor, &mut robot.ledger, &mut found).await;
    for job in &robot.ledger.jobs {
        let answer = send(&teacher, Method::GET, format!("{url}/v1/jobs/{job}"), None).await;
        if answer.done().is_none() {
            found.lost(format!("job {job} of {name}"));
        }
    }
    if let Some(keeper) = &robot.keeper {
        keys::check(keeper, url, all, &mut robot.ledger, &mut found).await;
    }
    for words in robot.ledger.unexpected.drain(..) {
        found.unexpected(words);
    }
    found
}

async fn check_session(
    client: &Client,
    url: &str,
    robot: &str,
    session: &mut Session,
    found: &mut Found,
) {
    let what = format!("session {} of {robot}", session.id);
    let path = format!("{url}/v1/sessions/{}", session.id);
    let answer = send(client, Method::GET, path.clone(), None).await;
    let shown = match (answer, session.deleted) {
        (Outcome::Refused(404, _), Some(_)) => {
            session.deleted = Some(Fate::Acknowledged);
            return;
        }
        (Outcome::Done(_), Some(Fate::Acknowledged)) => {
            return found.lost(format!("the deletion of {what}"));
        }
        (Outcome::Done(shown), _) => shown,
        (other, _) => return found.lost(format!("{what}: {other:?}")),
    };
    // The deletion did not happen: the session must be unchanged.
    session.deleted = None;
    let is_closed = shown["state"] == "closed";
    match session.closed {
        Some(Fate::Acknowledged) if !is_closed => found.lost(format!("the close of {what}")),
        None if is_closed => found.invented(format!("{what} is closed")),
        _ => {}
    }
    session.closed = is_closed.then_some(Fate::Acknowledged);
    check_readings(client, &path, &what, session, &shown, found).await;
}

async fn check_readings(
    client: &Client,
    path: &str,
    what: &str,
    session: &mut Session,
    shown: &Value,
    found: &mut Found,
) {
    let sent = session.readings.len() as u64;
    let acknowledged =
        session.readings.iter().filter(|sent| sent.fate == Fate::Acknowledged).count() as u64;
    let there = shown["n_readings"].as_u64().unwrap_or_default();
    if there < acknowledged {
        found.lost(format!("{} of {acknowledged} readings of {what}", acknowledged - there));
    }
    if there > sent {
        found.invented(format!("{} readings of {what}", there - sent));
    }
    if session.closed.is_some() && there == acknowledged {
        // Readings without an answer did not arrive before the close.
        session.readings.retain(|sent| sent.fate == Fate::Acknowledged);
    }
    if session.readings.is_empty() {
        return;
    }
    // The same readings again: stored ones count as repetitions and must be equal in every bit.
    let readings: Vec<&Value> = session.readings.iter().map(|sent| &sent.reading).collect();
    let body = json!({ "readings": readings });
    let again =
        send(client, Method::POST, format!("{path}/readings?belief=none"), Some(&body)).await;
    match again {
        Outcome::Done(answer) => {
            let n_repeated = answer["n_repeated"].as_u64().unwrap_or_default();
            if n_repeated < acknowledged {
                found.lost(format!("{} readings of {what}", acknowledged - n_repeated));
            }
            if n_repeated != there {
                found.invented(format!("{there} readings of {what}, of which {n_repeated} sent"));
            }
            session.readings.iter_mut().for_each(|sent| sent.fate = Fate::Acknowledged);
        }
        other => found.lost(format!("readings of {what} as they were sent: {other:?}")),
    }
}

async fn check_objects(client: &Client, url: &str, ledger: &mut Ledger, found: &mut Found) {
    let mut gone = Vec::new();
    for (name, object) in &mut ledger.objects {
        let answer = send(client, Method::GET, format!("{url}/v1/objects/{name}"), None).await;
        let shown = match (answer, object.created, object.deleted) {
            (Outcome::Refused(404, _), Fate::Unknown, _)
            | (Outcome::Refused(404, _), _, Some(_)) => {
                gone.push(name.clone());
                continue;
            }
            (Outcome::Done(_), _, Some(Fate::Acknowledged)) => {
                found.lost(format!("the deletion of object {name}"));
                continue;
            }
            (Outcome::Done(shown), ..) => shown,
            (other, ..) => {
                found.lost(format!("object {name}: {other:?}"));
                continue;
            }
        };
        object.created = Fate::Acknowledged;
        object.deleted = None;
        let length = shown["mesh"]["bytes"].as_u64().map(|bytes| bytes as usize);
        let may_be = object.meshes.iter().any(|(sent, _)| Some(*sent) == length)
            || (length.is_none() && object.meshes.iter().all(|(_, fate)| *fate == Fate::Unknown));
        if !may_be {
            found.lost(format!("the mesh of object {name}: {length:?}, sent {:?}", object.meshes));
        }
        if let Some(length) = length {
            // The file itself is read completely and compared with its hash.
            let path = format!("{url}/v1/objects/{name}/mesh");
            if send(client, Method::GET, path, None).await.done().is_none() {
                found.lost(format!("the file of the mesh of object {name}"));
            }
            object.meshes = vec![(length, Fate::Acknowledged)];
        }
        let there = shown["n_readings"].as_u64().unwrap_or_default();
        let most = object.n_readings + object.n_readings_unknown;
        if there < object.n_readings {
            found.lost(format!("{} readings of object {name}", object.n_readings - there));
        }
        if there > most {
            found.invented(format!("{} readings of object {name}", there - most));
        }
        (object.n_readings, object.n_readings_unknown) = (there, 0);
    }
    gone.iter().for_each(|name| {
        ledger.objects.remove(name);
    });
}

async fn check_calibrations(
    client: &Client,
    url: &str,
    sensor: &str,
    ledger: &mut Ledger,
    found: &mut Found,
) {
    let path = format!("{url}/v1/sensors/{sensor}/calibration");
    let there = match send(client, Method::GET, path, None).await {
        Outcome::Done(newest) => newest["number"].as_u64().unwrap_or_default(),
        Outcome::Refused(404, _) => 0,
        other => return found.lost(format!("calibrations of {sensor}: {other:?}")),
    };
    if there < ledger.calibrations {
        found.lost(format!("{} calibrations of {sensor}", ledger.calibrations - there));
    }
    if there > ledger.calibrations + ledger.calibrations_unknown {
        found.invented(format!("calibration {there} of {sensor}"));
    }
    (ledger.calibrations, ledger.calibrations_unknown) = (there, 0);
}

/// Checks that only requested sessions and objects exist.
pub(crate) async fn check_strangers(robots: &[Robot], url: &str, trained: usize) -> Found {
    let mut found = Found::default();
    let Some(robot) = robots.first() else { return found };
    let (client, teacher) = (robot.client.clone(), robot.teacher.clone());
    let living = |session: &&Session| session.deleted.is_none();
    let sessions: usize =
        robots.iter().map(|robot| robot.ledger.sessions.iter().filter(living).count()).sum();
    let unknown: u64 = robots.iter().map(|robot| robot.ledger.sessions_unknown).sum();
    let there = count(&client, &format!("{url}/v1/sessions")).await;
    if there > sessions as u64 + unknown {
        found.invented(format!("{there} sessions, {sessions} + {unknown} were asked for"));
    }
    if there < sessions as u64 {
        found.lost(format!("{there} sessions are listed, of {sessions}"));
    }
    let objects = trained + robots.iter().map(|robot| robot.ledger.objects.len()).sum::<usize>();
    let there = count(&teacher, &format!("{url}/v1/objects")).await;
    if there != objects as u64 {
        found.invented(format!("{there} objects are listed, of {objects}"));
    }
    if let Some(keeper) = &robot.keeper {
        let keys: usize = robots.iter().map(|robot| robot.ledger.keys.len()).sum();
        let keys = (keys + keys::n_given(robots.len())) as u64;
        let there = count(keeper, &format!("{url}/v1/keys")).await;
        if there != keys {
            found.invented(format!("{there} keys are listed, of {keys}"));
        }
    }
    found
}

/// Number of items of a list, over all its pages.
async fn count(client: &Client, path: &str) -> u64 {
    let (mut n, mut cursor) = (0, String::new());
    loop {
        let page = format!("{path}?limit=1000{cursor}");
        let Some(page) = send(client, Method::GET, page, None).await.done() else { return n };
        n += page["items"].as_array().map_or(0, Vec::len) as u64;
        let Some(next) = page["next_cursor"].as_str() else { return n };
        cursor = format!("&cursor={next}");
    }
}
