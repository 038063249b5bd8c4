//! The interface of a storage engine: ordered keys, small values, atomic conditional durable
//! commits.
//!
//! Laws, tested on every engine in `tests/store/engines.rs`: a commit is applied wholly or
//! not at all; its expectations are checked against the state left by all earlier commits;
//! once its [`Pending`] is ready with `Ok`, the writes survive `kill -9` and loss of power;
//! `scan` yields keys in ascending order. A reader may see a write shortly before it is
//! durable.

pub mod opening;
pub mod lease;
pub mod news;
mod pending;
mod cut;
pub mod content;

use std::collections::BTreeMap;
use std::future::Future;
use std::pin::Pin;

use palpate_core::units::Bytes;
use thiserror::Error;
use uuid::Uuid;

use crate::key::Space;
use content::ContentStats;
pub use cut::{Cut, Found, pages};
use lease::{Lease, Leasing};
use news::News;
pub use pending::Pending;

/// Maximum length of a value, bytes; larger records are split by `pieces`.
///
/// sled moves values above 128 KiB to files that it never syncs and never reclaims.
pub const VALUE_BYTES_MAX: usize = 4096;

/// Maximum length of a key, bytes.
pub const KEY_BYTES_MAX: usize = 256;

/// Maximum number of writes of a commit.
pub const COMMIT_WRITES_MAX: usize = 16_384;

/// A key and its value.
pub type Pair = (Vec<u8>, Vec<u8>);

/// The API key that the bytes of a commit count towards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Account {
    /// The key's id; nil without a key.
    pub key: Uuid,
    /// Maximum bytes of the key; `None` for no limit.
    pub quota: Option<u64>,
}

/// Reading that is under way.
pub type Reading = Pin<Box<dyn Future<Output = Result<(), EngineError>> + Send>>;

/// A store of ordered keys and values.
pub trait Engine: Send + Sync + 'static {
    /// The value of `key`.
    ///
    /// # Errors
    /// [`EngineError`] when the engine cannot read.
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError>;

    /// Up to `limit` pairs whose keys begin with `prefix` and are greater than `after`, in
    /// ascending order; fewer only at their end.
    ///
    /// # Errors
    /// [`EngineError`] when the engine cannot read.
    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Pair>, EngineError>;

    /// The keys that [`Engine::scan`] finds. An engine with content elsewhere does not read it.
    ///
    /// # Errors
    /// [`EngineError`] when the engine cannot read.
    fn keys(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Vec<u8>>, EngineError> {
        Ok(self.scan(prefix, after, limit)?.into_iter().map(|(key, _)| key).collect())
    }

    /// Applies a commit atomically if all its expectations hold.
    ///
    /// Returns at once; the [`Pending`] resolves when the commit is durable. A dropped
    /// `Pending` does not undo the commit.
    fn commit(&self, commit: Commit) -> Pending;

    /// Waits until reads see what other processes, if any, committed before this call.
    ///
    /// # Errors
    /// [`EngineError`] when the others' commits cannot be read.
    fn catch_up(&self) -> Reading {
        Box::pin(std::future::ready(Ok(())))
    }

    /// Whether other processes may write to the store while this one has it open.
    fn is_shared(&self) -> bool {
        false
    }

    /// News of what other processes, if any, change in these spaces from now on.
    fn news(&self, spaces: &[Space]) -> News {
        News::of(spaces)
    }

    /// Takes the right `name` unless another process has it.
    ///
    /// # Errors
    /// [`EngineError`] when the store cannot be asked.
    fn lease(&self, _name: &str) -> Leasing {
        Box::pin(std::future::ready(Ok(Some(Lease::lasting()))))
    }

    /// Bytes that each API key holds; those without one have the nil id.
    fn held(&self) -> BTreeMap<Uuid, u64>;

    /// Whether the account of the next commit may write this many bytes more. An engine whose
    /// commits have no account of their own has no quota.
    ///
    /// # Errors
    /// [`EngineError::OverQuota`].
    fn check_quota(&self, _more: u64) -> Result<(), EngineError> {
        Ok(())
    }

    /// The state after all acknowledged commits, readable during later writes. Blocks until
    /// the writer has acknowledged the commits in progress.
    ///
    /// # Errors
    /// [`EngineError::CutsUnderWay`] when too many are being read; [`EngineError`] when the engine
    /// has stopped.
    fn cut(&self) -> Result<Box<dyn Cut>, EngineError>;

    /// Frees the space of removed and replaced records. Reads, writes and cuts continue.
    /// Blocks until it is done; joins a compaction in progress.
    ///
    /// # Errors
    /// [`EngineError::NoRoomToCompact`]; [`EngineError`] when the engine cannot read or write, and
    /// then everything stays unchanged.
    fn compact(&self) -> Result<Compacted, EngineError>;

    /// Statistics of the engine.
    ///
    /// # Errors
    /// [`EngineError`] when the engine cannot determine them.
    fn stats(&self) -> Result<EngineStats, EngineError>;
}

