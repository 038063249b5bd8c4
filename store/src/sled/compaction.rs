//! Compaction: frees the space of removed and replaced records while requests go on.
//!
//! In four steps, driven by the writer between two groups of commits: a thread creates a new
//! sled; the writer puts it on top, so that the levels below no longer change; a thread
//! merges these into a base (`merging`); the writer replaces them by it; a thread removes the
//! old files. The writer itself only writes a tally and a few hundred bytes of `current`, and
//! waits for their syncs. After a kill at any moment `current` defines the database: before
//! the second step as it was, after it with a frozen sled whose merge restarts at the next
//! opening, after the third with old files that are removed then (`removal`).

pub(super) mod removal;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use futures::channel::oneshot;

use super::base::Base;
use super::current::{Current, base_file, sled_folder, stored_bytes};
use super::levels::{Layer, Levels};
use super::merging::{bytes_needed, log_compacted, merge};
use super::opening::open_layer;
use super::tally::{TALLY_KEY, Tally};
use super::writer::Writer;
use super::{DATA_FILE, SledOptions, guarded};
use crate::engine::opening::OpenError;
use crate::engine::{Compacted, EngineError};
use removal::{discard, remove};

/// Interval at which the writer checks the stored bytes. Chosen: a burst of a second is far
/// below the slack.
const MEASURE_INTERVAL: Duration = Duration::from_secs(1);
/// Pause after a failure before the next automatic start. Chosen: a full disk is not tried
/// all the time.
const BACKOFF: Duration = Duration::from_secs(60);
type Answer = oneshot::Sender<Result<Compacted, EngineError>>;

/// For tests: step at which a compaction stops for good, as if the process had been killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Halt {
    /// The new sled exists, and is not on top yet.
    Prepared,
    /// The new sled is on top.
    Frozen,
    /// This many pairs are merged.
    Merging(u64),
    /// The base is complete, and not in place yet.
    Merged,
    /// The base is in place, and the old files still exist.
    Switched,
}

/// State of the compaction, and the time of the next one.
#[derive(Debug)]
pub(super) struct Compaction {
    folder: PathBuf,
    options: SledOptions,
    current: Current,
    stage: Stage,
    /// Callers that wait for it.
    waiting: Vec<Answer>,
    stop: Arc<AtomicBool>,
    measured: Option<Instant>,
    failed: Option<Instant>,
    /// Number of commits at the end of the last one.
    commits: Option<u64>,
    before_bytes: u64,
}

#[derive(Debug)]
enum Stage {
    None,
    Preparing(u64, JoinHandle<Result<Layer, OpenError>>),
    Merging(u64, JoinHandle<Result<Option<Base>, EngineError>>),
    Removing(JoinHandle<()>),
    Halted,
}

impl Compaction {
    pub(super) fn new(folder: &Path, current: Current, options: &SledOptions) -> Self {
        Self {
            folder: folder.to_owned(),
            options: options.clone(),
            current,
            stage: Stage::None,
            waiting: Vec::new(),
            stop: Arc::default(),
            measured: None,
            failed: None,
            commits: None,
            before_bytes: 0,
        }
    }

    /// Whether no compaction is in progress.
    pub(super) fn is_idle(&self) -> bool {
        matches!(self.stage, Stage::None | Stage::Halted)
    }

    /// Starts a compaction, or joins the one in progress.
    pub(super) fn request(&mut self, answer: Answer) {
        self.waiting.push(answer);
    }

    /// Ends the compaction in progress; the next opening resumes it.
    pub(super) fn stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let is_sound = match std::mem::replace(&mut self.stage, Stage::None) {
            Stage::None | Stage::Halted => true,
            Stage::Preparing(_, thread) => thread.join().is_ok(),
            Stage::Merging(_, thread) => thread.join().is_ok(),
            Stage::Removing(thread) => thread.join().is_ok(),
        };
        if !is_sound {
            tracing::error!("A thread of a compaction panicked");
        }
    }

    fn answer(&mut self, result: &Result<Compacted, EngineError>) {
        for answer in self.waiting.drain(..) {
            // The caller may have gone away.
            let _ = answer.send(result.clone());
        }
    }

    fn fail(&mut self, error: EngineError) {
        tracing::error!(%error, "The database was not compacted: {error}");
        self.failed = Some(Instant::now());
        self.answer(&Err(error));
    }

    /// Stops for good at the step of a test.
    fn halts(&mut self, at: Halt) -> bool {
        let halts = self.options.halt == Some(at);
        if halts {
            self.stage = Stage::Halted;
            self.answer(&Err(EngineError::Stopped));
        }
        halts
    }
}

