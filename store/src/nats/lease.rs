//! The lease: one process uses a store at a time, unless it is opened to be shared.
//!
//! The lease is a message that expires unless it is renewed. After a crash, the next process
//! waits until it has expired.

use std::sync::Arc;
use std::time::{Duration, Instant};

use uuid::Uuid;

use super::message::{Message, encode};
use super::plan::Outgoing;
use super::publish::{Publisher, Refused};
use super::shared::Shared;
use crate::engine::EngineError;

/// Unit of the lease; no commit has keys that begin with 0.
const UNIT: &[u8] = b"\0lease";
/// Time after which a lease expires, as a header has it.
const EXPIRES: &str = "20s";
/// The same. A leader's crash takes up to 9 s.
const EXPIRES_AFTER: Duration = Duration::from_secs(20);
const RENEW_EVERY: Duration = Duration::from_secs(4);
/// Pause between attempts to take or renew it.
const PAUSE: Duration = Duration::from_millis(500);

/// Takes the lease, after waiting for that of a process that has crashed; its sequence.
pub(super) async fn take(publisher: &Publisher) -> Result<u64, String> {
    let begun = Instant::now();
    loop {
        let fault = match publisher.publish(&[claim(0)]).await {
            Ok(sequence) => return Ok(sequence),
            Err(Refused::Unknown(detail) | Refused::NoRoom(detail)) => detail,
            Err(Refused::Changed | Refused::Busy) => {
                "another server uses it (`--store-shared` allows several)".to_owned()
            }
        };
        if begun.elapsed() > EXPIRES_AFTER + RENEW_EVERY {
            return Err(fault);
        }
        tokio::time::sleep(PAUSE).await;
    }
}

/// Renews the lease until the store is closed; without it the store fails.
pub(super) async fn keep(publisher: &Publisher, shared: Arc<Shared>, taken: u64) {
    let (mut sequence, mut renewed) = (taken, Instant::now());
    loop {
        tokio::time::sleep(RENEW_EVERY).await;
        // A renewal without an answer may have been stored. After an outage of the cluster the
        // lease has expired, and nobody has it.
        let known = publisher.last_sequence(UNIT).await;
        let is_recent = renewed.elapsed() < EXPIRES_AFTER;
        let attempt = match known {
            Ok(last) if last == sequence || last == 0 || is_recent => last,
            Ok(_) => {
                let detail = "another server has taken the store over".to_owned();
                return shared.fail(EngineError::Failed { doing: "renewing the lease", detail });
            }
            Err(_) => continue,
        };
        let begun = Instant::now();
        if let Ok(stored) = publisher.publish(&[claim(attempt)]).await {
            (sequence, renewed) = (stored, begun);
        }
    }
}

/// Gives the lease back.
pub(super) async fn release(publisher: &Publisher) {
    // It expires by itself otherwise.
    if let Err(error) = publisher.purge(UNIT).await {
        tracing::debug!("Cannot give the lease back: {error}");
    }
}

fn claim(expected: u64) -> Outgoing {
    let (commit, unit) = (Uuid::now_v7(), UNIT.to_vec());
    let message = Message { commit, part: 0, n_parts: 1, unit, is_whole: true, writes: Vec::new() };
    let payload = encode(&message);
    let (unit, expected, ttl) = (message.unit, Some(expected), Some(EXPIRES));
    Outgoing { unit, expected, is_rollup: true, ttl, payload }
}
