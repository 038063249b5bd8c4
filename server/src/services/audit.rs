//! The audit log: an entry before every change, its outcome after it, and refused requests.
//!
//! A change runs in a separate task, so that it and its entry are completed even if the caller
//! disconnects. Failures and refusals go to separate rings, repetitions are counted in one entry
//! (`folds`), and a key whose changes keep failing has to wait (`failures`), so no caller can
//! push entries out of the log.

mod failures;
mod folds;

use std::num::NonZeroU32;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use palpate_schemas as wire;
use palpate_schemas::PageQuery;
use palpate_store::access::Role;
use palpate_store::audit::{AuditEntry, AuditLog};
use palpate_store::error::StoreError;
use tokio::sync::watch;
use uuid::Uuid;

use crate::cause::Cause;
use crate::client::Client;
use crate::clock::{now_ms, pause};
use crate::roles;
use crate::wire::{access, page_length, page_number};
use failures::Failures;
pub(crate) use folds::Alike;
use folds::{FOLD_MS, Folds};

/// Maximum length of a recorded path, in characters.
const PATH_CHARS_MAX: usize = 512;
/// Number of entries per read.
const CHUNK: usize = 256;
/// Maximum number of such reads per query; further entries are on the next page.
const CHUNKS_MAX: usize = 40;
/// Maximum number of different refusals without a key that are recorded at once.
const DENIED_BURST: u32 = 30;
/// Time after which one more is recorded.
const DENIED_PAUSE: Duration = Duration::from_secs(60);
/// Interval at which counts of repetitions are stored.
const STORE_EVERY: Duration = Duration::from_secs(5);

/// Operations that must work on a full disk: revoking a leaked key or secret, and freeing space.
const ESSENTIAL: [&str; 12] = [
    "revoke_key",
    "rotate_key",
    "update_webhook",
    "delete_webhook",
    "rotate_webhook_secret",
    "close_session",
    "delete_session",
    "delete_object",
    "delete_catalogue",
    "delete_version",
    "delete_sensor",
    "delete_job",
];

/// Whether an operation, and its entry, may use the reserve of the disk.
pub(crate) fn is_essential(operation: &str) -> bool {
    ESSENTIAL.contains(&operation)
}

/// A request, for the log.
#[derive(Clone, Debug)]
pub(crate) struct Attempt {
    /// Id of the operation.
    pub(crate) operation: &'static str,
    /// Id, name and role of the key.
    pub(crate) key: Option<(Uuid, String, Role)>,
    /// The client that its repetitions count towards.
    pub(crate) client: Option<Client>,
    /// Address of the caller.
    pub(crate) address: String,
    /// The path.
    pub(crate) path: String,
    /// Id of the request.
    pub(crate) request_id: String,
}

/// The audit log of a server.
pub(crate) struct Audit {
    log: AuditLog,
    denials: Mutex<Denials>,
    folds: tokio::sync::Mutex<Folds>,
    pub(crate) failures: Failures,
}

/// Number of refusals without a key that may be recorded now, and of those that were not.
#[derive(Debug)]
struct Denials {
    allowed: u32,
    since: Instant,
    n_left_out: u32,
}

impl Denials {
    /// Whether a refusal is recorded now, and if so, the number of unrecorded ones before it.
    fn admit(&mut self, now: Instant) -> Option<u32> {
        let earned = now.duration_since(self.since).as_secs() / DENIED_PAUSE.as_secs();
        if earned > 0 {
            self.allowed = DENIED_BURST.min(self.allowed.saturating_add(earned as u32));
            self.since = now;
        }
        match self.allowed.checked_sub(1) {
            Some(left) => {
                self.allowed = left;
                Some(std::mem::take(&mut self.n_left_out))
            }
            None => {
                self.n_left_out = self.n_left_out.saturating_add(1);
                None
            }
        }
    }
}

