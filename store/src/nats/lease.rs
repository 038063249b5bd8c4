//! Leases: one process uses a store at a time, unless it is opened to be shared; processes that
//! share it have leases for what one of them does at a time.
//!
//! A lease is a message that expires unless it is renewed. After a crash of its holder, the next
//! process waits until it has expired. Leases are no records: the index leaves them out.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::oneshot;
use uuid::Uuid;

use super::message::{Message, encode};
use super::plan::Outgoing;
use super::publish::{Publisher, Refused};
use super::shared::Shared;
use super::unit;
use crate::engine::EngineError;
use crate::engine::lease::Lease;

/// Time after which a lease expires, as a header has it.
const EXPIRES: &str = "20s";
/// The same. A leader's crash takes up to 9 s.
const EXPIRES_AFTER: Duration = Duration::from_secs(20);
/// Time after the last renewal in which its holder counts on a lease: less, by what a renewal
/// may need to be stored.
const COUNTED_ON: Duration = Duration::from_secs(18);
const RENEW_EVERY: Duration = Duration::from_secs(4);
/// Pause between attempts to take or renew it.
const PAUSE: Duration = Duration::from_millis(500);

/// Takes the store's lease, after waiting for that of a process that has crashed; its sequence.
pub(super) async fn take(publisher: &Publisher) -> Result<u64, String> {
    let begun = Instant::now();
    loop {
        let fault = match publisher.publish(&[claim(unit::LEASE, 0)]).await {
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

/// Renews the store's lease until the store is closed; without it the store fails.
pub(super) async fn keep(publisher: &Publisher, shared: Arc<Shared>, taken: u64) {
    let (mut sequence, mut renewed) = (taken, Instant::now());
    loop {
        tokio::time::sleep(RENEW_EVERY).await;
        match renew(publisher, unit::LEASE, sequence, renewed).await {
            Renewal::Done(stored, begun) => (sequence, renewed) = (stored, begun),
            Renewal::Unknown => {}
            Renewal::Lost => {
                let detail = "another server has taken the store over".to_owned();
                return shared.fail(EngineError::Failed { doing: "renewing the lease", detail });
            }
        }
    }
}

/// Takes the lease `name` unless another process has it.
pub(super) async fn take_named(
    publisher: Arc<Publisher>,
    name: &str,
) -> Result<Option<Lease>, EngineError> {
    let unit = [unit::LEASE, b"/", name.as_bytes()].concat();
    let begun = Instant::now();
    match publisher.publish(&[claim(&unit, 0)]).await {
        Ok(sequence) => {
            let ends = Arc::new(Mutex::new(begun + COUNTED_ON));
            let (held, dropped) = oneshot::channel();
            let lease = Lease::renewed(Arc::clone(&ends), held);
            tokio::spawn(keep_named(publisher, unit, (sequence, begun), ends, dropped));
            Ok(Some(lease))
        }
        Err(Refused::Changed | Refused::Busy) => Ok(None),
        Err(Refused::Unknown(detail) | Refused::NoRoom(detail)) => {
            Err(EngineError::Failed { doing: "taking a lease", detail })
        }
    }
}

/// Renews a lease until it is dropped or lost, and gives it back.
async fn keep_named(
    publisher: Arc<Publisher>,
    unit: Vec<u8>,
    (mut sequence, mut renewed): (u64, Instant),
    ends: Arc<Mutex<Instant>>,
    mut dropped: oneshot::Receiver<()>,
) {
    while tokio::time::timeout(RENEW_EVERY, &mut dropped).await.is_err() {
        // Later another process may have had it, even if it is free again.
        if renewed.elapsed() >= EXPIRES_AFTER {
            return;
        }
        match renew(&publisher, &unit, sequence, renewed).await {
            Renewal::Done(stored, begun) => {
                (sequence, renewed) = (stored, begun);
                *ends.lock().unwrap_or_else(PoisonError::into_inner) = begun + COUNTED_ON;
            }
            Renewal::Unknown => {}
            Renewal::Lost => {
                *ends.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
                return;
            }
        }
    }
    give_back(&publisher, &unit, sequence).await;
}

/// Result of an attempt to renew a lease.
enum Renewal {
    /// It was stored at a sequence, by an attempt that began then.
    Done(u64, Instant),
    /// Nobody knows.
    Unknown,
    /// Another process has it.
    Lost,
}

/// Renews the lease whose last known message is at `sequence`.
async fn renew(publisher: &Publisher, unit: &[u8], sequence: u64, renewed: Instant) -> Renewal {
    // A renewal without an answer may have been stored. After an outage of the cluster the
    // lease has expired, and nobody has it.
    let is_recent = renewed.elapsed() < EXPIRES_AFTER;
    let last = match publisher.last_sequence(unit).await {
        Ok(last) if last == sequence || last == 0 || is_recent => last,
        Ok(_) => return Renewal::Lost,
        Err(_) => return Renewal::Unknown,
    };
    let begun = Instant::now();
    match publisher.publish(&[claim(unit, last)]).await {
        Ok(stored) => Renewal::Done(stored, begun),
        Err(_) => Renewal::Unknown,
    }
}

/// Gives the store's lease back.
pub(super) async fn release(publisher: &Publisher) {
    give_back(publisher, unit::LEASE, u64::MAX).await;
}

/// Gives a lease back by removing its messages up to `last`: a later one may be another process's.
async fn give_back(publisher: &Publisher, unit: &[u8], last: u64) {
    // It expires by itself otherwise.
    if let Err(error) = publisher.purge(unit, last).await {
        tracing::debug!("Cannot give a lease back: {error}");
    }
}

fn claim(unit: &[u8], expected: u64) -> Outgoing {
    let (commit, unit) = (Uuid::now_v7(), unit.to_vec());
    let message = Message { commit, part: 0, n_parts: 1, unit, is_whole: true, writes: Vec::new() };
    let payload = encode(&message);
    let (unit, expected, ttl) = (message.unit, Some(expected), Some(EXPIRES));
    Outgoing { unit, expected, is_rollup: true, ttl, payload }
}
