//! The narrow trait behind which a storage engine hides: ordered keys, small values, and
//! commits that are atomic, conditional and durable.
//!
//! Laws, held by `tests/engines.rs` on every engine: a commit is applied wholly or not at
//! all; its expectations are checked against the state left by all earlier commits; once its
//! [`Pending`] is ready with `Ok`, the writes survive `kill -9` and loss of power; `scan`
//! yields keys in ascending order. A reader may see a write shortly before it is durable.

use std::future::Future;
use std::path::PathBuf;
use std::pin::Pin;
use std::task::{Context, Poll};

use futures::channel::oneshot;
use thiserror::Error;

/// No value may be larger, in bytes; larger things are split by `pieces`.
///
/// sled moves values above 128 KiB to files that it never syncs and never reclaims.
pub const VALUE_BYTES_MAX: usize = 4096;

/// No key may be longer, in bytes.
pub const KEY_BYTES_MAX: usize = 256;

/// No commit may have more writes.
pub const COMMIT_WRITES_MAX: usize = 16_384;

/// A key and its value.
pub type Pair = (Vec<u8>, Vec<u8>);

/// An engine that holds the database's keys and values.
pub trait Engine: Send + Sync + 'static {
    /// The value of `key`.
    ///
    /// # Errors
    /// [`EngineError`] when the engine cannot read.
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError>;

    /// Up to `limit` pairs whose keys begin with `prefix` and are greater than `after`, in
    /// ascending order.
    ///
    /// # Errors
    /// [`EngineError`] when the engine cannot read.
    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Pair>, EngineError>;

    /// Applies a commit atomically if all its expectations hold.
    ///
    /// Returns at once; the answer comes through the [`Pending`], when the commit is durable.
    /// A dropped `Pending` does not undo the commit.
    fn commit(&self, commit: Commit) -> Pending;

    /// What the engine holds.
    ///
    /// # Errors
    /// [`EngineError`] when the engine cannot tell.
    fn stats(&self) -> Result<EngineStats, EngineError>;
}

/// What a key must hold for a commit to be applied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Expected {
    /// The key has no value.
    Absent,
    /// The key has exactly this value.
    Value(Vec<u8>),
}

/// Writes that are applied together or not at all, and what must hold for it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Commit {
    /// What must hold before.
    pub expectations: Vec<(Vec<u8>, Expected)>,
    /// Keys and their new values; `None` removes the key. The last write of a key wins.
    pub writes: Vec<(Vec<u8>, Option<Vec<u8>>)>,
}

impl Commit {
    /// A commit that expects and writes nothing.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Applies the commit only if `key` holds what is `expected`.
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

    /// Removes `key`; a key that is absent already is no error.
    #[must_use]
    pub fn remove(mut self, key: Vec<u8>) -> Self {
        self.writes.push((key, None));
        self
    }

    /// Checks the bounds every engine relies on.
    ///
    /// # Errors
    /// [`EngineError`] names the bound that is exceeded.
    pub fn check(&self) -> Result<(), EngineError> {
        if self.writes.len() > COMMIT_WRITES_MAX {
            return Err(EngineError::CommitTooLarge { found: self.writes.len() });
        }
        for (key, value) in &self.writes {
            if key.is_empty() || key.len() > KEY_BYTES_MAX {
                return Err(EngineError::KeyLength { found: key.len() });
            }
            let found = value.as_ref().map_or(0, Vec::len);
            if found > VALUE_BYTES_MAX {
                return Err(EngineError::ValueTooLarge { found });
            }
        }
        Ok(())
    }
}

/// The answer of a commit that is under way. Await it, or [`Pending::wait`] on a thread.
#[derive(Debug)]
pub struct Pending(oneshot::Receiver<Result<(), CommitError>>);