impl Audit {
    pub(crate) fn new(log: AuditLog, failures_per_minute: NonZeroU32) -> Self {
        let denials = Denials { allowed: DENIED_BURST, since: Instant::now(), n_left_out: 0 };
        let (denials, folds) = (Mutex::new(denials), tokio::sync::Mutex::default());
        Self { log, denials, folds, failures: Failures::new(failures_per_minute) }
    }

    /// Records a refusal: once for all repetitions, and only up to a rate for requests
    /// without a key.
    pub(crate) async fn denied(&self, attempt: Attempt, status: u16) {
        metrics::counter!("palpate_requests_denied_total", "status" => status.to_string())
            .increment(1);
        let alike = alike(&attempt, status);
        let mut folds = self.folds.lock().await;
        if folds.again(&alike, now_ms()) {
            return;
        }
        let admitted = if attempt.key.is_some() { Some(0) } else { self.admit() };
        let Some(n_left_out) = admitted else { return };
        let entry = AuditEntry { status: Some(status), n_left_out, ..entry(attempt) };
        match self.log.add(entry).await {
            Ok(entry) => folds.first(alike, entry),
            Err(error) => tracing::warn!(%error, "Cannot write down a refused request"),
        }
    }

    fn admit(&self) -> Option<u32> {
        let mut denials = self.denials.lock().unwrap_or_else(PoisonError::into_inner);
        denials.admit(Instant::now())
    }

    /// Stores the unsaved counts of repetitions.
    pub(crate) async fn store(&self) {
        let news = self.folds.lock().await.news(now_ms());
        for entry in news {
            if let Err(error) = self.log.update(&entry).await {
                tracing::warn!(%error, "Cannot store how often audit entry {} came", entry.seq);
            }
        }
    }

    /// Stores counts periodically until the server stops.
    pub(crate) async fn keep(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        while pause(STORE_EVERY, &mut stopping).await {
            self.store().await;
        }
    }

    /// A page of the log, newest first.
    pub(crate) fn list(&self, query: &wire::AuditQuery) -> Result<wire::AuditPage, Cause> {
        let page = PageQuery { limit: query.limit, cursor: query.cursor.clone() };
        let limit = page_length(&page)?;
        let begin = page.cursor.as_ref().map(|_| page_number(&page)).transpose()?;
        let bound = |pointer, text: &Option<String>| {
            text.as_deref().map(|text| access::milliseconds(pointer, text)).transpose()
        };
        let (since, until) = (bound("?since", &query.since)?, bound("?until", &query.until)?);
        let mut items = Vec::new();
        let mut behind = begin;
        for _ in 0..CHUNKS_MAX {
            let chunk = self.log.before(behind, CHUNK)?;
            let is_last = chunk.len() < CHUNK;
            for entry in chunk {
                // Times decrease with the numbers, and an entry collects repetitions for a
                // while: no older entry can match.
                if since.is_some_and(|since| entry.at_ms.saturating_add(FOLD_MS) < since) {
                    return Ok(wire::AuditPage { items, next_cursor: None });
                }
                if items.len() == limit {
                    return Ok(wire::AuditPage { items, next_cursor: behind.map(cursor) });
                }
                behind = Some(entry.seq);
                let is_within = until.is_none_or(|until| entry.at_ms < until)
                    && since.is_none_or(|since| entry.last_at_ms >= since);
                if is_within && fits(&entry, query) {
                    items.push(access::audit_entry(entry));
                }
            }
            if is_last {
                return Ok(wire::AuditPage { items, next_cursor: None });
            }
        }
        Ok(wire::AuditPage { items, next_cursor: behind.map(cursor) })
    }

    /// Looks again at an entry that another server changed.
    pub(crate) fn heard(&self, space: u8, seq: u64) -> Result<(), StoreError> {
        self.log.heard(space, seq)
    }

    /// Looks again at all entries. Blocks.
    pub(crate) fn heard_all(&self) -> Result<(), StoreError> {
        self.log.heard_all()
    }

