//! State shared by readers, the follower of the stream and the publishers of commits.

use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};
use std::time::{Duration, Instant};

use tokio::sync::{Notify, watch};
use uuid::Uuid;

use super::content::Object;
use super::index::Index;
use super::message::{Message, ObjectId};
use super::unit;
use crate::engine::EngineError;
use crate::engine::news::Teller;

/// A message with its sequence and its length in bytes.
#[derive(Debug)]
pub(super) struct Delivered {
    pub(super) message: Message,
    pub(super) sequence: u64,
    pub(super) bytes: u64,
}

/// State of an open store.
#[derive(Debug)]
pub(super) struct Shared {
    index: RwLock<Index>,
    /// Sequence of the last applied message.
    position: watch::Sender<u64>,
    /// Commits that are being published, and whether the stream has delivered them.
    under_way: Mutex<HashMap<Uuid, bool>>,
    /// Those who hear what other processes change.
    tellers: Mutex<Vec<Teller>>,
    fault: Mutex<Option<EngineError>>,
    /// Objects that lost their last value by commits of this process, and when, oldest first.
    released: Mutex<VecDeque<(Instant, Arc<Object>)>>,
    /// Told when somebody waits for messages and none come.
    pub(super) is_stalled: Notify,
    pub(super) commits: AtomicU64,
    pub(super) batches: AtomicU64,
    pub(super) compactions: AtomicU64,
}

impl Shared {
    pub(super) fn new(index: Index) -> Self {
        Self {
            index: RwLock::new(index),
            position: watch::Sender::new(0),
            under_way: Mutex::default(),
            tellers: Mutex::default(),
            fault: Mutex::default(),
            released: Mutex::default(),
            is_stalled: Notify::new(),
            commits: AtomicU64::new(0),
            batches: AtomicU64::new(0),
            compactions: AtomicU64::new(0),
        }
    }

    pub(super) fn index(&self) -> RwLockReadGuard<'_, Index> {
        self.index.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn under_way(&self) -> MutexGuard<'_, HashMap<Uuid, bool>> {
        self.under_way.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Applies messages together: a reader sees all or none.
    pub(super) fn apply(&self, messages: &[Delivered]) -> Result<(), EngineError> {
        let Some(last) = messages.last() else { return Ok(()) };
        let mut foreign = Vec::new();
        {
            let mut index = self.index.write().unwrap_or_else(PoisonError::into_inner);
            let mut released = Vec::new();
            for Delivered { message, sequence, bytes } in messages {
                if !message.unit.starts_with(unit::LEASE) {
                    let objects = index.apply(message, *sequence, *bytes)?;
                    released.extend(objects.into_iter().map(|object| (message.commit, object)));
                }
            }
            // Who sees what a commit wrote also sees that it was delivered.
            let mut under_way = self.under_way();
            for Delivered { message, .. } in messages {
                match under_way.get_mut(&message.commit) {
                    Some(is_delivered) => *is_delivered = true,
                    None => foreign.push(&message.unit),
                }
            }
            released.retain(|(commit, _)| under_way.contains_key(commit));
            let now = Instant::now();
            self.released().extend(released.into_iter().map(|(_, object)| (now, object)));
        }
        self.position.send_replace(last.sequence);
        if !foreign.is_empty() {
            let is_heard = |teller: &Teller| foreign.iter().all(|unit| teller.tell(unit));
            self.tellers().retain(is_heard);
        }
        Ok(())
    }

    fn released(&self) -> MutexGuard<'_, VecDeque<(Instant, Arc<Object>)>> {
        self.released.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The objects that were released and are still to be removed.
    pub(super) fn to_remove(&self) -> HashSet<ObjectId> {
        self.released().iter().map(|(_, object)| object.described.id).collect()
    }

    /// Takes the objects that were released this long ago and that no reader of this process has.
    pub(super) fn take_released(&self, ago: Duration) -> Vec<Arc<Object>> {
        let mut released = self.released();
        let is_due = |(at, object): &(Instant, Arc<Object>)| {
            at.elapsed() >= ago && Arc::strong_count(object) == 1
        };
        let (due, rest): (VecDeque<_>, VecDeque<_>) = released.drain(..).partition(is_due);
        *released = rest;
        due.into_iter().map(|(_, object)| object).collect()
    }

    /// Adds one who hears from now on what other processes change.
    pub(super) fn hear(&self, teller: Teller) {
        self.tellers().push(teller);
    }

    fn tellers(&self) -> MutexGuard<'_, Vec<Teller>> {
        self.tellers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Forgets units that were emptied long ago.
    pub(super) fn forget_expired(&self) {
        self.index.write().unwrap_or_else(PoisonError::into_inner).forget_expired();
    }

    /// Removes an empty unit from the index, after its last message has left the stream.
    pub(super) fn forget(&self, unit: &[u8]) {
        self.index.write().unwrap_or_else(PoisonError::into_inner).forget(unit);
    }

    pub(super) fn begin(&self, commit: Uuid) {
        self.under_way().insert(commit, false);
    }

    pub(super) fn is_delivered(&self, commit: Uuid) -> bool {
        self.under_way().get(&commit) == Some(&true)
    }

    pub(super) fn end(&self, commit: Uuid) {
        self.under_way().remove(&commit);
    }

    pub(super) fn position(&self) -> u64 {
        *self.position.borrow()
    }

    /// Waits until the message at `sequence` is applied; an error when the store has failed.
    pub(super) async fn reach(&self, sequence: u64) -> Result<(), EngineError> {
        let mut position = self.position.subscribe();
        loop {
            let before = self.position();
            // The follower of a failed store moves no more.
            let reached = position.wait_for(|position| *position >= sequence);
            if tokio::time::timeout(Duration::from_secs(1), reached).await.is_ok() {
                return Ok(());
            }
            self.check()?;
            if self.position() == before {
                self.is_stalled.notify_one();
            }
        }
    }

    /// Stops the store for good.
    pub(super) fn fail(&self, error: EngineError) {
        tracing::error!(%error, "The store takes no more requests until it is opened again");
        let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        fault.get_or_insert(error);
    }

    /// The fault that stopped the store, as an error.
    pub(super) fn check(&self) -> Result<(), EngineError> {
        match &*self.fault.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error.clone()),
            None => Ok(()),
        }
    }

    /// Counts a commit and its publication.
    pub(super) fn count(&self) {
        self.commits.fetch_add(1, Ordering::Relaxed);
        self.batches.fetch_add(1, Ordering::Relaxed);
    }
}
