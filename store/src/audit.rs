//! The audit log: requests in the order of their arrival, in three rings.
//!
//! Changes, refusals of requests with a key, and refusals of requests without one have rings
//! with sizes of their own, so none displaces entries of another. The entry of a change is
//! durable, without a status, before the change is made. It is settled afterwards, and leaves
//! the ring of changes when nothing was changed. An entry without a status may or may not
//! have taken effect: the server stopped, or the caller went away. Sequence numbers count
//! over all rings, increase and are never reused; times never decrease. Both hold over all servers
//! that write to one log (`crowd`). In a full ring the key with most entries makes room (`shares`).

mod stored;
mod shares;
mod crowd;

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use uuid::Uuid;

use crate::access::Role;
use crate::amended::Amended;
use crate::engine::{self, Commit, Engine};
use crate::error::{StoreError, unconditional};
use crate::key::{self, Space};
use crate::pieces;
use crate::record;
pub(crate) use crowd::AuditHeadV1;
use crowd::Crowd;
use shares::{Maker, Shares};

/// Maximum number of old entries removed by one commit after the log was opened with smaller
/// rings.
const TRIM_MAX: u64 = 1000;
/// Number of keys per read.
const KEYS_PER_SCAN: usize = 1024;

/// A part of the log with its own size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ring {
    /// Requests that changed something, or may have.
    Changes,
    /// Requests with a key that were refused or failed.
    Refused,
    /// Requests without a key that were refused or failed.
    Strangers,
}

/// Number of entries that each ring keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RingSizes {
    /// Size of [`Ring::Changes`].
    pub changes: u64,
    /// Size of [`Ring::Refused`].
    pub refused: u64,
    /// Size of [`Ring::Strangers`].
    pub strangers: u64,
}

/// A request, made once or several times.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditEntry {
    /// Sequence number in the log, from 1; set by the log.
    pub seq: u64,
    /// Time of the first request, not before that of the previous entry. Set by the log.
    pub at_ms: u64,
    /// Id and name of the key; `None` without a known key.
    pub key: Option<(Uuid, String)>,
    /// Role of the caller.
    pub role: Option<Role>,
    /// Address of the caller.
    pub address: String,
    /// Operation, by its id in the API's description.
    pub operation: String,
    /// Path of the API; that of the first request when there were several.
    pub resource: String,
    /// HTTP status of the answer; `None` while unknown.
    pub status: Option<u16>,
    /// Id of the request, as in the server's log.
    pub request_id: String,
    /// Number of refusals omitted before this one.
    pub n_left_out: u32,
    /// Number of requests with this outcome.
    pub n: u32,
    /// Time of the last request.
    pub last_at_ms: u64,
}

impl AuditEntry {
    /// The key whose share of a ring it takes.
    fn maker(&self) -> Maker {
        self.key.as_ref().map(|(id, _)| *id)
    }

    /// The ring for an entry with this outcome.
    #[must_use]
    pub fn ring(&self) -> Ring {
        match (self.status, &self.key) {
            (None | Some(..400), _) => Ring::Changes,
            (Some(_), Some(_)) => Ring::Refused,
            (Some(_), None) => Ring::Strangers,
        }
    }
}

impl Ring {
    const ALL: [Self; 3] = [Self::Changes, Self::Refused, Self::Strangers];

    fn space(self) -> Space {
        match self {
            Self::Changes => Space::Audit,
            Self::Refused => Space::AuditRefused,
            Self::Strangers => Space::AuditStrangers,
        }
    }
}

/// The audit log. Open one per database, and share it.
pub struct AuditLog {
    engine: Arc<dyn Engine>,
    /// The engine for entries of operations that must work on a full disk.
    essential: Amended,
    is_essential: fn(&str) -> bool,
    sizes: RingSizes,
    known: Mutex<Known>,
    crowd: Crowd,
}

/// Index of the log, without the entries.
#[derive(Debug)]
struct Known {
    next: u64,
    last_ms: u64,
    /// The entries of each ring, in the order of [`Ring::ALL`].
    rings: [Shares; 3],
    /// Unsettled entries, which displace none.
    pending: BTreeSet<u64>,
}

