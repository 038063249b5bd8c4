//! The embedded engine: sled 0.34.7, used so that its known faults cannot hurt.
//!
//! One operating-system thread owns writing: it drains a channel of commits, checks and
//! applies each as one sled batch, then flushes, then syncs the data file, then answers them
//! all (group commit). In sled an `insert` that returned may be lost, concurrent
//! `flush_async` deadlocks, large values go to files that are never synced, and a flipped bit
//! can panic; hence the single thread, [`VALUE_BYTES_MAX`](crate::engine::VALUE_BYTES_MAX)
//! and the caught panics. A failed write poisons the engine until it is opened again.

use std::fs::{self, File, OpenOptions};
use std::ops::Bound;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use fs4::FileExt;
use futures::channel::oneshot;

use crate::engine::{
    Commit, CommitError, Engine, EngineError, EngineStats, Expected, OpenError, Pair, Pending,
};

/// How many commits may wait for the writer.
const QUEUE_MAX: usize = 4096;
/// How many commits share one flush at most.
const GROUP_MAX: usize = 1024;
/// The file whose lock says that the folder is in use.
const LOCK_FILE: &str = "lock";
/// sled's folder inside the database's.
const SLED_FOLDER: &str = "sled";
/// sled's data file inside its folder.
const DATA_FILE: &str = "db";
/// How often sled's own lock is tried: a sled that was just closed in this process lets go of
/// it a moment later.
const OPEN_ATTEMPTS: u32 = 50;
const OPEN_ATTEMPT_PAUSE: Duration = Duration::from_millis(20);

type Answer = oneshot::Sender<Result<(), CommitError>>;

/// How an embedded database is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SledOptions {
    /// Memory for sled's page cache.
    pub cache_bytes: u64,
}

impl Default for SledOptions {
    fn default() -> Self {
        Self { cache_bytes: 256 << 20 }
    }
}

/// A folder on disk that is open.
#[derive(Debug)]
pub struct SledEngine {
    db: ::sled::Db,
    folder: PathBuf,
    queue: Option<SyncSender<(Commit, Answer)>>,
    writer: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
    _lock: File,
}

#[derive(Debug, Default)]
struct Shared {
    poisoned: AtomicBool,
    commits: AtomicU64,
    flushes: AtomicU64,
}

impl SledEngine {
    /// Opens the database in `folder`, which is made if it does not exist.
    ///
    /// # Errors
    /// [`OpenError`] when another process has it open, when files cannot be used, and when
    /// sled finds them damaged.
    pub fn open(folder: &Path, options: &SledOptions) -> Result<Self, OpenError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| OpenError::Io { path, source }
        };
        fs::create_dir_all(folder).map_err(io(folder))?;
        let lock = lock_folder(folder)?;
        let sled_folder = folder.join(SLED_FOLDER);
        let db = open_sled(folder, &sled_folder, options)?;
        let data_path = sled_folder.join(DATA_FILE);
        let data = File::open(&data_path).map_err(io(&data_path))?;
        for made in [sled_folder.as_path(), folder] {
            File::open(made).and_then(|made_folder| made_folder.sync_all()).map_err(io(made))?;
        }
        let shared = Arc::new(Shared::default());
        let (queue, commits) = sync_channel(QUEUE_MAX);
        let mut writer = Writer { db: db.clone(), data, shared: Arc::clone(&shared) };
        let thread = std::thread::Builder::new()
            .name("palpate-store".to_owned())
            .spawn(move || writer.run(&commits))
            .map_err(|source| OpenError::Thread { source })?;
        Ok(Self {
            db,
            folder: folder.to_owned(),
            queue: Some(queue),
            writer: Some(thread),
            shared,
            _lock: lock,
        })
    }

    /// The folder this engine has open.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

impl Engine for SledEngine {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        guarded("reading", || self.db.get(key)).map(|value| value.map(|value| value.to_vec()))
    }

    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Pair>, EngineError> {
        let start = match after {
            Some(after) if after >= prefix => Bound::Excluded(after),
            _ => Bound::Included(prefix),
        };
        guarded("scanning", || {
            let mut found = Vec::new();
            for pair in self.db.range::<&[u8], _>((start, Bound::Unbounded)).take(limit) {
                let (key, value) = pair?;
                if !key.starts_with(prefix) {
                    break;
                }
                found.push((key.to_vec(), value.to_vec()));
            }
            Ok(found)
        })
    }

    fn commit(&self, commit: Commit) -> Pending {
        if let Err(error) = commit.check() {
            return Pending::ready(Err(error.into()));
        }
        let Some(queue) = &self.queue else {
            return Pending::ready(Err(EngineError::Stopped.into()));
        };
        let (answer, pending) = Pending::channel();
        match queue.try_send((commit, answer)) {
            Ok(()) => pending,
            Err(TrySendError::Full(_)) => {
                Pending::ready(Err(EngineError::Busy { queue_max: QUEUE_MAX }.into()))
            }
            Err(TrySendError::Disconnected(_)) => Pending::ready(Err(EngineError::Stopped.into())),
        }
    }

    fn stats(&self) -> Result<EngineStats, EngineError> {
        let bytes = guarded("measuring", || self.db.size_on_disk())?;
        Ok(EngineStats {
            engine: "sled",
            bytes,
            commits: self.shared.commits.load(Ordering::Relaxed),
            flushes: self.shared.flushes.load(Ordering::Relaxed),
        })
    }
}