/// Expected state of a key before a commit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Expected {
    /// The key has no value.
    Absent,
    /// The key has exactly this value.
    Value(Vec<u8>),
}

/// Writes that are applied together or not at all, with their conditions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Commit {
    /// Conditions of the commit.
    pub expectations: Vec<(Vec<u8>, Expected)>,
    /// Keys and their new values; `None` removes the key. The last write of a key wins.
    pub writes: Vec<(Vec<u8>, Option<Vec<u8>>)>,
    /// Whether it must work on a full disk and may use the reserve, and bytes beyond the quota.
    pub is_essential: bool,
    /// Account that its bytes count towards.
    pub account: Option<Account>,
    /// Bytes that count to things besides those that it writes: the thing's key, and how many.
    pub counted: Vec<(Vec<u8>, u64)>,
}

impl Commit {
    /// A commit without expectations and writes.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Applies the commit only if `key` has the `expected` state.
    #[must_use]
    pub fn expect(mut self, key: Vec<u8>, expected: Expected) -> Self {
        self.expectations.push((key, expected));
        self
    }

    /// Writes `value` under `key`.
    #[must_use]
    pub fn put(mut self, key: Vec<u8>, value: Vec<u8>) -> Self {
        self.writes.push((key, Some(value)));
        self
    }

    /// Removes `key`; an absent key is no error.
    #[must_use]
    pub fn remove(mut self, key: Vec<u8>) -> Self {
        self.writes.push((key, None));
        self
    }

    /// Checks the limits that every engine relies on.
    ///
    /// # Errors
    /// [`EngineError`] names the limit that is exceeded.
    pub fn check(&self) -> Result<(), EngineError> {
        if self.writes.len() > COMMIT_WRITES_MAX {
            return Err(EngineError::CommitTooLarge { found: self.writes.len() });
        }
        for (key, value) in &self.writes {
            if key.is_empty() || key.len() > KEY_BYTES_MAX {
                return Err(EngineError::KeyLength { found: key.len() });
            }
            if key[0] == 0 {
                return Err(EngineError::KeyReserved);
            }
            let found = value.as_ref().map_or(0, Vec::len);
            if found > VALUE_BYTES_MAX {
                return Err(EngineError::ValueTooLarge { found });
            }
        }
        Ok(())
    }
}

/// Result of a compaction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Compacted {
    /// Bytes on disk before.
    pub before_bytes: u64,
    /// Bytes on disk after.
    pub after_bytes: u64,
    /// Bytes of all stored keys and values.
    pub live_bytes: u64,
}

/// Statistics of an engine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EngineStats {
    /// The engine's name.
    pub engine: &'static str,
    /// Bytes on disk (or in memory), including those of a compaction in progress.
    pub bytes: u64,
    /// Bytes of all stored keys and values.
    pub live_bytes: u64,
    /// Number of completed compactions since it was opened.
    pub compactions: u64,
    /// Free bytes of its file system, if known.
    pub free_bytes: Option<u64>,
    /// Bytes that must stay free: with fewer, writes are refused.
    pub reserve_bytes: u64,
    /// Number of commits applied since it was opened.
    pub commits: u64,
    /// Number of flushes since it was opened; fewer than commits when commits were grouped.
    pub flushes: u64,
    /// Bytes of messages that a cluster sent to this process since it was opened; 0 without one.
    pub received_bytes: u64,
    /// Content in objects beside the records.
    pub content: ContentStats,
}

