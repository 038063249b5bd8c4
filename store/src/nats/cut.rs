//! Cuts of a store on a cluster: the index at one moment, whose values are read later.
//!
//! Content that is removed meanwhile can be read for as long as the bucket keeps it.

use std::sync::Arc;

use super::index::{Located, read_all};
use super::pairs::{Entry, expanded};
use super::spool::Stored;
use crate::engine::{Cut, EngineError, Found, Pair};

/// Pairs that are still to be returned.
pub(super) struct NatsCut(Box<dyn Iterator<Item = Located> + Send>);

impl NatsCut {
    pub(super) fn new(entries: Vec<(Arc<[u8]>, Entry<Stored>)>) -> Self {
        Self(Box::new(entries.into_iter().flat_map(expanded)))
    }
}

impl Cut for NatsCut {
    fn next(&mut self, limit: usize) -> Result<Vec<Pair>, EngineError> {
        read_all(self.0.by_ref().take(limit).collect())
    }

    fn next_here(&mut self, limit: usize) -> Result<Vec<(Vec<u8>, Found)>, EngineError> {
        let found = self.0.by_ref().take(limit).map(|(key, value)| {
            let found = match &value {
                Stored::Content { length, .. } => Found::Elsewhere(usize::from(*length)),
                Stored::Memory(_) | Stored::File { .. } => Found::Value(value.read()?),
            };
            Ok((key.to_vec(), found))
        });
        found.collect()
    }
}
