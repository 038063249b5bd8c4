//! Commits that the writer has checked and writes together, as one batch.
//!
//! A commit is checked against the state after all before it, written or gathered, so that a group
//! gives what its commits give one by one.

use std::collections::BTreeMap;

use super::guarded;
use super::levels::Levels;
use super::tally::Tally;
use crate::engine::EngineError;

/// Gathered commits.
pub(super) struct Gathered {
    /// The last write of each key; `None` removes it.
    pub(super) writes: BTreeMap<Vec<u8>, Option<Vec<u8>>>,
    /// The tally after them.
    pub(super) tally: Tally,
    /// Bytes of all keys and values after them, without the tally's.
    pub(super) live_bytes: u64,
}

impl Gathered {
    /// The value of a key after the gathered commits.
    pub(super) fn get(&self, levels: &Levels, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        match self.writes.get(key) {
            Some(written) => Ok(written.clone()),
            None => guarded("reading before a write", || levels.get(key)),
        }
    }

    /// Adds the change of a key that had the value `before`.
    pub(super) fn change(&mut self, key: Vec<u8>, before: Option<&[u8]>, value: Option<Vec<u8>>) {
        if let Some(before) = before {
            self.tally.remove(&key, before);
            self.live_bytes -= (key.len() + before.len()) as u64;
        }
        if let Some(value) = &value {
            self.tally.add(&key, value);
            self.live_bytes += (key.len() + value.len()) as u64;
        }
        self.writes.insert(key, value);
    }
}
