//! What an engine counts of content: large values that it keeps in objects beside its records.

/// Counts of content; all are 0 for an engine that keeps none apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContentStats {
    /// Number of objects that have values.
    pub n_objects: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Number of objects that this process put.
    pub n_put: u64,
    /// Number of objects that this process fetched.
    pub n_fetched: u64,
    /// Their bytes, as often as they were fetched.
    pub fetched_bytes: u64,
    /// Number of reads of a value whose object was in the local cache.
    pub n_cache_hits: u64,
    /// Bytes of the local cache.
    pub cached_bytes: u64,
    /// Fetches of this process that failed.
    pub failed: FailedFetches,
    /// Number of objects that were missing when the bucket was last compared with the records.
    pub n_missing: u64,
    /// Number of objects that this process removed after commits that removed their values.
    pub n_removed: u64,
    /// Number of leftovers of crashes that this process removed.
    pub n_leftovers: u64,
}

/// Fetches that failed, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FailedFetches {
    /// Records name the object, and it is not there.
    pub missing: u64,
    /// It has other bytes.
    pub damaged: u64,
    /// No record names it any more: the read began before that, and took too long.
    pub removed: u64,
    /// It could not be asked for, or not be kept.
    pub unanswered: u64,
}