impl Pending {
    /// A pending answer and the end to answer it at.
    #[must_use]
    pub fn channel() -> (oneshot::Sender<Result<(), CommitError>>, Self) {
        let (sender, receiver) = oneshot::channel();
        (sender, Self(receiver))
    }

    /// An answer that is known already.
    #[must_use]
    pub fn ready(answer: Result<(), CommitError>) -> Self {
        let (sender, pending) = Self::channel();
        // The receiver is alive, it is in `pending`.
        let _ = sender.send(answer);
        pending
    }

    /// Blocks this thread until the answer is there. Not for async threads.
    ///
    /// # Errors
    /// What the commit answers.
    pub fn wait(self) -> Result<(), CommitError> {
        futures::executor::block_on(self)
    }
}

impl Future for Pending {
    type Output = Result<(), CommitError>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        Pin::new(&mut self.0)
            .poll(context)
            .map(|answer| answer.unwrap_or(Err(CommitError::Engine(EngineError::Stopped))))
    }
}

/// What an engine holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EngineStats {
    /// The engine's name.
    pub engine: &'static str,
    /// Bytes on disk (or in memory).
    pub bytes: u64,
    /// Commits applied since it was opened.
    pub commits: u64,
    /// Flushes since it was opened; fewer than commits where commits were grouped.
    pub flushes: u64,
}

/// Why an engine could not be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// Another process has the folder open.
    #[error("the database in {folder} is in use by another process (it holds {lock})")]
    InUse {
        /// The database's folder.
        folder: PathBuf,
        /// The file that is locked.
        lock: PathBuf,
    },
    /// The folder or a file in it cannot be used.
    #[error("cannot use {path} for the database: {source}")]
    Io {
        /// What could not be used.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The engine found its own files damaged.
    #[error(
        "the database in {folder} is damaged and was left as it is ({detail}); \
         restore a snapshot or a copy of the folder"
    )]
    Damaged {
        /// The database's folder.
        folder: PathBuf,
        /// What the engine said.
        detail: String,
    },
    /// The operating system gives no thread for the writer.
    #[error("cannot start the database's writer thread: {source}")]
    Thread {
        /// Why not.
        source: std::io::Error,
    },
}

/// Why an engine could not do what it was asked.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum EngineError {
    /// The engine found damage or its files cannot be read or written.
    #[error("the database engine failed while {doing}: {detail}")]
    Failed {
        /// What it was doing.
        doing: &'static str,
        /// What it said.
        detail: String,
    },
    /// An earlier write failed, so what is on disk is not known; nothing more is written.
    #[error("an earlier write to the database failed, it takes no more writes until restarted")]
    Poisoned,
    /// Too many commits are waiting.
    #[error("too many writes are waiting for the database, expected at most {queue_max}")]
    Busy {
        /// How many may wait.
        queue_max: usize,
    },
    /// The engine has been shut down.
    #[error("the database has been shut down")]
    Stopped,
    /// A value is larger than [`VALUE_BYTES_MAX`].
    #[error("value has {found} bytes, expected at most {VALUE_BYTES_MAX}")]
    ValueTooLarge {
        /// Its length.
        found: usize,
    },
    /// A key is empty or longer than [`KEY_BYTES_MAX`].
    #[error("key has {found} bytes, expected 1 to {KEY_BYTES_MAX}")]
    KeyLength {
        /// Its length.
        found: usize,
    },
    /// A commit has more than [`COMMIT_WRITES_MAX`] writes.
    #[error("commit has {found} writes, expected at most {COMMIT_WRITES_MAX}")]
    CommitTooLarge {
        /// How many it has.
        found: usize,
    },
}

/// Why a commit was not applied.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum CommitError {
    /// An expectation does not hold; nothing was written.
    #[error("expectation {expectation} of the commit does not hold")]
    Conflict {
        /// Its index among the commit's expectations.
        expectation: usize,
    },
    /// The engine failed; whether anything was written is not known.
    #[error(transparent)]
    Engine(#[from] EngineError),
}
