//! The embedded engine: sled 0.34.7, used so that its known faults cannot hurt.
//!
//! One operating-system thread writes: it drains a channel of commits, checks and applies
//! each as one sled batch, then flushes, then syncs the data file, then answers them all
//! (group commit; `writer`). In sled an `insert` that returned may be lost, concurrent
//! `flush_async` deadlocks, large values go to files that are never synced, and a flipped bit
//! can panic or drop keys in silence; hence the single thread, the bound on values, the
//! caught panics, and the sums that are checked at every opening (`tally`, `mark`). A failed
//! write poisons the engine until it is opened again, so writes are refused before the disk
//! is full (`room`). A sled's file never shrinks, so its content is merged into a file
//! without it from time to time (`compaction`, `levels`, `base`).

mod base;
mod census;
mod compaction;
mod current;
mod cut;
mod levels;
mod mark;
mod merging;
mod opening;
mod reserve;
mod room;
mod tally;
mod gathered;
mod writer;

use std::collections::BTreeMap;
use std::fs::File;
use std::ops::Bound;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, PoisonError, RwLock};
use std::thread::JoinHandle;

use futures::channel::oneshot;
use uuid::Uuid;

use crate::engine::content::ContentStats;
use crate::engine::opening::OpenError;
use crate::engine::{Commit, Compacted, Cut, Engine, EngineError, EngineStats, Pair, Pending};
use crate::holding::Held;
use crate::private;
use compaction::Compaction;
pub use compaction::Halt;
use current::Current;
pub use cut::CUTS_MAX;
use cut::{Memory, SledCut};
use levels::Levels;
use mark::Mark;
use opening::{Verified, held, lock_folder, open_levels, unreadable, unusable, verify};
pub use room::FreeSpace;
use room::Room;
use tally::TALLY_KEY;
use writer::{Order, Writer};

/// Maximum number of commits that wait for the writer.
const QUEUE_MAX: usize = 4096;
/// Default number of bytes of the disk that stay free.
pub const RESERVE_BYTES: u64 = 64 << 20;
/// Default space beyond 1.5 times the live bytes. Chosen: with the copy of a compaction (once
/// the live bytes), the stored bytes stay below 4 × live + 64 MB; and a restart reads a base
/// three times as fast as the sled on top of it.
pub const SLACK_BYTES: u64 = 32 << 20;
/// sled's data file inside its folder.
const DATA_FILE: &str = "db";
/// Options of an embedded database.
#[derive(Clone, Debug)]
pub struct SledOptions {
    /// Memory for sled's page cache.
    pub cache_bytes: u64,
    /// Bytes of the disk that stay free; writes that would need them are refused.
    pub reserve_bytes: u64,
    /// Source of the number of free bytes.
    pub free_space: FreeSpace,
    /// Reaction to missing records.
    pub on_damage: OnDamage,
    /// Space beyond 1.5 times the live bytes at which a compaction starts by itself.
    pub slack_bytes: u64,
    /// For tests: step at which a compaction stops for good, as if the process had been killed.
    #[doc(hidden)]
    pub halt: Option<Halt>,
}

impl Default for SledOptions {
    fn default() -> Self {
        Self {
            cache_bytes: 256 << 20,
            reserve_bytes: RESERVE_BYTES,
            free_space: FreeSpace::of_disk(),
            on_damage: OnDamage::Refuse,
            slack_bytes: SLACK_BYTES,
            halt: None,
        }
    }
}

/// Reaction to records that differ from the last written ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnDamage {
    /// Refuse to open the database.
    Refuse,
    /// Open it for reading, and report the damage ([`SledEngine::damage`]).
    Inspect,
    /// Accept the present records as complete from now on, and report the damage.
    Accept,
}

/// An open folder on disk.
#[derive(Debug)]
pub struct SledEngine {
    folder: PathBuf,
    queue: Option<SyncSender<Order>>,
    writer: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
    memory: Arc<Memory>,
    room: Room,
    damage: Option<OpenError>,
    _lock: File,
}

/// State shared by readers and the writer.
#[derive(Debug)]
struct Shared {
    levels: RwLock<Arc<Levels>>,
    poisoned: AtomicBool,
    commits: AtomicU64,
    flushes: AtomicU64,
    compactions: AtomicU64,
    live_bytes: AtomicU64,
    held: Held,
}

impl Shared {
    /// The present levels, for one operation.
    fn levels(&self) -> Arc<Levels> {
        Arc::clone(&self.levels.read().unwrap_or_else(PoisonError::into_inner))
    }

    fn set_levels(&self, levels: Arc<Levels>) {
        *self.levels.write().unwrap_or_else(PoisonError::into_inner) = levels;
    }
}

