//! The interface of a cut: the pairs of an engine at one moment.

use super::{EngineError, Pair};

/// All pairs of an engine after one commit, page by page in ascending order.
pub trait Cut: Send {
    /// Up to `limit` further pairs; empty at the end.
    ///
    /// # Errors
    /// [`EngineError::CutTooLarge`] when too much was written since; [`EngineError`] when the engine
    /// cannot read.
    fn next(&mut self, limit: usize) -> Result<Vec<Pair>, EngineError>;

    /// As [`Cut::next`], but leaves out values that would have to be fetched from elsewhere.
    ///
    /// # Errors
    /// As [`Cut::next`].
    fn next_here(&mut self, limit: usize) -> Result<Vec<(Vec<u8>, Found)>, EngineError> {
        let pairs = self.next(limit)?;
        Ok(pairs.into_iter().map(|(key, value)| (key, Found::Value(value))).collect())
    }
}

/// A value, or its length if it is elsewhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Found {
    /// The value.
    Value(Vec<u8>),
    /// The length of a value that would have to be fetched.
    Elsewhere(usize),
}