impl Writer {
    /// Advances a compaction as far as possible without waiting. Called between two groups.
    pub(super) fn advance_compaction(&mut self) {
        match std::mem::replace(&mut self.compaction.stage, Stage::None) {
            Stage::None => self.begin_if_due(),
            Stage::Preparing(number, thread) if thread.is_finished() => match joined(thread) {
                Ok(layer) => self.freeze(number, layer),
                Err(error) => self.compaction.fail(error),
            },
            Stage::Merging(number, thread) if thread.is_finished() => match joined(thread) {
                Ok(Some(base)) => self.put_in_place(number, base),
                Ok(None) => {
                    self.compaction.stage = Stage::Halted;
                    self.compaction.answer(&Err(EngineError::Stopped));
                }
                Err(error) => {
                    discard(&base_file(&self.compaction.folder, number));
                    self.compaction.fail(error);
                }
            },
            Stage::Removing(thread) if thread.is_finished() => self.end(),
            Stage::Halted => {
                self.compaction.stage = Stage::Halted;
                self.compaction.answer(&Err(EngineError::Stopped));
            }
            stage => self.compaction.stage = stage,
        }
    }

    /// Starts a compaction if it is requested, was interrupted, or too much space is used;
    /// not if its copy would not fit.
    fn begin_if_due(&mut self) {
        let is_requested = !self.compaction.waiting.is_empty();
        let is_soon = |then: &Option<Instant>, after| then.is_some_and(|t| t.elapsed() < after);
        if self.shared.poisoned.load(Ordering::Relaxed) {
            return self.compaction.answer(&Err(EngineError::Poisoned));
        }
        let waits = is_soon(&self.compaction.measured, MEASURE_INTERVAL);
        if !is_requested && (waits || is_soon(&self.compaction.failed, BACKOFF)) {
            return;
        }
        self.compaction.measured = Some(Instant::now());
        let stored = match guarded("measuring", || Ok(stored_bytes(&self.compaction.folder)?)) {
            Ok(stored) => stored,
            Err(error) => return self.compaction.fail(error),
        };
        let is_unfinished = self.levels.frozen.is_some();
        let bound = (self.live_bytes + self.live_bytes / 2)
            .saturating_add(self.compaction.options.slack_bytes);
        let is_changed = self.compaction.commits != Some(self.tally.commits);
        if !(is_requested || is_unfinished || (stored > bound && is_changed)) {
            return;
        }
        let needed = bytes_needed(self.live_bytes);
        let (free, reserve) = (self.room.free().unwrap_or(u64::MAX), self.room.reserve);
        if free.saturating_sub(needed) < reserve {
            return self.compaction.fail(EngineError::NoRoomToCompact { needed, free, reserve });
        }
        self.compaction.before_bytes = stored;
        match is_unfinished {
            true => self.merge_frozen(),
            false => self.prepare(),
        }
    }

    fn prepare(&mut self) {
        let number = self.compaction.current.next();
        let folder = self.compaction.folder.clone();
        let options = self.compaction.options.clone();
        let make = move || {
            discard(&sled_folder(&folder, number));
            open_layer(&folder, number, &options)
        };
        match spawned(make) {
            Ok(thread) => self.compaction.stage = Stage::Preparing(number, thread),
            Err(error) => self.compaction.fail(error),
        }
    }

    /// Puts the new sled on top.
    fn freeze(&mut self, number: u64, top: Layer) {
        if self.compaction.halts(Halt::Prepared) {
            return;
        }
        if let Err(error) = self.put_on_top(number, top) {
            return self.compaction.fail(error);
        }
        if !self.compaction.halts(Halt::Frozen) {
            self.merge_frozen();
        }
    }

