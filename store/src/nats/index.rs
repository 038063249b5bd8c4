//! The index: all keys, where their values are, and the last message of each unit.
//!
//! It holds the state after all messages up to one sequence of the stream; nothing but messages
//! that the stream delivered changes it.

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::ops::Bound;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::content::{Contents, Object};
use super::message::{Message, ObjectId, PART_BYTES, Part, Value};
use super::pairs::Pairs;
use super::spool::{Spool, Stored};
use super::unit::{self, Keys};
use crate::engine::content::ContentStats;
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
    /// Bytes of its keys and values in messages: without content, which is in objects.
    pub(super) message_bytes: u64,
    pub(super) n_keys: u32,
}

/// An object, and the number of keys whose values it has.
#[derive(Debug)]
struct Counted {
    object: Arc<Object>,
    n_keys: u32,
}

/// The state after all messages up to one sequence.
#[derive(Debug)]
pub(super) struct Index {
    pub(super) pairs: Pairs<Stored>,
    pub(super) units: HashMap<Vec<u8>, UnitState>,
    pub(super) held: Held,
    pub(super) live_bytes: u64,
    pub(super) logged_bytes: u64,
    /// Bytes of the objects that have values.
    pub(super) content_bytes: u64,
    spool: Spool,
    contents: Arc<Contents>,
    objects: HashMap<ObjectId, Counted>,
    /// Emptied units and the sequences of the messages that did it, oldest first.
    emptied: VecDeque<(Instant, Vec<u8>, u64)>,
}

impl Index {
    pub(super) fn new(spool: Spool, contents: Arc<Contents>) -> Self {
        Self {
            pairs: Pairs::default(),
            units: HashMap::new(),
            held: Held::default(),
            live_bytes: 0,
            logged_bytes: 0,
            content_bytes: 0,
            spool,
            contents,
            objects: HashMap::new(),
            emptied: VecDeque::new(),
        }
    }

