//! A cut: the state after one commit, readable during later writes.
//!
//! Sled has no such thing. While a cut is read, the writer remembers the old value of every
//! key that it changes and that the reader has not passed yet; the reader overlays these
//! values. Both take one lock, the reader after it has read: every change it may have seen is
//! remembered by then. A compaction changes the levels, not their content, so a cut continues
//! across it.

use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::tally::TALLY_KEY;
use super::{Shared, guarded};
use crate::engine::{Cut, EngineError, Pair};

/// Maximum number of bytes remembered for all readers; the largest is abandoned above it.
const BYTES_MAX: usize = 256 << 20;
/// Maximum number of concurrent cuts.
pub const CUTS_MAX: usize = 4;
/// Overhead of a remembered key, bytes.
const ENTRY_BYTES: usize = 64;

/// Old values remembered for the readers of cuts.
#[derive(Debug, Default)]
pub(super) struct Memory(Mutex<Readers>);

#[derive(Debug, Default)]
struct Readers {
    next: u64,
    /// By the number of the cut.
    all: BTreeMap<u64, Remembered>,
}

#[derive(Debug)]
struct Remembered {
    /// The reader has passed all keys up to this one.
    passed: Vec<u8>,
    /// Old values of later keys; `None` if the key was absent.
    before: BTreeMap<Vec<u8>, Option<Vec<u8>>>,
    bytes: usize,
    /// Whether too much was written for the memory to be complete.
    is_over: bool,
}

impl Memory {
    fn lock(&self) -> MutexGuard<'_, Readers> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts to remember, from the present state, and returns the cut's number. Called by
    /// the writer.
    pub(super) fn begin(&self) -> Result<u64, EngineError> {
        let mut readers = self.lock();
        if readers.all.len() >= CUTS_MAX {
            return Err(EngineError::CutsUnderWay { max: CUTS_MAX });
        }
        let number = readers.next;
        readers.next += 1;
        let (passed, before) = (TALLY_KEY.to_vec(), BTreeMap::new());
        readers.all.insert(number, Remembered { passed, before, bytes: 0, is_over: false });
        Ok(number)
    }

    /// Ends a cut.
    pub(super) fn end(&self, number: u64) {
        self.lock().all.remove(&number);
    }

    /// Remembers the value of `key`, which is about to change. Called by the writer.
    pub(super) fn note(&self, key: &[u8], value: Option<&[u8]>) {
        let mut readers = self.lock();
        for remembered in readers.all.values_mut() {
            remembered.note(key, value);
        }
        if readers.all.values().map(|remembered| remembered.bytes).sum::<usize>() > BYTES_MAX
            && let Some(most) = readers.all.values_mut().max_by_key(|one| one.bytes)
        {
            most.before.clear();
            (most.bytes, most.is_over) = (0, true);
        }
    }
}

impl Remembered {
    fn note(&mut self, key: &[u8], value: Option<&[u8]>) {
        if self.is_over || key <= self.passed.as_slice() || self.before.contains_key(key) {
            return;
        }
        self.bytes += size(key, value);
        self.before.insert(key.to_vec(), value.map(<[u8]>::to_vec));
    }
}

/// The reader of a cut.
pub(super) struct SledCut {
    pub(super) shared: Arc<Shared>,
    pub(super) memory: Arc<Memory>,
    /// The number of the cut.
    pub(super) number: u64,
}

impl Cut for SledCut {
    fn next(&mut self, limit: usize) -> Result<Vec<Pair>, EngineError> {
        loop {
            let from = match self.memory.lock().all.get(&self.number) {
                Some(remembered) => remembered.passed.clone(),
                None => return Err(EngineError::Stopped),
            };
            let start = Bound::Excluded(from.as_slice());
            let page = guarded("reading for a snapshot", || {
                self.shared.levels().range(start).take(limit.max(1)).collect::<Result<Vec<_>, _>>()
            })?;
            let is_last = page.len() < limit.max(1);
            let found = self.as_before(page, is_last)?;
            // A page of new keys alone contains nothing of the cut.
            if !found.is_empty() || is_last {
                return Ok(found);
            }
        }
    }
}

impl SledCut {
    /// The old pairs of a page, which is then passed.
    fn as_before(&self, page: Vec<Pair>, is_last: bool) -> Result<Vec<Pair>, EngineError> {
        let mut readers = self.memory.lock();
        let remembered = readers.all.get_mut(&self.number).ok_or(EngineError::Stopped)?;
        if remembered.is_over {
            return Err(EngineError::CutTooLarge { max: BYTES_MAX });
        }
        let mut pairs: BTreeMap<Vec<u8>, Vec<u8>> = page.into_iter().collect();
        let end = pairs.last_key_value().map(|(key, _)| key.clone());
        let behind = match (&end, is_last) {
            (Some(end), false) => remembered.before.split_off(&[end.as_slice(), &[0]].concat()),
            _ => BTreeMap::new(),
        };
        for (key, value) in std::mem::replace(&mut remembered.before, behind) {
            match value {
                Some(value) => pairs.insert(key, value),
                None => pairs.remove(&key),
            };
        }
        remembered.bytes =
            remembered.before.iter().map(|(key, value)| size(key, value.as_deref())).sum();
        if is_last {
            // Beyond every key: later writes are not remembered.
            remembered.passed = vec![0xff; crate::engine::KEY_BYTES_MAX + 1];
        } else if let Some(end) = end {
            remembered.passed = end;
        }
        Ok(pairs.into_iter().collect())
    }
}

fn size(key: &[u8], value: Option<&[u8]>) -> usize {
    ENTRY_BYTES + key.len() + value.map_or(0, <[u8]>::len)
}

impl Drop for SledCut {
    fn drop(&mut self) {
        self.memory.end(self.number);
    }
}