    /// Records the request of a change.
    pub(crate) async fn begin(&self, attempt: Attempt) -> Result<AuditEntry, StoreError> {
        self.log.begin(entry(attempt)).await
    }

    /// Records the outcome of a change.
    pub(crate) async fn finish(&self, entry: AuditEntry, alike: Option<Alike>) {
        let seq = entry.seq;
        if let Err(error) = self.settle(entry, alike).await {
            tracing::error!(%error, "Cannot write down what became of audit entry {seq}");
        }
    }

    async fn settle(&self, entry: AuditEntry, alike: Option<Alike>) -> Result<(), StoreError> {
        let Some(alike) = alike else { return self.log.settle(&entry).await };
        let mut folds = self.folds.lock().await;
        if folds.again(&alike, now_ms()) {
            drop(folds);
            return self.log.discard(&entry).await;
        }
        self.log.settle(&entry).await?;
        folds.first(alike, entry);
        Ok(())
    }
}

/// The operation that robots repeat.
pub(crate) const KEEPS_OPEN: &str = "extend_session";

/// The properties that requests counted in one entry share.
pub(crate) fn alike(attempt: &Attempt, status: u16) -> Alike {
    let is_one_thing = attempt.operation == KEEPS_OPEN && status < 400;
    Alike {
        client: attempt.client,
        operation: attempt.operation,
        status,
        resource: is_one_thing.then(|| attempt.path.clone()),
    }
}

fn entry(attempt: Attempt) -> AuditEntry {
    let resource = attempt.path.chars().take(PATH_CHARS_MAX).collect();
    let role = attempt.key.as_ref().map(|(_, _, role)| *role);
    AuditEntry {
        seq: 0,
        at_ms: now_ms(),
        key: attempt.key.map(|(id, name, _)| (id, name)),
        role,
        address: attempt.address,
        operation: attempt.operation.to_owned(),
        resource,
        status: None,
        request_id: attempt.request_id,
        n_left_out: 0,
        n: 1,
        last_at_ms: 0,
    }
}

/// A cursor to the entries older than a number.
fn cursor(seq: u64) -> String {
    seq.to_string()
}

fn fits(entry: &AuditEntry, query: &wire::AuditQuery) -> bool {
    let by = |wanted: &String| {
        entry.key.as_ref().is_some_and(|(id, name)| {
            name == wanted || Uuid::try_parse(wanted).is_ok_and(|wanted| wanted == *id)
        })
    };
    let of = |wanted: &String| *wanted == entry.operation;
    let within = |wanted: wire::AuditRing| wanted == access::ring(entry);
    query.key.as_ref().is_none_or(by)
        && query.operation.as_ref().is_none_or(of)
        && query.ring.is_none_or(within)
}

/// Refuses an unknown operation's name, which would match nothing.
pub(crate) fn check_operation(query: &wire::AuditQuery) -> Result<(), Cause> {
    match &query.operation {
        Some(operation) if operation != "(none)" && roles::rule(operation).is_none() => {
            let expected = "expected an operation's id, such as `delete_object`";
            Err(Cause::field("?operation", format!("came {operation:?}, {expected}")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn essential_operations_exist() {
        for operation in super::ESSENTIAL {
            assert!(crate::roles::rule(operation).is_some(), "{operation}");
        }
    }

    use super::*;

    #[test]
    fn a_flood_of_refusals_leaves_few_entries_and_a_count() {
        let begin = Instant::now();
        let mut denials = Denials { allowed: DENIED_BURST, since: begin, n_left_out: 0 };
        let written = (0..1000).filter(|_| denials.admit(begin) == Some(0)).count();
        assert_eq!(written, 30);
        let later = begin + DENIED_PAUSE + DENIED_PAUSE / 2;
        assert_eq!(denials.admit(later), Some(970));
        assert_eq!(denials.admit(later), None);
        assert_eq!(denials.admit(later + DENIED_PAUSE), Some(1));
    }
}