/// Error of an engine's operation.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum EngineError {
    /// The engine found damage, or cannot read or write its files.
    #[error("the database engine failed while {doing}: {detail}")]
    Failed {
        /// The operation.
        doing: &'static str,
        /// The engine's message.
        detail: String,
    },
    /// An earlier write failed, so the state on disk is unknown; nothing more is written.
    #[error("an earlier write to the database failed, it takes no more writes until restarted")]
    Poisoned,
    /// Too little space is left on the disk; nothing was written.
    #[error(
        "the disk is full: {} are free and {} must stay free",
        Bytes(*.free), Bytes(*.reserve)
    )]
    Full {
        /// Bytes that are free.
        free: u64,
        /// Bytes that must stay free.
        reserve: u64,
    },
    /// The key would hold more than its quota; nothing was written.
    #[error(
        "this key holds {:.3} MB of stored data and may hold {:.3} MB: these {more} bytes do not \
         fit; remove sessions, objects or versions that it wrote, or ask an administrator for \
         more (`--store-quota-mb`)", *.held as f64 / 1e6, *.quota as f64 / 1e6
    )]
    OverQuota {
        /// Bytes that it holds.
        held: u64,
        /// Bytes that do not fit.
        more: u64,
        /// Bytes that it may hold.
        quota: u64,
    },
    /// Too little space is left on the disk for a compaction.
    #[error(
        "no room to compact: it needs {}, {} are free and {} must stay free",
        Bytes(*.needed), Bytes(*.free), Bytes(*.reserve)
    )]
    NoRoomToCompact {
        /// Bytes that it needs while it runs.
        needed: u64,
        /// Bytes that are free.
        free: u64,
        /// Bytes that must stay free.
        reserve: u64,
    },
    /// Too many cuts are being read.
    #[error("{max} snapshots are being taken already")]
    CutsUnderWay {
        /// Maximum number.
        max: usize,
    },
    /// Too much was written while a cut was read.
    #[error("too much was written while the snapshot was taken, expected at most {max} bytes")]
    CutTooLarge {
        /// Maximum number of bytes remembered for cuts.
        max: usize,
    },
    /// A key begins with a byte that the engine reserves.
    #[error("key begins with byte 0, which the engine keeps for its own records")]
    KeyReserved,
    /// Too many commits are waiting.
    #[error("too many writes are waiting for the database, expected at most {queue_max}")]
    Busy {
        /// Maximum number of waiting commits.
        queue_max: usize,
    },
    /// One server at a time may do this, and another one does it now.
    #[error("another server is busy with {what}: try again")]
    Elsewhere {
        /// What it does.
        what: String,
    },
    /// The engine has been shut down.
    #[error("the database has been shut down")]
    Stopped,
    /// A value is larger than [`VALUE_BYTES_MAX`].
    #[error("value has {found} bytes, expected at most {VALUE_BYTES_MAX}")]
    ValueTooLarge {
        /// Length of the value.
        found: usize,
    },
    /// A key is empty or longer than [`KEY_BYTES_MAX`].
    #[error("key has {found} bytes, expected 1 to {KEY_BYTES_MAX}")]
    KeyLength {
        /// Length of the key.
        found: usize,
    },
    /// A commit has more than [`COMMIT_WRITES_MAX`] writes.
    #[error("commit has {found} writes, expected at most {COMMIT_WRITES_MAX}")]
    CommitTooLarge {
        /// Number of writes.
        found: usize,
    },
}

/// Error of a commit that was not applied.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CommitError {
    /// An expectation does not hold; nothing was written.
    #[error("expectation {expectation} of the commit does not hold")]
    Conflict {
        /// Index among the commit's expectations.
        expectation: usize,
    },
    /// The engine failed; whether anything was written is unknown.
    #[error(transparent)]
    Engine(#[from] EngineError),
}