impl SledEngine {
    /// Opens the database in `folder`, which is created if it does not exist.
    ///
    /// # Errors
    /// [`OpenError`] when another process has it open, when files cannot be used, and when sled
    /// finds them damaged.
    pub fn open(folder: &Path, options: &SledOptions) -> Result<Self, OpenError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| OpenError::Io { path, source }
        };
        private::create_folder(folder).map_err(io(folder))?;
        private::tighten(folder);
        let lock = lock_folder(folder)?;
        let current = Current::read(folder).map_err(|error| unusable(folder, folder, error))?;
        let room = Room::opening(folder, &options.free_space, options.reserve_bytes);
        let levels = Arc::new(open_levels(folder, current, options)?);
        private::tighten(folder);
        let data_path = levels.top.folder.join(DATA_FILE);
        let data = File::open(&data_path).map_err(io(&data_path))?;
        let Verified { tally, live_bytes, damage } = verify(folder, &levels)?;
        if let Some(damage) = damage.as_ref().filter(|_| options.on_damage != OnDamage::Inspect) {
            tracing::error!(%damage, "Records of the database are missing");
        }
        let damage = match (damage, options.on_damage) {
            (Some(damage), OnDamage::Refuse) => return Err(damage),
            (damage, _) => damage,
        };
        let is_read_only = damage.is_some() && options.on_damage == OnDamage::Inspect;
        let mark_path = folder.join(mark::MARK_FILE);
        let mark = match is_read_only {
            true => None,
            false => Some(Mark::open(folder, tally.commits).map_err(io(&mark_path))?),
        };
        if !is_read_only {
            room.hold();
        }
        let shared = Arc::new(Shared {
            levels: RwLock::new(Arc::clone(&levels)),
            poisoned: AtomicBool::new(is_read_only),
            commits: AtomicU64::new(0),
            flushes: AtomicU64::new(0),
            compactions: AtomicU64::new(0),
            live_bytes: AtomicU64::new(live_bytes),
            held: held(&levels).map_err(|error| unreadable(folder, &error))?,
        });
        let memory = Arc::new(Memory::default());
        let (queue, orders) = sync_channel(QUEUE_MAX);
        let mut writer = Writer {
            levels,
            data,
            mark,
            tally,
            room: room.clone(),
            is_full: false,
            shared: Arc::clone(&shared),
            memory: Arc::clone(&memory),
            live_bytes,
            compaction: Compaction::new(folder, current, options),
        };
        if damage.is_none() {
            // Remains of an interrupted compaction, which the database does not need.
            compaction::removal::remove_leftovers(folder, current);
        }
        if damage.is_some() && !is_read_only {
            writer.accept().map_err(|error| OpenError::Damaged {
                folder: folder.to_owned(),
                detail: error.to_string(),
            })?;
        }
        let thread = std::thread::Builder::new()
            .name("palpate-store".to_owned())
            .spawn(move || writer.run(&orders))
            .map_err(|source| OpenError::Thread { source })?;
        Ok(Self {
            folder: folder.to_owned(),
            queue: Some(queue),
            writer: Some(thread),
            shared,
            memory,
            room,
            damage,
            _lock: lock,
        })
    }

    /// The damage found at the opening, if it was opened nevertheless.
    #[must_use]
    pub fn damage(&self) -> Option<&OpenError> {
        self.damage.as_ref()
    }

    /// Sends an order to the writer.
    fn order(&self, order: Order) -> Result<(), EngineError> {
        let queue = self.queue.as_ref().ok_or(EngineError::Stopped)?;
        queue.try_send(order).map_err(|error| match error {
            TrySendError::Full(_) => EngineError::Busy { queue_max: QUEUE_MAX },
            TrySendError::Disconnected(_) => EngineError::Stopped,
        })
    }

    /// The open folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

impl Engine for SledEngine {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        if key == TALLY_KEY {
            return Ok(None);
        }
        guarded("reading", || self.shared.levels().get(key))
    }

    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Pair>, EngineError> {
        let start = match after {
            Some(after) if after >= prefix => Bound::Excluded(after),
            _ if prefix.is_empty() => Bound::Excluded(&TALLY_KEY[..]),
            _ => Bound::Included(prefix),
        };
        guarded("scanning", || {
            let mut found = Vec::new();
            for pair in self.shared.levels().range(start).take(limit) {
                let (key, value) = pair?;
                if !key.starts_with(prefix) {
                    break;
                }
                found.push((key, value));
            }
            Ok(found)
        })
    }

    fn commit(&self, commit: Commit) -> Pending {
        if let Err(error) = commit.check() {
            return Pending::ready(Err(error.into()));
        }
        let (answer, pending) = Pending::channel();
        match self.order(Order::Commit(commit, answer)) {
            Ok(()) => pending,
            Err(error) => Pending::ready(Err(error.into())),
        }
    }

    fn held(&self) -> BTreeMap<Uuid, u64> {
        self.shared.held.all()
    }

    fn cut(&self) -> Result<Box<dyn Cut>, EngineError> {
        let (answer, answered) = oneshot::channel();
        self.order(Order::Cut(answer))?;
        let number = futures::executor::block_on(answered).unwrap_or(Err(EngineError::Stopped))?;
        let (shared, memory) = (Arc::clone(&self.shared), Arc::clone(&self.memory));
        Ok(Box::new(SledCut { shared, memory, number }))
    }

    fn compact(&self) -> Result<Compacted, EngineError> {
        let (answer, answered) = oneshot::channel();
        self.order(Order::Compact(answer))?;
        futures::executor::block_on(answered).unwrap_or(Err(EngineError::Stopped))
    }

    fn stats(&self) -> Result<EngineStats, EngineError> {
        let bytes = guarded("measuring", || Ok(current::stored_bytes(&self.folder)?))?;
        Ok(EngineStats {
            engine: "sled",
            bytes,
            live_bytes: self.shared.live_bytes.load(Ordering::Relaxed),
            compactions: self.shared.compactions.load(Ordering::Relaxed),
            free_bytes: self.room.free(),
            reserve_bytes: self.room.reserve,
            commits: self.shared.commits.load(Ordering::Relaxed),
            flushes: self.shared.flushes.load(Ordering::Relaxed),
            received_bytes: 0,
            content: ContentStats::default(),
        })
    }
}

impl Drop for SledEngine {
    /// Lets the writer finish its orders before the lock is released.
    fn drop(&mut self) {
        self.queue = None;
        if let Some(writer) = self.writer.take()
            && writer.join().is_err()
        {
            tracing::error!("The database's writer thread panicked");
        }
    }
}

/// Runs one call of sled and converts its error or panic into an [`EngineError`].
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
