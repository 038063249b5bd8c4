//! A cut: everything as it was after one commit, read while others write.
//!
//! Sled knows no such thing. So while a cut is read the writer remembers, before it changes a
//! key that the reader has not passed yet, what the key held; the reader lays that over what
//! it finds. Both look under one lock, the reader after it has read: what it may have seen
//! changed is remembered by then. A compaction changes which levels there are, not what they
//! say, so a cut goes on across it.

use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::tally::TALLY_KEY;
use super::{Shared, guarded};
use crate::engine::{Cut, EngineError, Pair};

/// No more is remembered for a reader, in bytes.
const BYTES_MAX: usize = 256 << 20;
/// What a remembered key costs besides its bytes.
const ENTRY_BYTES: usize = 64;

/// What is remembered for the reader of a cut, if there is one.
#[derive(Debug, Default)]
pub(super) struct Memory(Mutex<Option<Remembered>>);

#[derive(Debug)]
struct Remembered {
    /// The reader has all up to here.
    passed: Vec<u8>,
    /// What keys behind it held; `None` is nothing.
    before: BTreeMap<Vec<u8>, Option<Vec<u8>>>,
    bytes: usize,
}

impl Memory {
    fn lock(&self) -> MutexGuard<'_, Option<Remembered>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins to remember, from the state that the database has now. The writer calls it.
    pub(super) fn begin(&self) -> Result<(), EngineError> {
        let mut memory = self.lock();
        if memory.is_some() {
            return Err(EngineError::CutUnderWay);
        }
        let passed = TALLY_KEY.to_vec();
        *memory = Some(Remembered { passed, before: BTreeMap::new(), bytes: 0 });
        Ok(())
    }

    /// Ends it.
    pub(super) fn end(&self) {
        *self.lock() = None;
    }

    /// Remembers what `key` holds, which is about to change. The writer calls it.
    pub(super) fn note(&self, key: &[u8], value: Option<&[u8]>) {
        let mut memory = self.lock();
        let Some(remembered) = memory.as_mut() else { return };
        if key <= remembered.passed.as_slice() || remembered.before.contains_key(key) {
            return;
        }
        remembered.bytes += ENTRY_BYTES + key.len() + value.map_or(0, <[u8]>::len);
        if remembered.bytes <= BYTES_MAX {
            remembered.before.insert(key.to_vec(), value.map(<[u8]>::to_vec));
        } else {
            // The reader finds out by the count.
            remembered.before.clear();
        }
    }
}

/// The reader of a cut.
pub(super) struct SledCut {
    pub(super) shared: Arc<Shared>,
    pub(super) memory: Arc<Memory>,
}

impl Cut for SledCut {
    fn next(&mut self, limit: usize) -> Result<Vec<Pair>, EngineError> {
        loop {
            let from = match self.memory.lock().as_ref() {
                Some(remembered) => remembered.passed.clone(),
                None => return Err(EngineError::Stopped),
            };
            let start = Bound::Excluded(from.as_slice());
            let page = guarded("reading for a snapshot", || {
                self.shared.levels().range(start).take(limit.max(1)).collect::<Result<Vec<_>, _>>()
            })?;
            let is_last = page.len() < limit.max(1);
            let found = self.as_before(page, is_last)?;
            // A page of keys that are all new holds nothing of the cut.
            if !found.is_empty() || is_last {
                return Ok(found);
            }
        }
    }
}

impl SledCut {
    /// The pairs of a page as they were, and the page passed.
    fn as_before(&self, page: Vec<Pair>, is_last: bool) -> Result<Vec<Pair>, EngineError> {
        let mut memory = self.memory.lock();
        let remembered = memory.as_mut().ok_or(EngineError::Stopped)?;
        if remembered.bytes > BYTES_MAX {
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
            // Behind every key: what is written from now on is of no interest.
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
        self.memory.end();
    }
}
