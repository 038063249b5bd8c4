//! The audit log: who changed what, in the order in which it was asked for.
//!
//! An entry is durable before the change is made, without a status; the status is added
//! afterwards. An entry without one says that the change may or may not have been made: the
//! server stopped, or the caller went away. The log keeps the newest entries, as many as it is
//! opened for. Sequence numbers go up and are never used again; times never go down.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use uuid::Uuid;

use crate::access::Role;
use crate::engine::{Commit, CommitError, Engine, EngineError};
use crate::error::StoreError;
use crate::key::{self, Space};
use crate::pieces::{self, Limit};
use crate::record;

/// How many old entries an append removes at most, when the log was opened for fewer.
const TRIM_MAX: u64 = 1000;
/// How many entries are read at once.
const WINDOW: u64 = 256;
/// An entry's key: the space's letter and its number.
const KEY_BYTES: usize = 9;

/// Something that was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditEntry {
    /// Its place in the log, from 1; set by [`AuditLog::append`].
    pub seq: u64,
    /// When, not before the entry before it; set by [`AuditLog::append`].
    pub at_ms: u64,
    /// The key that asked, by id and name; `None` when there was none, or none that is known.
    pub key: Option<(Uuid, String)>,
    /// What the asker was taken for.
    pub role: Option<Role>,
    /// The address it came from.
    pub address: String,
    /// The operation, by its id in the API's description.
    pub operation: String,
    /// What it was about: a path of the API.
    pub resource: String,
    /// The HTTP status of the answer; `None` as long as it is not known.
    pub status: Option<u16>,
    /// The request's id, as in the server's log.
    pub request_id: String,
    /// How many refusals before this one were left out.
    pub n_left_out: u32,
}

/// The log. Open one for a database, and share it.
pub struct AuditLog {
    engine: Arc<dyn Engine>,
    entries_max: u64,
    ends: Mutex<Ends>,
}

/// The numbers of the oldest entry and of the next, and the newest time.
#[derive(Clone, Copy, Debug)]
struct Ends {
    first: u64,
    next: u64,
    last_ms: u64,
}

impl AuditLog {
    /// Finds the ends of the log. Blocks.
    pub(crate) fn open(engine: Arc<dyn Engine>, entries_max: u64) -> Result<Self, StoreError> {
        let ends = Mutex::new(Ends { first: 1, next: 1, last_ms: 0 });
        let log = Self { engine, entries_max: entries_max.max(1), ends };
        let first = log.after(0, 1)?.first().map_or(1, |entry| entry.seq);
        let next = log.next()?;
        let last_ms = log.after(next.saturating_sub(2), 1)?.first().map_or(0, |entry| entry.at_ms);
        *log.ends() = Ends { first, next, last_ms };
        Ok(log)
    }

    /// Stores an entry with the next number, and removes the oldest above the bound; durable
    /// when it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn append(&self, entry: AuditEntry) -> Result<AuditEntry, StoreError> {
        let (entry, pending) = {
            // Numbers are given and commits are sent in the same order.
            let mut ends = self.ends();
            let at_ms = entry.at_ms.max(ends.last_ms);
            let entry = AuditEntry { seq: ends.next, at_ms, ..entry };
            let mut commit = put(Commit::new(), &entry);
            let above = (ends.next + 1 - ends.first).saturating_sub(self.entries_max);
            for seq in (ends.first..).take(above.min(TRIM_MAX) as usize) {
                commit = commit.remove(key_of(seq));
                ends.first = seq + 1;
            }
            (ends.next, ends.last_ms) = (entry.seq + 1, at_ms);
            (entry, self.engine.commit(commit))
        };
        pending.await.map_err(engine_error)?;
        Ok(entry)
    }

    /// Writes down what became of an entry that was appended; durable when it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn finish(&self, entry: &AuditEntry) -> Result<(), StoreError> {
        let pending = {
            let ends = self.ends();
            // It has left the log meanwhile.
            if entry.seq < ends.first {
                return Ok(());
            }
            self.engine.commit(put(Commit::new(), entry))
        };
        pending.await.map_err(engine_error)?;
        Ok(())
    }

    /// Up to `limit` entries with a number below `seq` (all, when it is `None`), newest first.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn before(&self, seq: Option<u64>, limit: usize) -> Result<Vec<AuditEntry>, StoreError> {
        let Ends { first, next, .. } = *self.ends();
        let mut end = seq.map_or(next, |seq| seq.min(next));
        let mut found = Vec::new();
        while found.len() < limit && end > first {
            let begin = end.saturating_sub(WINDOW).max(first);
            let window = self.after(begin - 1, (end - begin) as usize)?;
            found.extend(window.into_iter().filter(|entry| entry.seq < end).rev());
            end = begin;
        }
        found.truncate(limit);
        Ok(found)
    }

    /// Up to `limit` entries with a number above `seq`, oldest first.
    fn after(&self, seq: u64, limit: usize) -> Result<Vec<AuditEntry>, StoreError> {
        // Behind all pieces of the entry.
        let mut behind = key_of(seq);
        behind.extend_from_slice(&[0xff; 5]);
        let (space, prefix) = (Space::Audit, key::space(Space::Audit));
        let records = pieces::scan(
            &*self.engine,
            space,
            &prefix,
            KEY_BYTES,
            Some(behind),
            Limit::records(limit),
        )?;
        let decoded: Result<Vec<_>, _> =
            records.iter().map(|(_, bytes)| record::decode(bytes)).collect();
        decoded.map_err(StoreError::damaged(space))
    }

    /// The number behind the newest entry, by halving: nobody has to keep a count.
    fn next(&self) -> Result<u64, StoreError> {
        let (mut low, mut high) = (0, u64::MAX - 1);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.engine.scan(&key::space(Space::Audit), Some(&key_of(middle)), 1)?.is_empty() {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        Ok(low + 1)
    }

    fn ends(&self) -> MutexGuard<'_, Ends> {
        // Numbers are changed together, after everything that could panic.
        self.ends.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn key_of(seq: u64) -> Vec<u8> {
    let mut key = key::space(Space::Audit);
    key.extend_from_slice(&seq.to_be_bytes());
    key
}

fn put(commit: Commit, entry: &AuditEntry) -> Commit {
    pieces::put(commit, &key_of(entry.seq), &record::encode(entry), None)
}

fn engine_error(error: CommitError) -> EngineError {
    match error {
        CommitError::Engine(error) => error,
        CommitError::Conflict { .. } => unreachable!("commits of the log expect nothing"),
    }
}
