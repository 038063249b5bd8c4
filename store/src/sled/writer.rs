//! The single writing thread.
//!
//! It drains the queue of commits, checks each against those before it, applies them with the tally
//! as one batch, makes them durable together, moves the mark, then answers them.

use std::collections::BTreeMap;
use std::fs::File;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use futures::channel::oneshot;

use super::compaction::Compaction;
use super::cut::Memory;
use super::gathered::Gathered;
use super::levels::Levels;
use super::mark::Mark;
use super::room::{Allowance, Room};
use super::tally::{TALLY_KEY, Tally};
use super::{Shared, guarded};
use crate::engine::{COMMIT_WRITES_MAX, Commit, CommitError, Compacted, EngineError, Expected};
use crate::holding::Bill;

/// Maximum number of orders that share one flush.
const GROUP_MAX: usize = 1024;
/// Time without an order after which the mark is synced.
const IDLE: Duration = Duration::from_secs(1);

/// Time for which a writer under load collects orders before it writes. Chosen: a
/// group takes about 0.4 ms of processor time however many orders it has; a robot under load waits
/// ten times as long for its belief.
const GATHERING: Duration = Duration::from_millis(2);

/// Interval at which the writer advances a compaction in progress.
const ADVANCE_INTERVAL: Duration = Duration::from_millis(20);

/// An order to the writer.
pub(super) enum Order {
    /// Apply a commit.
    Commit(Commit, oneshot::Sender<Result<(), CommitError>>),
    /// Start to remember old values for the reader of a cut.
    Cut(oneshot::Sender<Result<u64, EngineError>>),
    /// Compact.
    Compact(oneshot::Sender<Result<Compacted, EngineError>>),
}

/// A key with its old and its new value.
struct Change {
    key: Vec<u8>,
    before: Option<Vec<u8>>,
    value: Option<Vec<u8>>,
}

/// The one thread that writes.
pub(super) struct Writer {
    pub(super) levels: Arc<Levels>,
    pub(super) data: File,
    /// `None` if the database is read only.
    pub(super) mark: Option<Mark>,
    pub(super) tally: Tally,
    pub(super) room: Room,
    pub(super) is_full: bool,
    pub(super) shared: Arc<Shared>,
    pub(super) memory: Arc<Memory>,
    /// Bytes of all keys and values, without the tally's.
    pub(super) live_bytes: u64,
    pub(super) compaction: Compaction,
}

impl Writer {
    pub(super) fn run(&mut self, orders: &Receiver<Order>) {
        // More than one order came during the last flush.
        let mut is_busy = false;
        loop {
            self.advance_compaction();
            let is_idle = self.compaction.is_idle();
            let first = match orders.recv_timeout(if is_idle { IDLE } else { ADVANCE_INTERVAL }) {
                Ok(first) => first,
                Err(RecvTimeoutError::Timeout) => {
                    if is_idle {
                        self.sync_mark();
                    }
                    continue;
                }
                Err(RecvTimeoutError::Disconnected) => break,
            };
            if is_busy {
                // Asleep, so that senders need not wake this thread one by one.
                std::thread::sleep(GATHERING);
            }
            let rest = std::iter::from_fn(|| orders.try_recv().ok());
            let group: Vec<_> = std::iter::once(first).chain(rest.take(GROUP_MAX - 1)).collect();
            is_busy = group.len() > 1;
            self.do_group(group);
        }
        self.sync_mark();
        self.compaction.stop();
    }

    fn do_group(&mut self, group: Vec<Order>) {
        let mut allowance = self.room.allowance();
        let (mut checked, mut cuts) = (Vec::with_capacity(group.len()), Vec::new());
        let (mut gathered, mut written) = (self.gathered(), Ok(()));
        for order in group {
            match order {
                Order::Commit(commit, answer) => {
                    if gathered.writes.len() + commit.writes.len() > COMMIT_WRITES_MAX {
                        self.room.make_way_for(&allowance);
                        written = written.and(self.write(gathered));
                        gathered = self.gathered();
                    }
                    checked.push((self.check(commit, &mut allowance, &mut gathered), answer));
                }
                Order::Cut(answer) => cuts.push(answer),
                Order::Compact(answer) => self.compaction.request(answer),
            }
        }
        let applied = checked.iter().filter(|(result, _)| result.is_ok()).count();
        self.room.make_way_for(&allowance);
        let written = written.and(if applied > 0 { self.write(gathered) } else { Ok(()) });
        let flushed = written.and_then(|()| if applied > 0 { self.flush() } else { Ok(()) });
        self.shared.commits.fetch_add(applied as u64, Ordering::Relaxed);
        for (result, answer) in checked {
            let result = result.and_then(|()| flushed.clone().map_err(CommitError::from));
            // The receiver of a dropped `Pending` is gone; the commit stands.
            let _ = answer.send(result);
        }
        for answer in cuts {
            let begun = self.memory.begin();
            // Nothing is remembered for a reader that has gone away.
            if let (Err(_), Ok(number)) = (answer.send(begun.clone()), begun) {
                self.memory.end(number);
            }
        }
    }

    /// The start of a group: nothing is gathered yet.
    fn gathered(&self) -> Gathered {
        Gathered { writes: BTreeMap::new(), tally: self.tally, live_bytes: self.live_bytes }
    }