    pub(super) fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        self.pairs.get(key).as_ref().map(Stored::read).transpose()
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
        let pairs = self.pairs.from(start);
        pairs.take_while(|(key, _)| key.starts_with(prefix)).take(limit).collect()
    }

    /// The keys of a unit.
    pub(super) fn of_unit(&self, id: &[u8]) -> Vec<Located> {
        match unit::keys(id) {
            Keys::One(key) => {
                let found = self.pairs.get(&key);
                found.map(|value| (Arc::from(key), value)).into_iter().collect()
            }
            Keys::Under(prefixes) => {
                prefixes.iter().flat_map(|prefix| self.scan(prefix, None, usize::MAX)).collect()
            }
        }
    }

    /// Applies a message of `bytes` at `sequence`; returns the objects that lost their last value.
    pub(super) fn apply(
        &mut self,
        message: &Message,
        sequence: u64,
        bytes: u64,
    ) -> Result<Vec<Arc<Object>>, EngineError> {
        let mut state = self.unit(&message.unit);
        let mut left = BTreeSet::new();
        if message.is_whole {
            for (key, _) in self.of_unit(&message.unit) {
                left.extend(self.set(&key, None, &mut state)?);
            }
            self.logged_bytes -= state.logged_bytes;
            state.logged_bytes = 0;
        }
        let values = message.writes.iter().filter_map(|(_, value)| match value {
            Some(Value::Here(value)) => Some(&value[..]),
            _ => None,
        });
        let values: Vec<&[u8]> = values.collect();
        let mut stored = self.spool.store(&values).map_err(failed)?.into_iter();
        for (key, value) in &message.writes {
            let stored = match value {
                None => None,
                Some(Value::Here(_)) => stored.next(),
                Some(Value::There(part)) => Some(self.there(part, &message.unit)),
            };
            left.extend(self.set(key, stored, &mut state)?);
        }
        state.sequence = sequence;
        state.logged_bytes += bytes;
        self.logged_bytes += bytes;
        if state.n_keys == 0 && message.is_whole {
            self.emptied.push_back((Instant::now(), message.unit.clone(), sequence));
        }
        self.units.insert(message.unit.clone(), state);
        Ok(left.into_iter().filter_map(|id| self.release(id)).collect())
    }

    /// The value in an object, which gets one key more.
    fn there(&mut self, part: &Part, unit: &[u8]) -> Stored {
        let counted = self.objects.entry(part.object.id).or_insert_with(|| {
            self.content_bytes += u64::from(part.object.length);
            let contents = Arc::clone(&self.contents);
            Counted { object: Arc::new(Object::new(part.object, unit, contents)), n_keys: 0 }
        });
        counted.n_keys += 1;
        Stored::Content { object: Arc::clone(&counted.object), at: part.at, length: part.length }
    }

    /// Removes an object without values.
    fn release(&mut self, id: ObjectId) -> Option<Arc<Object>> {
        if self.has_object(id) {
            return None;
        }
        let Counted { object, .. } = self.objects.remove(&id)?;
        self.content_bytes -= u64::from(object.described.length);
        object.release();
        Some(object)
    }

    /// Whether an object has values.
    pub(super) fn has_object(&self, id: ObjectId) -> bool {
        self.objects.get(&id).is_some_and(|counted| counted.n_keys > 0)
    }

    /// What there is in objects, and what was counted of it.
    pub(super) fn content(&self) -> ContentStats {
        let n_objects = self.objects.len() as u64;
        ContentStats { n_objects, bytes: self.content_bytes, ..self.contents.stats() }
    }

    /// The objects that have values.
    pub(super) fn objects(&self) -> impl Iterator<Item = &Arc<Object>> {
        self.objects.values().map(|counted| &counted.object)
    }

    /// Sets a key; returns the object that has one value less.
    fn set(
        &mut self,
        key: &[u8],
        value: Option<Stored>,
        state: &mut UnitState,
    ) -> Result<Option<ObjectId>, EngineError> {
        let size = |value: &Stored| (key.len() + value.len()) as u64;
        let spoken = |value: &Stored| (key.len() + message_bytes(value)) as u64;
        let after = value.as_ref().map(size);
        let after_spoken = value.as_ref().map_or(0, spoken);
        let before = match &value {
            Some(value) => self.pairs.insert(key, value.clone()),
            None => self.pairs.remove(key),
        };
        // Only holdings are counted by content.
        if key.first() == Some(&(crate::key::Space::Holding as u8)) {
            let (before, value) = (before.as_ref(), value.as_ref());
            let before = before.map(Stored::read).transpose()?;
            let value = value.map(Stored::read).transpose()?;
            self.held.note(key, before.as_deref(), value.as_deref())?;
        }
        for total in [&mut state.live_bytes, &mut self.live_bytes] {
            *total = *total + after.unwrap_or(0) - before.as_ref().map_or(0, size);
        }
        state.message_bytes =
            state.message_bytes + after_spoken - before.as_ref().map_or(0, spoken);
        state.n_keys = state.n_keys + u32::from(after.is_some()) - u32::from(before.is_some());
        let Some(Stored::Content { object, .. }) = before else { return Ok(None) };
        let id = object.described.id;
        if let Some(counted) = self.objects.get_mut(&id) {
            counted.n_keys -= 1;
        }
        Ok(Some(id))
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

/// Bytes of a value in a message.
pub(super) fn message_bytes(value: &Stored) -> usize {
    match value {
        Stored::Content { .. } => PART_BYTES,
        Stored::Memory(_) | Stored::File { .. } => value.len(),
    }
}

/// Pairs with their values.
pub(super) fn read_all(located: Vec<Located>) -> Result<Vec<Pair>, EngineError> {
    located.into_iter().map(|(key, value)| Ok((key.to_vec(), value.read()?))).collect()
}

fn failed(error: std::io::Error) -> EngineError {
    EngineError::Failed { doing: "writing the spool", detail: error.to_string() }
}
