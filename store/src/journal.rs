//! Journals: the readings of a session, or of an object in training, in order of arrival.
//!
//! Entries are numbered from 0 without gaps and never change. An append states the number it
//! expects, so the later of two concurrent writers gets an error. A robot's own number is
//! indexed, so a repeated request is found, and so is a retraction: no entry is withdrawn
//! twice. One append is one commit: all its entries or none.

mod stored;
mod append;

use std::collections::BTreeMap;
use std::sync::Arc;

use thiserror::Error;
use uuid::Uuid;

use crate::engine::{self, Engine, EngineError};
use crate::entity::{ReadingId, StoredReading};
use crate::envelope::EnvelopeError;
use crate::error::{RecordError, StoreError};
use crate::key::{self, Space};
use crate::pieces;
pub use crate::pieces::Limit;
use crate::record;
pub(crate) use stored::{JournalRetractionV1, JournalRobotV1, StoredHead};

/// Maximum length of a robot's name, bytes.
pub const ROBOT_BYTES_MAX: usize = 64;
/// Length of an entry's key: space, owner, sequence.
const ENTRY_KEY_BYTES: usize = 25;
/// Number of small records, such as retractions, per read.
const RECORDS_PER_SCAN: usize = 1024;

/// Content of a journal's entry.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "nearly all entries are readings")]
pub enum Event {
    /// A reading.
    Reading(StoredReading),
    /// The retraction of an earlier reading.
    Retraction {
        /// The withdrawn entry.
        seq: u64,
    },
    /// The closing of the session, always the last entry.
    Closed,
}

/// An entry before it is numbered.
#[derive(Clone, Debug, PartialEq)]
pub struct NewEntry {
    /// The robot's own number.
    pub reading_id: Option<ReadingId>,
    /// Time of arrival.
    pub received_at_ms: u64,
    /// Content.
    pub event: Event,
    /// The API key of the writer; `None` if keys are not required.
    pub written_by: Option<Uuid>,
}

/// An entry of a journal.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its number, from 0.
    pub seq: u64,
    /// The robot's own number.
    pub reading_id: Option<ReadingId>,
    /// Time of arrival.
    pub received_at_ms: u64,
    /// Content.
    pub event: Event,
    /// The API key of the writer; `None` if it was not recorded or keys are not required.
    pub written_by: Option<Uuid>,
}

/// A journal as a whole, without its entries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// Number of entries.
    pub length: u64,
    /// Number of withdrawn entries.
    pub n_retracted: u64,
    /// When the last entry came; `None` without entries.
    pub last_at_ms: Option<u64>,
    /// Whether the last entry is [`Event::Closed`].
    pub is_closed: bool,
}

impl Head {
    /// The head after one more entry.
    fn after(self, entry: &NewEntry) -> Self {
        let withdraws = matches!(entry.event, Event::Retraction { .. });
        Self {
            length: self.length + 1,
            n_retracted: self.n_retracted + u64::from(withdraws),
            last_at_ms: Some(entry.received_at_ms),
            is_closed: entry.event == Event::Closed,
        }
    }
}

/// Error of entries that were not appended.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AppendError {
    /// Another writer appended in the meantime.
    #[error("the journal has {found} entries, expected {expected}")]
    Sequence {
        /// The expected number.
        expected: u64,
        /// Number of entries.
        found: u64,
    },
    /// The robot's number is already in the journal, or twice in this append.
    #[error("reading {seq} of robot {robot:?} is entry {at} already")]
    Repeated {
        /// The robot.
        robot: String,
        /// The number.
        seq: u64,
        /// The entry with this number.
        at: u64,
    },
    /// The entry is already withdrawn, or twice in this append.
    #[error("entry {seq} is withdrawn already, by entry {at}")]
    Retracted {
        /// The entry to withdraw.
        seq: u64,
        /// The entry that withdraws it.
        at: u64,
    },
    /// A robot's name is too long.
    #[error("robot's name has {found} bytes, expected at most {ROBOT_BYTES_MAX}")]
    RobotLength {
        /// Length of the name.
        found: usize,
    },
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl From<EngineError> for AppendError {
    fn from(error: EngineError) -> Self {
        Self::Store(error.into())
    }
}

