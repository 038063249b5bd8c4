//! Honest robots: each touches an object at the pace of an arm and records latencies and refusals.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::http::{Outcome, send};
use crate::material::Material;

/// Time between two touches of an arm; sixteen arms keep a small server busy.
const PACE: Duration = Duration::from_millis(250);
/// Number of touches of a session.
const TOUCHES: usize = 12;

/// Observations of all robots, by time window.
#[derive(Debug, Default)]
pub(super) struct Log {
    window: AtomicUsize,
    has_ended: AtomicBool,
    seen: Mutex<Vec<Seen>>,
    /// Descriptions of refusals.
    pub(super) refusals: Mutex<Vec<String>>,
}

/// Observations in one time window.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    seconds: Vec<f64>,
    /// Number of requests refused or not answered.
    pub(super) refused: u64,
}

impl Log {
    /// Starts a new time window and returns its number.
    pub(super) fn next_window(&self) -> usize {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.push(Seen::default());
        self.window.store(seen.len() - 1, Ordering::Relaxed);
        seen.len() - 1
    }

    /// Lets the robots finish their sessions.
    pub(super) fn end(&self) {
        self.has_ended.store(true, Ordering::Relaxed);
    }

    /// Observations in a time window.
    pub(super) fn window(&self, number: usize) -> Seen {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)[number].clone()
    }

    fn note(&self, window: usize, begun: Instant, outcome: &Outcome, what: &str) {
        let mut all = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let seen = &mut all[window];
        seen.seconds.push(begun.elapsed().as_secs_f64());
        let told = match outcome {
            Outcome::Done(_) => return,
            Outcome::Refused(status, body) => format!("{what}: {status} {body}"),
            Outcome::Unknown => format!("{what}: no answer"),
        };
        seen.refused += 1;
        self.refusals.lock().unwrap_or_else(PoisonError::into_inner).push(told);
    }
}

impl Seen {
    /// Adds the observations of other windows.
    pub(super) fn add(&mut self, other: &Self) {
        self.seconds.extend(&other.seconds);
        self.refused += other.refused;
    }

    /// The 99th percentile of the latency, seconds.
    pub(super) fn p99(&self) -> f64 {
        let mut sorted = self.seconds.clone();
        sorted.sort_by(f64::total_cmp);
        let place = (sorted.len() * 99 / 100).min(sorted.len().saturating_sub(1));
        sorted.get(place).copied().unwrap_or(f64::NAN)
    }

    /// Number of requests.
    pub(super) fn requests(&self) -> usize {
        self.seconds.len()
    }
}

/// The current session of a robot, and the number of its next reading.
pub(super) type Now = Arc<Mutex<(String, u64)>>;

/// One honest robot.
pub(super) struct Honest {
    pub(super) name: String,
    pub(super) client: Client,
    /// The session and number that an eavesdropper may know.
    pub(super) now: Now,
}

impl Honest {
    /// Touches objects until the log ends.
    pub(super) async fn work(self, url: String, material: Arc<Material>, log: Arc<Log>) {
        let mut object = self.name.len();
        while !log.has_ended.load(Ordering::Relaxed) {
            object += 1;
            let touches = &material.touches[object % material.touches.len()];
            let body = json!({ "catalogue": "default" });
            let made =
                self.ask(&log, Method::POST, format!("{url}/v1/sessions"), Some(&body)).await;
            let Some(id) = made.and_then(|made| made["id"].as_str().map(str::to_owned)) else {
                tokio::time::sleep(PACE).await;
                continue;
            };
            let session = format!("{url}/v1/sessions/{id}");
            for seq in 0..TOUCHES as u64 {
                *self.now.lock().unwrap_or_else(PoisonError::into_inner) = (id.clone(), seq);
                let next = tokio::time::Instant::now() + PACE;
                let mut reading = touches[(object * 31 + seq as usize) % touches.len()].clone();
                (reading["robot"], reading["seq"]) = (json!(self.name), json!(seq));
                let body = json!({ "readings": [reading] });
                self.ask(&log, Method::POST, format!("{session}/readings"), Some(&body)).await;
                tokio::time::sleep_until(next).await;
            }
            self.ask(&log, Method::POST, format!("{session}/close"), None).await;
        }
    }

    async fn ask(
        &self,
        log: &Log,
        method: Method,
        url: String,
        body: Option<&Value>,
    ) -> Option<Value> {
        let what = format!("{method} {}", url.split_once("/v1").map_or("", |(_, path)| path));
        // An answer belongs to the window in which its request was sent.
        let (window, begun) = (log.window.load(Ordering::Relaxed), Instant::now());
        let outcome = send(&self.client, method, url, body).await;
        log.note(window, begun, &outcome, &what);
        outcome.done()
    }
}
