//! Counts of what happens to content, since the store was opened.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::engine::content::{ContentStats, FailedFetches};

/// A count that only grows, or is set.
#[derive(Debug, Default)]
pub(super) struct Count(AtomicU64);

impl Count {
    pub(super) fn add(&self, more: u64) {
        self.0.fetch_add(more, Ordering::Relaxed);
    }

    pub(super) fn set(&self, value: u64) {
        self.0.store(value, Ordering::Relaxed);
    }

    fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// The counts; [`ContentStats`] says what each is.
#[derive(Debug, Default)]
pub(super) struct Counts {
    pub(super) put: Count,
    pub(super) fetched: Count,
    pub(super) fetched_bytes: Count,
    pub(super) cache_hits: Count,
    pub(super) missing: Count,
    pub(super) removed: Count,
    pub(super) leftovers: Count,
    pub(super) fetches_missing: Count,
    pub(super) fetches_damaged: Count,
    pub(super) fetches_removed: Count,
    pub(super) fetches_unanswered: Count,
}

impl Counts {
    /// The counts, without what the index and the cache know.
    pub(super) fn stats(&self) -> ContentStats {
        ContentStats {
            n_put: self.put.get(),
            n_fetched: self.fetched.get(),
            fetched_bytes: self.fetched_bytes.get(),
            n_cache_hits: self.cache_hits.get(),
            n_missing: self.missing.get(),
            n_removed: self.removed.get(),
            n_leftovers: self.leftovers.get(),
            failed: FailedFetches {
                missing: self.fetches_missing.get(),
                damaged: self.fetches_damaged.get(),
                removed: self.fetches_removed.get(),
                unanswered: self.fetches_unanswered.get(),
            },
            ..ContentStats::default()
        }
    }
}