    /// Adds a commit to those that are written together, if its expectations hold after them.
    fn check(
        &mut self,
        commit: Commit,
        allowance: &mut Allowance,
        gathered: &mut Gathered,
    ) -> Result<(), CommitError> {
        if self.shared.poisoned.load(Ordering::Relaxed) {
            return Err(EngineError::Poisoned.into());
        }
        for (expectation, (key, expected)) in commit.expectations.iter().enumerate() {
            let found = gathered.get(&self.levels, key)?;
            let holds = match expected {
                Expected::Absent => found.is_none(),
                Expected::Value(value) => found.as_deref() == Some(value.as_slice()),
            };
            if !holds {
                return Err(CommitError::Conflict { expectation });
            }
        }
        let room = allowance.take(&commit);
        self.log_room(&room);
        room?;
        let changes = self.changes(commit, gathered)?;
        for Change { key, before, value } in &changes {
            self.shared.held.note(key, before.as_deref(), value.as_deref())?;
        }
        for Change { key, before, value } in changes {
            self.memory.note(&key, before.as_deref());
            gathered.change(key, before.as_deref(), value);
        }
        gathered.tally.commits += 1;
        Ok(())
    }

    /// The changes of a commit: the last write of each key, and the holdings of its account.
    fn changes(&self, commit: Commit, gathered: &Gathered) -> Result<Vec<Change>, EngineError> {
        let mut bill = Bill::of(&commit);
        let get = |key: &[u8]| gathered.get(&self.levels, key);
        let writes: BTreeMap<Vec<u8>, Option<Vec<u8>>> = commit.writes.into_iter().collect();
        let mut changes = Vec::with_capacity(writes.len() + 1);
        for (key, value) in writes {
            let before = get(&key)?;
            if let Some(bill) = &mut bill {
                bill.add(&key, before.as_ref().map(Vec::len), value.as_ref().map(Vec::len));
            }
            changes.push(Change { key, before, value });
        }
        let Some(bill) = bill else { return Ok(changes) };
        for (key, record) in bill.settle(&self.shared.held, get)? {
            changes.push(Change { before: get(&key)?, value: Some(record), key });
        }
        Ok(changes)
    }

    /// Writes the gathered commits as one batch, which costs sled as much as one commit.
    fn write(&mut self, gathered: Gathered) -> Result<(), EngineError> {
        let Gathered { writes, tally, live_bytes } = gathered;
        let mut batch = ::sled::Batch::default();
        for (key, value) in writes {
            guarded("reading before a write", || self.levels.write(&mut batch, key, value))?;
        }
        batch.insert(&TALLY_KEY, self.levels.top.form.encode(tally.to_record()));
        let applied = guarded("writing", || self.levels.top.db.apply_batch(batch));
        self.poison_if_failed(applied)?;
        self.tally = tally;
        self.live_bytes = live_bytes;
        self.shared.live_bytes.store(live_bytes, Ordering::Relaxed);
        Ok(())
    }

    /// Makes everything applied so far durable, and moves the mark.
    pub(super) fn flush(&mut self) -> Result<(), EngineError> {
        self.shared.flushes.fetch_add(1, Ordering::Relaxed);
        let failed = |doing| {
            move |error: std::io::Error| EngineError::Failed { doing, detail: error.to_string() }
        };
        let flushed = guarded("flushing", || self.levels.top.db.flush())
            .and_then(|_| self.data.sync_data().map_err(failed("syncing")))
            .and_then(|()| match &mut self.mark {
                Some(mark) => mark.set(self.tally.commits).map_err(failed("marking a commit")),
                None => Ok(()),
            });
        self.poison_if_failed(flushed)
    }

    /// Accepts the present pairs as complete and writes their tally.
    pub(super) fn accept(&mut self) -> Result<(), EngineError> {
        self.tally.commits += 1;
        self.write_tally()?;
        self.flush()
    }

    /// Writes the tally into the top, by itself.
    pub(super) fn write_tally(&self) -> Result<(), EngineError> {
        let top = &self.levels.top;
        let record = top.form.encode(self.tally.to_record());
        guarded("writing", || top.db.insert(TALLY_KEY, record)).map(drop)
    }

    fn sync_mark(&mut self) {
        if let Some(mark) = &mut self.mark
            && let Err(error) = mark.sync()
        {
            tracing::warn!(%error, "Cannot sync the mark of the last commit");
        }
    }

    /// Logs once that the disk is full, and once that it no longer is.
    fn log_room(&mut self, room: &Result<(), EngineError>) {
        match room {
            Err(error) if !self.is_full => {
                tracing::error!(%error, "Writes are refused until there is room: {error}");
            }
            Ok(()) if self.is_full => tracing::info!("There is room on the disk: writes go on"),
            _ => {}
        }
        self.is_full = room.is_err();
    }

    pub(super) fn poison_if_failed(
        &self,
        result: Result<(), EngineError>,
    ) -> Result<(), EngineError> {
        if let Err(error) = &result {
            self.shared.poisoned.store(true, Ordering::Relaxed);
            tracing::error!(%error, "The database takes no more writes until it is opened again");
        }
        result
    }
}