impl AuditLog {
    /// Reads the sequence numbers. Blocks.
    pub(crate) fn open(
        engine: Arc<dyn Engine>,
        sizes: RingSizes,
        is_essential: fn(&str) -> bool,
    ) -> Result<Self, StoreError> {
        let mut rings: [Shares; 3] = Default::default();
        for ring in Ring::ALL {
            rings[ring as usize] = stored_shares(&*engine, ring)?;
        }
        let newest = Ring::ALL
            .into_iter()
            .filter_map(|ring| rings[ring as usize].last().map(|seq| (seq, ring)))
            .max_by_key(|(seq, _)| *seq);
        let next = newest.map_or(1, |(seq, _)| seq + 1);
        let pending = BTreeSet::new();
        let known = Mutex::new(Known { next, last_ms: 0, rings, pending });
        let essential = Amended::essential(Arc::clone(&engine));
        let crowd = Crowd::default();
        let log = Self { engine, essential, is_essential, sizes, known, crowd };
        if let Some((seq, ring)) = newest {
            let last = log.read(ring, seq)?;
            log.known().last_ms = last.map_or(0, |entry| entry.at_ms);
        }
        Ok(log)
    }

    /// The engine with which an entry is written.
    fn engine_of(&self, entry: &AuditEntry) -> &dyn Engine {
        if (self.is_essential)(&entry.operation) { &self.essential } else { &*self.engine }
    }

    /// Stores the entry of a change that is about to be made, without a status, under the
    /// next number; durable when it returns. It must be settled or discarded.
    ///
    /// # Errors
    /// The engine's.
    pub async fn begin(&self, entry: AuditEntry) -> Result<AuditEntry, StoreError> {
        if self.engine.is_shared() {
            let entry = AuditEntry { status: None, ..entry };
            return self.append_in_crowd(Ring::Changes, entry).await;
        }
        let (entry, pending) = {
            let mut known = self.known();
            let entry = AuditEntry { status: None, ..known.numbered(entry) };
            known.pending.insert(entry.seq);
            known.rings[Ring::Changes as usize].insert(entry.seq, entry.maker());
            let commit = put(Commit::new(), Ring::Changes, &entry);
            let engine = self.engine_of(&entry);
            (entry, engine.commit(commit))
        };
        pending.await.map_err(unconditional)?;
        Ok(entry)
    }

