//! The index: all keys, where their values are, and the last message of each unit.
//!
//! It holds the state after all messages up to one sequence of the stream; nothing but messages
//! that the stream delivered changes it.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::ops::Bound;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::message::Message;
use super::spool::{Spool, Stored};
use super::unit::{self, Keys};
use crate::engine::{EngineError, Pair};
use crate::holding::Held;

/// Time for which the stream keeps the last message of an emptied unit.
pub(super) const TOMBSTONE_KEPT: Duration = Duration::from_secs(24 * 3600);

/// A key and where its value is.
pub(super) type Located = (Arc<[u8]>, Stored);

/// What is known of a unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct UnitState {
    /// Sequence of its last message; 0 without any.
    pub(super) sequence: u64,
    /// Bytes of its messages since the last whole one, that one included.
    pub(super) logged_bytes: u64,
    /// Bytes of its keys and values.
    pub(super) live_bytes: u64,
    pub(super) n_keys: u32,
}

/// The state after all messages up to one sequence.
#[derive(Debug)]
pub(super) struct Index {
    pub(super) pairs: BTreeMap<Arc<[u8]>, Stored>,
    pub(super) units: HashMap<Vec<u8>, UnitState>,
    pub(super) held: Held,
    pub(super) live_bytes: u64,
    pub(super) logged_bytes: u64,
    spool: Spool,
    /// Emptied units and the sequences of the messages that did it, oldest first.
    emptied: VecDeque<(Instant, Vec<u8>, u64)>,
}

impl Index {
    pub(super) fn new(spool: Spool) -> Self {
        Self {
            pairs: BTreeMap::new(),
            units: HashMap::new(),
            held: Held::default(),
            live_bytes: 0,
            logged_bytes: 0,
            spool,
            emptied: VecDeque::new(),
        }
    }

    pub(super) fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        self.pairs.get(key).map(read).transpose()
    }

    pub(super) fn unit(&self, id: &[u8]) -> UnitState {
        self.units.get(id).copied().unwrap_or_default()
    }

    /// Up to `limit` keys with `prefix` and greater than `after`.
    pub(super) fn scan(&self, prefix: &[u8], after: Option<&[u8]>, limit: usize) -> Vec<Located> {
        let start = match after {
            Some(after) if after >= prefix => Bound::Excluded(after),
            _ => Bound::Included(prefix),
        };
        let pairs = self.pairs.range::<[u8], _>((start, Bound::Unbounded));
        let within = pairs.take_while(|(key, _)| key.starts_with(prefix)).take(limit);
        within.map(|(key, value)| (Arc::clone(key), value.clone())).collect()
    }

    /// The keys of a unit.
    pub(super) fn of_unit(&self, id: &[u8]) -> Vec<Located> {
        match unit::keys(id) {
            Keys::One(key) => {
                let found = self.pairs.get_key_value(&key[..]);
                found.map(|(key, value)| (Arc::clone(key), value.clone())).into_iter().collect()
            }
            Keys::Under(prefixes) => {
                prefixes.iter().flat_map(|prefix| self.scan(prefix, None, usize::MAX)).collect()
            }
        }
    }

    /// Applies a message of `bytes` at `sequence`.
    pub(super) fn apply(
        &mut self,
        message: &Message,
        sequence: u64,
        bytes: u64,
    ) -> Result<(), EngineError> {
        let mut state = self.unit(&message.unit);
        if message.is_whole {
            for (key, _) in self.of_unit(&message.unit) {
                self.set(&key, None, &mut state)?;
            }
            self.logged_bytes -= state.logged_bytes;
            state.logged_bytes = 0;
        }
        let values: Vec<&[u8]> =
            message.writes.iter().filter_map(|(_, value)| value.as_deref()).collect();
        let mut stored =
            self.spool.store(&values).map_err(failed("writing the spool"))?.into_iter();
        for (key, value) in &message.writes {
            let stored = value.as_ref().and_then(|_| stored.next());
            self.set(key, stored, &mut state)?;
        }
        state.sequence = sequence;
        state.logged_bytes += bytes;
        self.logged_bytes += bytes;
        if state.n_keys == 0 && message.is_whole {
            self.emptied.push_back((Instant::now(), message.unit.clone(), sequence));
        }
        self.units.insert(message.unit.clone(), state);
        Ok(())
    }

    fn set(
        &mut self,
        key: &[u8],
        value: Option<Stored>,
        state: &mut UnitState,
    ) -> Result<(), EngineError> {
        let size = |value: &Stored| (key.len() + value.len()) as u64;
        let after = value.as_ref().map(size);
        let before = match &value {
            Some(value) => self.pairs.insert(key.into(), value.clone()),
            None => self.pairs.remove(key),
        };
        // Only holdings are counted by content.
        if key.first() == Some(&(crate::key::Space::Holding as u8)) {
            let (before, value) = (before.as_ref(), value.as_ref());
            let before = before.map(read).transpose()?;
            self.held.note(key, before.as_deref(), value.map(read).transpose()?.as_deref())?;
        }
        for total in [&mut state.live_bytes, &mut self.live_bytes] {
            *total = *total + after.unwrap_or(0) - before.as_ref().map_or(0, size);
        }
        state.n_keys = state.n_keys + u32::from(after.is_some()) - u32::from(before.is_some());
        Ok(())
    }

    /// Removes an empty unit from the index, after its last message has left the stream.
    pub(super) fn forget(&mut self, id: &[u8]) {
        if let Some(state) = self.units.get(id).filter(|state| state.n_keys == 0) {
            self.logged_bytes -= state.logged_bytes;
            self.units.remove(id);
        }
    }

    /// Forgets the units that were emptied before the stream's memory of them ended.
    pub(super) fn forget_expired(&mut self) {
        while self.emptied.front().is_some_and(|(at, ..)| at.elapsed() > TOMBSTONE_KEPT) {
            let Some((_, id, sequence)) = self.emptied.pop_front() else { return };
            // One that was written again since has a later message.
            if self.unit(&id).sequence == sequence {
                self.forget(&id);
            }
        }
    }
}

/// The value.
pub(super) fn read(stored: &Stored) -> Result<Vec<u8>, EngineError> {
    stored.read().map_err(failed("reading the spool"))
}

/// Pairs with their values.
pub(super) fn read_all(located: Vec<Located>) -> Result<Vec<Pair>, EngineError> {
    located.into_iter().map(|(key, value)| Ok((key.to_vec(), read(&value)?))).collect()
}

fn failed(doing: &'static str) -> impl Fn(std::io::Error) -> EngineError {
    move |error| EngineError::Failed { doing, detail: error.to_string() }
}
