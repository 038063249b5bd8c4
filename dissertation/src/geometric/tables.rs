//! Tables shared by the beliefs about one catalogue, within a common memory budget.
//!
//! A table lives as long as a belief uses it; its bytes are reserved before it is built and
//! released with it. Two simultaneous requests may both build one: no lock is held meanwhile,
//! since threads that help to build it may need another table.

use std::collections::BTreeMap;
use std::ops::Deref;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use super::GeometricError;

/// Memory budget of the shared tables of all catalogues that use it.
#[derive(Debug)]
pub struct TableBudget {
    max: usize,
    used: AtomicUsize,
}

impl TableBudget {
    /// A budget of this many bytes.
    #[must_use]
    pub fn new(bytes_max: usize) -> Arc<Self> {
        Arc::new(Self { max: bytes_max, used: AtomicUsize::new(0) })
    }

    /// Bytes of all present tables.
    #[must_use]
    pub fn used(&self) -> usize {
        self.used.load(Ordering::Relaxed)
    }

    fn take(self: &Arc<Self>, bytes: usize) -> Result<Share, GeometricError> {
        let more = |used: usize| used.checked_add(bytes).filter(|sum| *sum <= self.max);
        let taken = self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, more);
        match taken {
            Ok(_) => Ok(Share { budget: Arc::clone(self), bytes }),
            Err(in_use) => Err(GeometricError::TablesFull { needed: bytes, in_use, max: self.max }),
        }
    }
}

/// Bytes reserved from a budget; released on drop.
#[derive(Debug)]
struct Share {
    budget: Arc<TableBudget>,
    bytes: usize,
}

impl Drop for Share {
    fn drop(&mut self) {
        self.budget.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// A table with its share of the budget.
#[derive(Debug)]
pub(super) struct Counted<T> {
    table: T,
    _share: Share,
}

impl<T> Deref for Counted<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.table
    }
}

/// The present tables of one kind, by key.
#[derive(Debug)]
pub(super) struct Tables<K, T>(Mutex<BTreeMap<K, Weak<Counted<T>>>>);

impl<K: Ord, T> Tables<K, T> {
    pub(super) fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// Whether a belief holds this table.
    pub(super) fn has(&self, key: &K) -> bool {
        self.find(key).is_some()
    }

    fn find(&self, key: &K) -> Option<Arc<Counted<T>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(key)?.upgrade()
    }

    /// The table of a key. If no belief holds it, reserves `bytes` of the budget and builds it.
    pub(super) fn get(
        &self,
        key: K,
        budget: &Arc<TableBudget>,
        bytes: usize,
        make: impl FnOnce() -> T,
    ) -> Result<Arc<Counted<T>>, GeometricError> {
        if let Some(found) = self.find(&key) {
            return Ok(found);
        }
        let share = budget.take(bytes)?;
        let made = Arc::new(Counted { table: make(), _share: share });
        let mut tables = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(quicker) = tables.get(&key).and_then(Weak::upgrade) {
            return Ok(quicker);
        }
        tables.retain(|_, table| table.strong_count() > 0);
        tables.insert(key, Arc::downgrade(&made));
        Ok(made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_shared_counted_and_released() {
        let (budget, tables) = (TableBudget::new(100), Tables::new());
        let get = |key: char, bytes| tables.get(key, &budget, bytes, || key);
        let (a, same) = (get('a', 60).unwrap(), get('a', 60).unwrap());
        assert!(Arc::ptr_eq(&a, &same));
        assert_eq!((budget.used(), tables.has(&'a'), tables.has(&'b')), (60, true, false));
        let full = GeometricError::TablesFull { needed: 41, in_use: 60, max: 100 };
        assert_eq!(get('b', 41).unwrap_err(), full);
        assert!(get('b', usize::MAX).is_err());
        drop((a, same));
        assert_eq!((budget.used(), tables.has(&'a')), (0, false));
        assert_eq!(**get('b', 41).unwrap(), 'b');
    }
}
