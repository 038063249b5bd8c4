//! Entries of a log that several servers write: one order, and no number twice.
//!
//! One record holds the last number and its time. Every commit of new entries expects it and
//! replaces it, so that a server that another one overtook numbers its entries again. Entries that
//! wait at the same time share a commit.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use bincode::{Decode, Encode};
use futures::channel::oneshot;

use super::{AuditEntry, AuditLog, Ring, key_of, put};
use crate::engine::{Commit, Engine, Expected};
use crate::envelope::Kind;
use crate::error::{StoreError, conflict};
use crate::key::{self, Space};
use crate::record::{self, Plain};

/// Maximum number of entries of one commit.
const AT_ONCE: usize = 100;
/// Attempts to number entries while other servers are faster. Chosen: each time another server
/// has stored some.
const ATTEMPTS: usize = 256;

/// The last number of a log that several servers write, and its time (ms since 1970).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Encode, Decode)]
pub(crate) struct AuditHeadV1 {
    seq: u64,
    at_ms: u64,
}

impl Plain for AuditHeadV1 {
    const KIND: Kind = Kind::AuditHead;
}

/// An entry that waits for its number.
struct Waiting {
    ring: Ring,
    entry: AuditEntry,
    answer: oneshot::Sender<Result<AuditEntry, StoreError>>,
}

/// The entries that wait for their numbers.
#[derive(Default)]
pub(super) struct Crowd {
    waiting: Mutex<VecDeque<Waiting>>,
    /// Held by the one who stores the first of them.
    turn: futures::lock::Mutex<()>,
}

impl Crowd {
    fn waiting(&self) -> MutexGuard<'_, VecDeque<Waiting>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl AuditLog {
    /// Stores an entry under the next number of all servers; durable when it returns.
    pub(super) async fn append_in_crowd(
        &self,
        ring: Ring,
        entry: AuditEntry,
    ) -> Result<AuditEntry, StoreError> {
        let (answer, mut answered) = oneshot::channel();
        self.crowd.waiting().push_back(Waiting { ring, entry, answer });
        let _turn = self.crowd.turn.lock().await;
        loop {
            // An entry leaves the queue only with an answer.
            if let Ok(Some(stored)) = answered.try_recv() {
                return stored;
            }
            // Entries stay in the queue until they are stored: this task may be dropped meanwhile.
            let first: Vec<(Ring, AuditEntry)> = {
                let waiting = self.crowd.waiting();
                waiting.iter().take(AT_ONCE).map(|it| (it.ring, it.entry.clone())).collect()
            };
            let n_entries = first.len();
            let stored = self.store_next(first).await;
            let done: Vec<Waiting> = self.crowd.waiting().drain(..n_entries).collect();
            for (number, waiting) in done.into_iter().enumerate() {
                let answer = stored.as_ref().map(|stored| stored[number].clone());
                // The one who waited may have gone.
                let _ = waiting.answer.send(answer.map_err(StoreError::clone));
            }
        }
    }

    /// Stores entries under the next numbers, all or none.
    async fn store_next(
        &self,
        entries: Vec<(Ring, AuditEntry)>,
    ) -> Result<Vec<AuditEntry>, StoreError> {
        let is_essential = entries.iter().any(|(_, entry)| (self.is_essential)(&entry.operation));
        let engine: &dyn Engine = if is_essential { &self.essential } else { &*self.engine };
        let trims = {
            let mut known = self.known();
            let trim = |commit, ring| self.trim(commit, &mut known, ring);
            Ring::ALL.into_iter().fold(Commit::new(), trim)
        };
        let head = key::space(Space::AuditHead);
        for _ in 0..ATTEMPTS {
            let before = engine.get(&head)?;
            let last = before.as_deref().map(record::decode).transpose();
            let last: AuditHeadV1 =
                last.map_err(StoreError::damaged(Space::AuditHead))?.unwrap_or_default();
            let numbered = self.numbered_after(last, &entries);
            let Some(newest) = numbered.last() else { return Ok(numbered) };
            let after = AuditHeadV1 { seq: newest.seq, at_ms: newest.at_ms };
            let expected = before.map_or(Expected::Absent, Expected::Value);
            let mut commit = trims.clone().expect(head.clone(), expected);
            commit = commit.put(head.clone(), record::encode(&after));
            for ((ring, _), entry) in entries.iter().zip(&numbered) {
                commit = put(commit, *ring, entry);
            }
            match engine.commit(commit).await.map_err(conflict) {
                Ok(()) => {
                    self.learn(&entries, &numbered);
                    return Ok(numbered);
                }
                Err(Ok(_)) => {}
                Err(Err(error)) => return Err(error.into()),
            }
        }
        Err(StoreError::Changed { what: "audit log", id: uuid::Uuid::nil() })
    }

    /// The entries with the numbers after the last one of all servers.
    fn numbered_after(&self, last: AuditHeadV1, entries: &[(Ring, AuditEntry)]) -> Vec<AuditEntry> {
        let (next, mut last_ms) = {
            let known = self.known();
            (known.next.max(last.seq + 1), known.last_ms.max(last.at_ms))
        };
        let number = |(seq, (_, entry)): (u64, &(Ring, AuditEntry))| {
            last_ms = last_ms.max(entry.at_ms);
            let last_at_ms = entry.last_at_ms.max(last_ms);
            AuditEntry { seq, at_ms: last_ms, last_at_ms, ..entry.clone() }
        };
        (next..).zip(entries).map(number).collect()
    }

    fn learn(&self, entries: &[(Ring, AuditEntry)], numbered: &[AuditEntry]) {
        let mut known = self.known();
        for ((ring, _), entry) in entries.iter().zip(numbered) {
            (known.next, known.last_ms) = (known.next.max(entry.seq + 1), entry.at_ms);
            known.rings[*ring as usize].insert(entry.seq, entry.maker());
            if entry.status.is_none() {
                known.pending.insert(entry.seq);
            }
        }
    }

    /// Looks again for an entry that another server changed.
    ///
    /// # Errors
    /// The engine's.
    pub fn heard(&self, space: u8, seq: u64) -> Result<(), StoreError> {
        let Some(ring) = Ring::ALL.into_iter().find(|ring| ring.space() as u8 == space) else {
            return Ok(());
        };
        let key = key_of(ring, seq);
        let found = self.engine.get(&key)?;
        let maker =
            found.map(|first| super::maker(&*self.engine, ring, &key, &first)).transpose()?;
        let mut known = self.known();
        known.next = known.next.max(seq + 1);
        match maker {
            Some(maker) => known.rings[ring as usize].insert(seq, maker),
            None => known.rings[ring as usize].remove(seq),
        }
        Ok(())
    }

    /// Looks again for all entries. Blocks.
    ///
    /// # Errors
    /// The engine's.
    pub fn heard_all(&self) -> Result<(), StoreError> {
        for ring in Ring::ALL {
            let found = super::stored_shares(&*self.engine, ring)?;
            let mut known = self.known();
            known.next = known.next.max(found.last().map_or(1, |seq| seq + 1));
            known.rings[ring as usize] = found;
        }
        Ok(())
    }
}
