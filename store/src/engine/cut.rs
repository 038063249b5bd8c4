//! Pairs of an engine page by page: those of a prefix, and all of them at one moment, a cut.

use super::{Engine, EngineError, Pair};

/// The pairs whose keys begin with `prefix` and are greater than `after`, in ascending order, in
/// pages of `limit` pairs; the last one has fewer.
pub fn pages(
    engine: &dyn Engine,
    prefix: &[u8],
    after: Option<Vec<u8>>,
    limit: usize,
) -> impl Iterator<Item = Result<Vec<Pair>, EngineError>> {
    let mut next = Some(after);
    std::iter::from_fn(move || {
        let page = engine.scan(prefix, next.take()?.as_deref(), limit);
        let full = page.as_ref().ok().filter(|page| page.len() == limit);
        next = full.and_then(|page| page.last()).map(|(last, _)| Some(last.clone()));
        Some(page)
    })
}

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