    /// Stores an entry with a known outcome under the next number, and removes the oldest of
    /// its ring above the limit; durable when it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn add(&self, entry: AuditEntry) -> Result<AuditEntry, StoreError> {
        if self.engine.is_shared() {
            return self.append_in_crowd(entry.ring(), entry).await;
        }
        let (entry, pending) = {
            let mut known = self.known();
            let entry = known.numbered(entry);
            let ring = entry.ring();
            known.rings[ring as usize].insert(entry.seq, entry.maker());
            let commit = put(Commit::new(), ring, &entry);
            let engine = self.engine_of(&entry);
            (entry, engine.commit(self.trim(commit, &mut known, ring)))
        };
        pending.await.map_err(unconditional)?;
        Ok(entry)
    }

    /// Records the outcome of an entry that was begun, and moves it to its ring; durable when
    /// it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn settle(&self, entry: &AuditEntry) -> Result<(), StoreError> {
        let pending = {
            let mut known = self.known();
            known.pending.remove(&entry.seq);
            let ring = entry.ring();
            let mut commit = Commit::new();
            if ring != Ring::Changes {
                known.rings[Ring::Changes as usize].remove(entry.seq);
                commit = commit.remove(key_of(Ring::Changes, entry.seq));
            }
            known.rings[ring as usize].insert(entry.seq, entry.maker());
            let commit = put(commit, ring, entry);
            self.engine_of(entry).commit(self.trim(commit, &mut known, ring))
        };
        pending.await.map_err(unconditional)?;
        Ok(())
    }

    /// Removes an entry that was begun and is covered by another one.
    ///
    /// # Errors
    /// The engine's.
    pub async fn discard(&self, entry: &AuditEntry) -> Result<(), StoreError> {
        let pending = {
            let mut known = self.known();
            known.pending.remove(&entry.seq);
            known.rings[Ring::Changes as usize].remove(entry.seq);
            self.engine.commit(Commit::new().remove(key_of(Ring::Changes, entry.seq)))
        };
        pending.await.map_err(unconditional)?;
        Ok(())
    }

    /// Rewrites a settled entry unless it has left the log; durable when it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn update(&self, entry: &AuditEntry) -> Result<(), StoreError> {
        let pending = {
            let known = self.known();
            let ring = entry.ring();
            if !known.rings[ring as usize].contains(entry.seq) {
                return Ok(());
            }
            self.engine_of(entry).commit(put(Commit::new(), ring, entry))
        };
        pending.await.map_err(unconditional)?;
        Ok(())
    }

    /// Up to `limit` entries with a number below `seq` (any, when it is `None`), newest
    /// first, of all rings.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn before(&self, seq: Option<u64>, limit: usize) -> Result<Vec<AuditEntry>, StoreError> {
        let (mut end, mut found) = (seq, Vec::new());
        while found.len() < limit {
            let wanted = self.known().before(end, limit - found.len());
            let Some((last, _)) = wanted.last() else { break };
            end = Some(*last);
            for (seq, ring) in wanted {
                // A missing entry has left the log in the meantime.
                found.extend(self.read(ring, seq)?);
            }
        }
        Ok(found)
    }

    fn read(&self, ring: Ring, seq: u64) -> Result<Option<AuditEntry>, StoreError> {
        let space = ring.space();
        let bytes = pieces::read(&*self.engine, space, &key_of(ring, seq))?;
        let decoded = bytes.map(|bytes| record::decode(&bytes)).transpose();
        decoded.map_err(StoreError::damaged(space))
    }

    /// Adds the removal of a ring's settled entries above its limit.
    fn trim(&self, commit: Commit, known: &mut Known, ring: Ring) -> Commit {
        let size = match ring {
            Ring::Changes => self.sizes.changes,
            Ring::Refused => self.sizes.refused,
            Ring::Strangers => self.sizes.strangers,
        };
        let Known { rings, pending, .. } = known;
        let entries = &mut rings[ring as usize];
        let n_pending = if ring == Ring::Changes { pending.len() as u64 } else { 0 };
        let above = entries.len().saturating_sub(n_pending + size.max(1));
        (0..above.min(TRIM_MAX)).fold(commit, |commit, _| match entries.next_out(pending) {
            None => commit,
            Some(seq) => {
                entries.remove(seq);
                commit.remove(key_of(ring, seq))
            }
        })
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        // All numbers change together, after everything that could panic.
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Known {
    /// The entry with the next number and a time that does not decrease.
    fn numbered(&mut self, entry: AuditEntry) -> AuditEntry {
        let at_ms = entry.at_ms.max(self.last_ms);
        let seq = self.next;
        (self.next, self.last_ms) = (seq + 1, at_ms);
        AuditEntry { seq, at_ms, last_at_ms: entry.last_at_ms.max(at_ms), ..entry }
    }

    /// The `limit` largest numbers below `end`, largest first, with their rings.
    fn before(&self, end: Option<u64>, limit: usize) -> Vec<(u64, Ring)> {
        let below =
            |ring: Ring| self.rings[ring as usize].before(end, limit).map(move |seq| (seq, ring));
        let mut found: Vec<_> = Ring::ALL.into_iter().flat_map(below).collect();
        found.sort_unstable_by_key(|(seq, _)| std::cmp::Reverse(*seq));
        found.truncate(limit);
        found
    }
}

/// The entries in a ring.
fn stored_shares(engine: &dyn Engine, ring: Ring) -> Result<Shares, StoreError> {
    let prefix = key::space(ring.space());
    let mut found = Shares::default();
    for page in engine::pages(engine, &prefix, None, KEYS_PER_SCAN) {
        for (key, value) in page? {
            let number = key[1..].try_into().map(u64::from_be_bytes);
            if let Ok(seq) = number {
                found.insert(seq, maker(engine, ring, &key, &value)?);
            }
        }
    }
    Ok(found)
}

/// The key that made an entry, of which `value` is the first piece; none of a damaged one.
fn maker(engine: &dyn Engine, ring: Ring, key: &[u8], value: &[u8]) -> Result<Maker, StoreError> {
    let entry = match record::decode::<AuditEntry>(value) {
        Ok(entry) => Some(entry),
        Err(_) => match pieces::read(engine, ring.space(), key) {
            Ok(whole) => whole.and_then(|whole| record::decode(&whole).ok()),
            Err(StoreError::Damaged { .. }) => None,
            Err(error) => return Err(error),
        },
    };
    Ok(entry.and_then(|entry: AuditEntry| entry.maker()))
}

fn key_of(ring: Ring, seq: u64) -> Vec<u8> {
    [&key::space(ring.space())[..], &seq.to_be_bytes()].concat()
}

fn put(commit: Commit, ring: Ring, entry: &AuditEntry) -> Commit {
    pieces::put(commit, &key_of(ring, entry.seq), &record::encode(entry), None)
}
