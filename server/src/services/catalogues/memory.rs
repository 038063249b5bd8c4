//! A cache with a byte budget that evicts the least recently used values.
//!
//! A value in use is never evicted: a request for space then fails, and nothing is added. So
//! the bytes never exceed the budget.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Values by key, within a byte budget.
pub(super) struct Memory<K, V> {
    budget: u64,
    kept: Mutex<Kept<K, V>>,
}

struct Kept<K, V> {
    entries: BTreeMap<K, Entry<V>>,
    uses: u64,
}

struct Entry<V> {
    value: Arc<V>,
    bytes: u64,
    last_use: u64,
}

/// Reason of a failed request for space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoRoom {
    /// The value alone exceeds the budget.
    TooLarge,
    /// The values in use take this many bytes.
    InUse { bytes: u64 },
}

impl<K: Copy + Ord, V> Memory<K, V> {
    /// An empty cache; `budget` in bytes.
    pub(super) fn new(budget: u64) -> Self {
        Self { budget, kept: Mutex::new(Kept { entries: BTreeMap::new(), uses: 0 }) }
    }

    pub(super) fn budget(&self) -> u64 {
        self.budget
    }

    /// The value of a key, which becomes the most recently used.
    pub(super) fn get(&self, key: &K) -> Option<Arc<V>> {
        let mut kept = self.lock();
        kept.uses += 1;
        let now = kept.uses;
        let entry = kept.entries.get_mut(key)?;
        entry.last_use = now;
        Some(Arc::clone(&entry.value))
    }

    /// Frees `bytes`, or nothing if that is impossible.
    pub(super) fn make_room(&self, bytes: u64) -> Result<(), NoRoom> {
        self.lock().make_room(bytes, self.budget)
    }

    /// Adds a value of `bytes`, if there is or can be made space.
    pub(super) fn keep(&self, key: K, value: V, bytes: u64) -> Result<Arc<V>, NoRoom> {
        let mut kept = self.lock();
        kept.make_room(bytes, self.budget)?;
        kept.uses += 1;
        let value = Arc::new(value);
        let entry = Entry { value: Arc::clone(&value), bytes, last_use: kept.uses };
        kept.entries.insert(key, entry);
        Ok(value)
    }

    /// The total bytes of the values whose keys satisfy `counts`.
    pub(super) fn bytes(&self, counts: impl Fn(&K) -> bool) -> u64 {
        let kept = self.lock();
        kept.entries.iter().filter(|(key, _)| counts(key)).map(|(_, entry)| entry.bytes).sum()
    }

    fn lock(&self) -> MutexGuard<'_, Kept<K, V>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<K: Copy + Ord, V> Kept<K, V> {
    fn make_room(&mut self, bytes: u64, budget: u64) -> Result<(), NoRoom> {
        if bytes > budget {
            return Err(NoRoom::TooLarge);
        }
        let total: u64 = self.entries.values().map(|entry| entry.bytes).sum();
        let mut surplus = (total + bytes).saturating_sub(budget);
        // No value can be taken in between: that needs the lock.
        let is_free = |entry: &Entry<V>| Arc::strong_count(&entry.value) == 1;
        let mut free: Vec<(u64, K, u64)> = self
            .entries
            .iter()
            .filter(|(_, entry)| is_free(entry))
            .map(|(key, entry)| (entry.last_use, *key, entry.bytes))
            .collect();
        let in_use = total - free.iter().map(|(_, _, bytes)| bytes).sum::<u64>();
        if in_use + bytes > budget {
            return Err(NoRoom::InUse { bytes: in_use });
        }
        free.sort_unstable_by_key(|entry| entry.0);
        for (_, key, bytes) in free {
            if surplus == 0 {
                break;
            }
            self.entries.remove(&key);
            surplus = surplus.saturating_sub(bytes);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 bytes each of `a` and `b`, of which `a` was used last, and room for 20 more.
    fn two() -> Memory<char, char> {
        let memory = Memory::new(100);
        for key in ['a', 'b'] {
            memory.keep(key, key, 40).unwrap();
        }
        assert_eq!(memory.get(&'a').as_deref(), Some(&'a'));
        memory
    }

    #[test]
    fn only_the_least_recently_used_values_are_evicted() {
        let memory = two();
        memory.keep('c', 'c', 20).unwrap();
        assert_eq!(memory.bytes(|_| true), 100, "all fit");
        memory.keep('d', 'd', 30).unwrap();
        assert_eq!(memory.get(&'b'), None);
        assert_eq!(memory.bytes(|key| *key == 'a'), 40);
        assert_eq!(memory.bytes(|_| true), 90);
    }

    #[test]
    fn values_in_use_stay_and_nothing_is_added() {
        let memory = two();
        let (a, b) = (memory.get(&'a').unwrap(), memory.get(&'b').unwrap());
        assert_eq!(memory.keep('c', 'c', 21), Err(NoRoom::InUse { bytes: 80 }));
        assert_eq!(memory.make_room(101), Err(NoRoom::TooLarge));
        assert_eq!(memory.bytes(|_| true), 80);
        drop(a);
        // 40 in use and 61 are too many: the unused value stays as well.
        assert_eq!(memory.keep('c', 'c', 61), Err(NoRoom::InUse { bytes: 40 }));
        assert_eq!(memory.bytes(|_| true), 80);
        assert_eq!(memory.keep('c', 'c', 60).as_deref(), Ok(&'c'));
        assert_eq!((memory.get(&'a'), memory.get(&'b')), (None, Some(b)));
    }
}