/// The spaces of one family of journals.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JournalSpaces {
    pub(crate) head: Space,
    pub(crate) entries: Space,
    pub(crate) robots: Space,
    /// `None` if entries of these journals cannot be withdrawn.
    pub(crate) retractions: Option<Space>,
}

/// A family of journals, one for each owner.
#[derive(Clone)]
pub struct Journal {
    engine: Arc<dyn Engine>,
    spaces: JournalSpaces,
}

impl Journal {
    pub(crate) fn new(engine: Arc<dyn Engine>, spaces: JournalSpaces) -> Self {
        Self { engine, spaces }
    }

    /// The number of entries of the journal of `owner`; 0 without a journal.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn len(&self, owner: Uuid) -> Result<u64, StoreError> {
        Ok(self.stored_head(owner)?.map_or(0, |(_, head)| head.length()))
    }

    /// The number of readings in all journals of the family, withdrawn ones included. A damaged
    /// journal counts nothing. Linear in the number of journals.
    ///
    /// # Errors
    /// The engine's.
    pub fn n_readings(&self) -> Result<u64, StoreError> {
        let mut total = 0;
        let prefix = key::space(self.spaces.head);
        for page in engine::pages(&*self.engine, &prefix, None, RECORDS_PER_SCAN) {
            for (key, bytes) in &page? {
                let owner = key.get(prefix.len()..).and_then(|id| Uuid::from_slice(id).ok());
                let (Some(owner), Ok(head)) = (owner, record::decode(bytes)) else { continue };
                let Head { length, n_retracted, is_closed, .. } = self.whole(owner, head)?;
                total += length.saturating_sub(n_retracted + u64::from(is_closed));
            }
        }
        Ok(total)
    }

    /// The journal of `owner` as a whole; an empty one when it has none.
    ///
    /// # Errors
    /// As [`Journal::entries`].
    pub fn head(&self, owner: Uuid) -> Result<Head, StoreError> {
        match self.stored_head(owner)? {
            None => Ok(Head::default()),
            Some((_, head)) => self.whole(owner, head),
        }
    }

    /// The bytes of a head and what they say.
    fn stored_head(&self, owner: Uuid) -> Result<Option<(Vec<u8>, StoredHead)>, StoreError> {
        let Some(bytes) = self.engine.get(&key::id(self.spaces.head, owner))? else {
            return Ok(None);
        };
        let head = record::decode(&bytes).map_err(StoreError::damaged(self.spaces.head))?;
        Ok(Some((bytes, head)))
    }

    /// A whole head. What a head of schema 1 does not say is counted in the journal.
    fn whole(&self, owner: Uuid, head: StoredHead) -> Result<Head, StoreError> {
        let length = match head {
            StoredHead::Whole(head) => return Ok(head),
            StoredHead::Length(length) => length,
        };
        let last = match length.checked_sub(1) {
            Some(last) => self.entry(owner, last)?,
            None => None,
        };
        Ok(Head {
            length,
            n_retracted: self.retractions(owner)?.len() as u64,
            last_at_ms: last.as_ref().map(|last| last.received_at_ms),
            is_closed: last.is_some_and(|last| last.event == Event::Closed),
        })
    }

    /// The entry with a robot's own number, among those written with an API key or those
    /// without a recorded key, which may belong to any.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn find(
        &self,
        owner: Uuid,
        id: &ReadingId,
        written_by: Option<Uuid>,
    ) -> Result<Option<u64>, StoreError> {
        if id.robot.len() > ROBOT_BYTES_MAX {
            return Ok(None);
        }
        let number = |key| key::robot(self.spaces.robots, owner, &id.robot, id.seq, key);
        let own = written_by.map(|key| self.engine.get(&number(Some(key)))).transpose()?.flatten();
        let found = match own {
            Some(bytes) => Some(bytes),
            None => self.engine.get(&number(None))?,
        };
        let Some(bytes) = found else { return Ok(None) };
        let found: JournalRobotV1 =
            record::decode(&bytes).map_err(StoreError::damaged(self.spaces.robots))?;
        Ok(Some(found.seq))
    }

    /// The entry that withdraws entry `seq`.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn retraction(&self, owner: Uuid, seq: u64) -> Result<Option<u64>, StoreError> {
        let Some(space) = self.spaces.retractions else { return Ok(None) };
        let Some(bytes) = self.engine.get(&key::numbered(space, owner, seq))? else {
            return Ok(None);
        };
        let found: JournalRetractionV1 =
            record::decode(&bytes).map_err(StoreError::damaged(space))?;
        Ok(Some(found.seq))
    }

    /// All withdrawn entries, each with the entry that withdraws it.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn retractions(&self, owner: Uuid) -> Result<BTreeMap<u64, u64>, StoreError> {
        let mut found = BTreeMap::new();
        let Some(space) = self.spaces.retractions else { return Ok(found) };
        let damaged = StoreError::damaged(space);
        let prefix = key::id(space, owner);
        for page in engine::pages(&*self.engine, &prefix, None, RECORDS_PER_SCAN) {
            for (key, bytes) in &page? {
                let record: JournalRetractionV1 = record::decode(bytes).map_err(&damaged)?;
                let seq: Option<[u8; 8]> = key[prefix.len()..].try_into().ok();
                let seq = u64::from_be_bytes(seq.ok_or_else(|| {
                    let (expected, found) = (ENTRY_KEY_BYTES, key.len());
                    damaged(RecordError::Envelope(EnvelopeError::Length { expected, found }))
                })?);
                found.insert(seq, record.seq);
            }
        }
        Ok(found)
    }

    /// Up to `limit` entries from number `from` on.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], also when an entry is missing; the engine's.
    pub fn entries(&self, owner: Uuid, from: u64, limit: usize) -> Result<Vec<Entry>, StoreError> {
        self.page(owner, from, Limit::records(limit))
    }

    /// The entries from number `from` on, limited by number and by stored bytes.
    ///
    /// # Errors
    /// As [`Journal::entries`].
    pub fn page(&self, owner: Uuid, from: u64, limit: Limit) -> Result<Vec<Entry>, StoreError> {
        let space = self.spaces.entries;
        let length = self.len(owner)?;
        let left = usize::try_from(length.saturating_sub(from)).unwrap_or(usize::MAX);
        let limit = Limit { records: left.min(limit.records), ..limit };
        let after = from.checked_sub(1).map(|before| {
            // After all pieces of the previous entry.
            let mut key = key::numbered(space, owner, before);
            key.extend_from_slice(&[0xff; 5]);
            key
        });
        let prefix = key::id(space, owner);
        let records = pieces::scan(&*self.engine, space, &prefix, ENTRY_KEY_BYTES, after, limit)?;
        let damaged = StoreError::damaged(space);
        let mut entries = Vec::with_capacity(records.len());
        for (seq, (key, bytes)) in (from..).zip(&records) {
            if *key != key::numbered(space, owner, seq) {
                return Err(damaged(RecordError::Entry { seq, length }));
            }
            let entry: Entry = record::decode(bytes).map_err(&damaged)?;
            if entry.seq != seq {
                return Err(damaged(RecordError::Entry { seq, length }));
            }
            entries.push(entry);
        }
        let bytes: usize = records.iter().map(|(_, bytes)| bytes.len()).sum();
        if entries.len() < limit.records && bytes < limit.bytes {
            let seq = from + entries.len() as u64;
            return Err(damaged(RecordError::Entry { seq, length }));
        }
        Ok(entries)
    }

    /// One entry.
    ///
    /// # Errors
    /// As [`Journal::entries`].
    pub fn entry(&self, owner: Uuid, seq: u64) -> Result<Option<Entry>, StoreError> {
        Ok(self.entries(owner, seq, 1)?.pop())
    }

    /// Removes a whole journal.
    ///
    /// # Errors
    /// The engine's.
    pub async fn remove(&self, owner: Uuid) -> Result<(), StoreError> {
        let JournalSpaces { head, entries, robots, retractions } = self.spaces;
        for space in [Some(head), Some(robots), retractions, Some(entries)].into_iter().flatten() {
            pieces::remove_all(&*self.engine, &key::id(space, owner)).await?;
        }
        Ok(())
    }
}
