//! Beliefs of a session in memory: the newest, and a few earlier ones to return to.
//!
//! A belief includes the first `n` presses of the order. A late reading or a retraction drops
//! the beliefs that include more than the unchanged part before it; the next fold starts from
//! the newest one left. Earlier beliefs are kept at growing distances, so that returning by
//! `k` readings folds a multiple of `k` again, not all of them. Copies equal their originals,
//! so the start of a fold changes no bit.

use palpate_schemas::Method;
use palpate_store::journal::Entry;

use super::order::{Chronicle, Touch};
use crate::live::belief::SessionBelief;

/// Maximum number of earlier beliefs kept.
const CHECKPOINTS_MAX: usize = 4;
/// Minimum number of readings between two kept beliefs.
const STRIDE: usize = 4;

/// A belief and the number of presses it includes.
#[derive(Clone)]
pub(super) struct Fold {
    pub(super) belief: SessionBelief,
    pub(super) n: usize,
}

/// The folding order of presses, and a belief on the way, if any.
pub(super) type Start = (Vec<Touch>, Option<Fold>);

/// Memory of a session.
#[derive(Default)]
pub(super) struct Memory {
    pub(super) chronicle: Chronicle,
    newest: Option<Fold>,
    /// Ascending.
    checkpoints: Vec<Fold>,
    /// Number of readings in the stored checkpoint.
    stored: usize,
}

impl Memory {
    /// Bytes of everything kept.
    pub(super) fn bytes(&self) -> usize {
        let folds = self.checkpoints.iter().chain(&self.newest);
        self.chronicle.bytes() + folds.map(|fold| fold.belief.bytes()).sum::<usize>()
    }

    /// Takes the journal's next entry; the order is settled later.
    pub(super) fn take(&mut self, entry: &Entry) {
        self.chronicle.take(entry);
    }

    /// Updates the order to the entries taken, and drops beliefs that it invalidates; the
    /// number of presses at the start of the order that are unchanged.
    pub(super) fn settle(&mut self) -> usize {
        let stays = self.chronicle.settle();
        self.newest = self.newest.take().filter(|fold| fold.n <= stays);
        self.checkpoints.retain(|fold| fold.n <= stays);
        self.stored = self.stored.min(stays);
        stays
    }

    /// The belief to continue from, taken out; `None` starts from nothing.
    pub(super) fn begin(&mut self) -> Option<Fold> {
        self.newest.take().or_else(|| self.checkpoints.last().cloned())
    }

    /// Keeps the newest belief.
    pub(super) fn keep(&mut self, newest: Fold) {
        self.newest = Some(newest);
    }

    /// The newest belief.
    pub(super) fn newest(&self) -> Option<&SessionBelief> {
        self.newest.as_ref().map(|fold| &fold.belief)
    }

    /// The newest belief, if it includes `more` readings more than the stored one; it counts
    /// as stored from now on.
    pub(super) fn unstored(&mut self, more: usize) -> Option<&Fold> {
        let newest = self.newest.as_ref().filter(|fold| fold.n >= self.stored + more)?;
        self.stored = newest.n;
        Some(newest)
    }

    /// Records that a stored belief includes the first `n` readings of the order.
    pub(super) fn is_stored(&mut self, n: usize) {
        self.stored = n;
    }

    /// Keeps a copy of a belief to return to, once in every few readings.
    pub(super) fn note(&mut self, fold: &Fold, method: Method) {
        let is_new = self.checkpoints.last().is_none_or(|last| last.n < fold.n);
        if !fold.n.is_multiple_of(STRIDE) || !is_new || !is_light(method) {
            return;
        }
        self.checkpoints.push(fold.clone());
        if self.checkpoints.len() > CHECKPOINTS_MAX {
            let at: Vec<usize> = self.checkpoints.iter().map(|fold| fold.n).collect();
            self.checkpoints.remove(least_missed(&at));
        }
    }

    /// A copy of the newest belief whose readings agree with `order`.
    pub(super) fn before(&self, order: &[Touch]) -> Option<Fold> {
        let both = order.iter().zip(self.chronicle.order());
        let common = both.take_while(|(then, now)| then == now).count();
        let known = self.checkpoints.iter().chain(&self.newest);
        known.filter(|fold| fold.n <= common).max_by_key(|fold| fold.n).cloned()
    }
}

/// Whether a copy is cheap. The dissertation's filters hold tables of many megabytes.
fn is_light(method: Method) -> bool {
    match method {
        Method::Surface
        | Method::Sva
        | Method::Geometric
        | Method::Appearance
        | Method::AppearanceLiteral => true,
        Method::SvaLiteral | Method::GeometricHistogram | Method::GeometricParticles => false,
    }
}

/// Index of the most dispensable of ascending positions (never the last): the gap that it
/// leaves is the smallest relative to its distance from the end.
fn least_missed(at: &[usize]) -> usize {
    let end = at.last().copied().unwrap_or(0) + 1;
    let missed = |place: usize| {
        let before = place.checked_sub(1).map_or(0, |before| at[before]);
        let gap = at[place + 1] - before;
        gap as f64 / (end - at[place]) as f64
    };
    let places = 0..at.len().saturating_sub(1);
    places.min_by(|a, b| missed(*a).total_cmp(&missed(*b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_beliefs_lie_at_growing_distances() {
        let mut at: Vec<usize> = Vec::new();
        for n in (STRIDE..=400).step_by(STRIDE) {
            at.push(n);
            if at.len() > CHECKPOINTS_MAX {
                at.remove(least_missed(&at));
            }
            let newest = at.last().copied();
            assert_eq!(newest, Some(n));
        }
        assert_eq!(at.len(), CHECKPOINTS_MAX);
        let ages: Vec<usize> = at.iter().map(|n| 400 - n).collect();
        assert!(ages.windows(2).all(|pair| pair[0] >= 2 * pair[1]), "{ages:?}");
        assert!(ages[2] <= 4 * STRIDE, "one is near: {ages:?}");
    }
}