    fn put_on_top(&mut self, number: u64, top: Layer) -> Result<(), EngineError> {
        // The frozen sled stores the sum that the copy must have; one without commits has no
        // tally.
        if guarded("reading", || self.levels.top.get(&TALLY_KEY))?.is_none() {
            self.write_tally()?;
            self.flush()?;
        }
        let failed = |error: std::io::Error| EngineError::Failed {
            doing: "compacting",
            detail: error.to_string(),
        };
        let data = File::open(top.folder.join(DATA_FILE)).map_err(failed)?;
        let record = top.form.encode(self.tally.to_record());
        guarded("compacting", || {
            top.db.insert(TALLY_KEY, record)?;
            top.db.flush()?;
            Ok(data.sync_data()?)
        })?;
        let old = self.compaction.current;
        let current = Current { top: number, frozen: Some(old.top), base: old.base };
        // A `current` that was not made durable may exist after a restart nevertheless.
        let written = current.write(&self.compaction.folder).map_err(failed);
        self.poison_if_failed(written)?;
        let levels =
            Levels { top, frozen: Some(self.levels.top.clone()), base: self.levels.base.clone() };
        self.compaction.current = current;
        self.data = data;
        self.set_levels(levels);
        Ok(())
    }

    fn set_levels(&mut self, levels: Levels) {
        self.levels = Arc::new(levels);
        self.shared.set_levels(Arc::clone(&self.levels));
    }

    /// Starts to merge the levels below the top.
    fn merge_frozen(&mut self) {
        let Some(frozen) = self.levels.frozen.clone() else { return };
        let number = self.compaction.current.next();
        let path = base_file(&self.compaction.folder, number);
        let stop = Arc::clone(&self.compaction.stop);
        let stop_after = match self.compaction.options.halt {
            Some(Halt::Merging(n_pairs)) => Some(n_pairs),
            _ => None,
        };
        let below = Levels { top: frozen, frozen: None, base: self.levels.base.clone() };
        let make = move || {
            let record = guarded("compacting", || below.top.get(&TALLY_KEY))?.flatten();
            let tally = record.as_deref().and_then(Tally::from_record);
            let tally = tally.ok_or(EngineError::Failed {
                doing: "compacting",
                detail: "the frozen records have no tally".to_owned(),
            })?;
            merge(&below, &path, tally.sum, &stop, stop_after)
        };
        match spawned(make) {
            Ok(thread) => self.compaction.stage = Stage::Merging(number, thread),
            Err(error) => self.compaction.fail(error),
        }
    }

    /// Replaces all levels below the top by the new base.
    fn put_in_place(&mut self, number: u64, base: Base) {
        if self.compaction.halts(Halt::Merged) {
            return;
        }
        let old = self.compaction.current;
        let current = Current { top: old.top, frozen: None, base: Some(number) };
        let written = current.write(&self.compaction.folder).map_err(|error| EngineError::Failed {
            doing: "compacting",
            detail: error.to_string(),
        });
        if let Err(error) = self.poison_if_failed(written) {
            return self.compaction.fail(error);
        }
        self.compaction.current = current;
        let top = self.levels.top.clone();
        let before = Arc::clone(&self.levels);
        self.set_levels(Levels { top, frozen: None, base: Some(Arc::new(base)) });
        if self.compaction.halts(Halt::Switched) {
            return;
        }
        let folder = self.compaction.folder.clone();
        match spawned(move || remove(&folder, current, before)) {
            Ok(thread) => self.compaction.stage = Stage::Removing(thread),
            Err(error) => self.compaction.fail(error),
        }
    }

    fn end(&mut self) {
        let after = guarded("measuring", || Ok(stored_bytes(&self.compaction.folder)?));
        self.shared.compactions.fetch_add(1, Ordering::Relaxed);
        self.compaction.commits = Some(self.tally.commits);
        self.compaction.failed = None;
        let compacted = after.map(|after_bytes| Compacted {
            before_bytes: self.compaction.before_bytes,
            after_bytes,
            live_bytes: self.live_bytes,
        });
        if let Ok(compacted) = &compacted {
            log_compacted(compacted);
        }
        self.compaction.answer(&compacted);
    }
}

fn spawned<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, EngineError> {
    let builder = std::thread::Builder::new().name("palpate-compact".to_owned());
    let failed = |error: std::io::Error| EngineError::Failed {
        doing: "starting a thread to compact",
        detail: error.to_string(),
    };
    builder.spawn(work).map_err(failed)
}

fn joined<T, E: ToString>(thread: JoinHandle<Result<T, E>>) -> Result<T, EngineError> {
    let failed = |detail: String| EngineError::Failed { doing: "compacting", detail };
    match thread.join() {
        Ok(result) => result.map_err(|error| failed(error.to_string())),
        Err(panic) => Err(failed(super::panic_text(panic.as_ref()))),
    }
}