impl Drop for SledEngine {
    /// Lets the writer finish what was asked of it before the lock goes.
    fn drop(&mut self) {
        self.queue = None;
        if let Some(writer) = self.writer.take()
            && writer.join().is_err()
        {
            tracing::error!("The database's writer thread panicked");
        }
    }
}

/// The one thread that writes.
struct Writer {
    db: ::sled::Db,
    data: File,
    shared: Arc<Shared>,
}

impl Writer {
    fn run(&mut self, commits: &Receiver<(Commit, Answer)>) {
        while let Ok(first) = commits.recv() {
            let rest = std::iter::from_fn(|| commits.try_recv().ok());
            let group: Vec<_> = std::iter::once(first).chain(rest.take(GROUP_MAX - 1)).collect();
            self.write_group(group);
        }
    }

    fn write_group(&mut self, group: Vec<(Commit, Answer)>) {
        let applied: Vec<_> =
            group.into_iter().map(|(commit, answer)| (self.apply(commit), answer)).collect();
        let written = applied.iter().filter(|(result, _)| result.is_ok()).count();
        let flushed = if written > 0 { self.flush() } else { Ok(()) };
        self.shared.commits.fetch_add(written as u64, Ordering::Relaxed);
        for (result, answer) in applied {
            let result = result.and_then(|()| flushed.clone().map_err(CommitError::from));
            // Nobody waits for a dropped `Pending`; the commit stands.
            let _ = answer.send(result);
        }
    }

    fn apply(&mut self, commit: Commit) -> Result<(), CommitError> {
        if self.shared.poisoned.load(Ordering::Relaxed) {
            return Err(EngineError::Poisoned.into());
        }
        for (expectation, (key, expected)) in commit.expectations.iter().enumerate() {
            let found = guarded("checking a commit", || self.db.get(key))?;
            let holds = match expected {
                Expected::Absent => found.is_none(),
                Expected::Value(value) => found.as_deref() == Some(value.as_slice()),
            };
            if !holds {
                return Err(CommitError::Conflict { expectation });
            }
        }
        let mut batch = ::sled::Batch::default();
        for (key, value) in commit.writes {
            match value {
                Some(value) => batch.insert(key, value),
                None => batch.remove(key),
            }
        }
        let applied = guarded("writing", || self.db.apply_batch(batch));
        Ok(self.poison_if_failed(applied)?)
    }

    /// Returns when everything applied so far is on the disk.
    fn flush(&mut self) -> Result<(), EngineError> {
        self.shared.flushes.fetch_add(1, Ordering::Relaxed);
        let flushed = guarded("flushing", || self.db.flush()).and_then(|_| {
            self.data.sync_data().map_err(|error| EngineError::Failed {
                doing: "syncing",
                detail: error.to_string(),
            })
        });
        self.poison_if_failed(flushed)
    }

    fn poison_if_failed(&self, result: Result<(), EngineError>) -> Result<(), EngineError> {
        if let Err(error) = &result {
            self.shared.poisoned.store(true, Ordering::Relaxed);
            tracing::error!(%error, "The database takes no more writes until it is opened again");
        }
        result
    }
}

/// Runs one call of sled and turns its error or panic into an [`EngineError`].
fn guarded<T>(
    doing: &'static str,
    call: impl FnOnce() -> ::sled::Result<T>,
) -> Result<T, EngineError> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(EngineError::Failed { doing, detail: error.to_string() }),
        Err(panic) => Err(EngineError::Failed { doing, detail: panic_text(panic.as_ref()) }),
    }
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()))
        .unwrap_or_else(|| "it panicked".to_owned())
}

fn lock_folder(folder: &Path) -> Result<File, OpenError> {
    let path = folder.join(LOCK_FILE);
    let opened = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
    let lock = opened.map_err(|source| OpenError::Io { path: path.clone(), source })?;
    match FileExt::try_lock(&lock) {
        Ok(()) => Ok(lock),
        Err(fs4::TryLockError::WouldBlock) => {
            Err(OpenError::InUse { folder: folder.to_owned(), lock: path })
        }
        Err(fs4::TryLockError::Error(source)) => Err(OpenError::Io { path, source }),
    }
}

fn open_sled(
    folder: &Path,
    sled_folder: &Path,
    options: &SledOptions,
) -> Result<::sled::Db, OpenError> {
    // No flushes behind the writer's back: concurrent flushes are sled's deadlock.
    let config = ::sled::Config::new()
        .path(sled_folder)
        .cache_capacity(options.cache_bytes)
        .flush_every_ms(None);
    let mut attempt = 1;
    loop {
        match guarded("opening", || config.open()) {
            Ok(db) => return Ok(db),
            Err(EngineError::Failed { detail, .. }) => {
                let still_locked = detail.contains("could not acquire lock");
                if !still_locked || attempt == OPEN_ATTEMPTS {
                    return Err(OpenError::Damaged { folder: folder.to_owned(), detail });
                }
            }
            Err(error) => {
                let detail = error.to_string();
                return Err(OpenError::Damaged { folder: folder.to_owned(), detail });
            }
        }
        std::thread::sleep(OPEN_ATTEMPT_PAUSE);
        attempt += 1;
    }
}
