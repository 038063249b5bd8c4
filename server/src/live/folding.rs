//! Folding of a session's readings into its belief, on a thread of the compute pool, and the
//! beliefs kept in memory: the newest, and a few earlier ones to return to.
//!
//! The journal holds the readings, the chronicle their folding order. A belief includes the
//! first `n` presses of the order. A late reading or a retraction drops the beliefs that
//! include more than the unchanged part before it; the next fold starts from the newest one
//! left. Earlier beliefs are kept at growing distances, so that returning by `k` readings folds
//! a multiple of `k` again, not all of them. Copies equal their originals, so the start of a
//! fold changes no bit.

use std::sync::Arc;

use palpate_core::belief::answer::Answer;
use palpate_dissertation::geometric::GeometricError;
use palpate_schemas::Method;
use palpate_store::database::Database;
use palpate_store::entity::Session;

use super::LiveError;
use super::belief::{BeliefError, SessionBelief};
use super::checkpoints::{Checkpoint, Checkpoints};
use super::clocks::Clocks;
use super::order::{Chronicle, Touch, begins_with, stored_order};
use super::readings::{ENTRIES_PER_READ, Readings, Ready};
use super::status::status;
use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::ComputeError;
use crate::hints::SetBack;
use crate::model::Model;

/// Number of folded readings after which a belief is stored, or stored again.
const READINGS_PER_CHECKPOINT: usize = 16;
/// Maximum number of earlier beliefs kept.
const CHECKPOINTS_MAX: usize = 4;
/// Minimum number of readings between two kept beliefs.
const STRIDE: usize = 4;

/// Everything that folding needs on a thread of the pool.
pub(super) struct Folding {
    pub(super) session: Session,
    pub(super) model: Arc<Model>,
    pub(super) readings: Readings,
    pub(super) method: Method,
    pub(super) checkpoints: Arc<Checkpoints>,
    pub(super) store: Database,
    pub(super) asker: Asker,
    /// Whether beliefs are stored on the way; those of a replay are past.
    pub(super) is_kept: bool,
}

/// A belief, the number of presses it includes, and the clocks of their robots.
#[derive(Clone)]
pub(super) struct Fold {
    pub(super) belief: SessionBelief,
    pub(super) n: usize,
    pub(super) clocks: Clocks,
}

/// An answer of a belief, and what its readings' stamps contradict.
pub(crate) struct Answered {
    pub(crate) answer: Answer,
    pub(super) set_back: Option<SetBack>,
}

impl Fold {
    /// The answer with at most `poses` poses.
    pub(super) fn answer(&self, poses: usize) -> Answered {
        let set_back = self.clocks.set_back().cloned();
        Answered { answer: self.belief.answer(poses), set_back }
    }
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
    fn begin(&mut self) -> Option<Fold> {
        self.newest.take().or_else(|| self.checkpoints.last().cloned())
    }

    /// The newest belief, if it includes `more` readings more than the stored one; it counts
    /// as stored from now on.
    fn unstored(&mut self, more: usize) -> Option<&Fold> {
        let newest = self.newest.as_ref().filter(|fold| fold.n >= self.stored + more)?;
        self.stored = newest.n;
        Some(newest)
    }

    /// Keeps a copy of a belief to return to, once in every few readings.
    fn note(&mut self, fold: &Fold, method: Method) {
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

    /// The order of a revision's presses, and a copy of the newest belief on the way to it;
    /// `None` when the revision is not in memory.
    pub(super) fn start(&self, revision: u64) -> Option<Start> {
        let length = revision as usize;
        if self.chronicle.len() < length {
            return None;
        }
        let order = self.chronicle.order_at(length);
        let both = order.iter().zip(self.chronicle.order());
        let common = both.take_while(|(then, now)| then == now).count();
        let known = self.checkpoints.iter().chain(&self.newest);
        let begin = known.filter(|fold| fold.n <= common).max_by_key(|fold| fold.n).cloned();
        Some((order, begin))
    }
}

impl Folding {
    /// Updates the memory to the journal's first `length` entries.
    pub(super) fn bring<'memory>(
        &self,
        memory: &'memory mut Memory,
        length: usize,
    ) -> Result<&'memory Fold, LiveError> {
        self.readings.tell(&mut memory.chronicle, length)?;
        memory.settle();
        let order = memory.chronicle.order().to_vec();
        let mut fold = match memory.begin() {
            Some(fold) => fold,
            None => match self.resumed(&order)? {
                Some(fold) => {
                    memory.stored = fold.n;
                    fold
                }
                None => self.nothing()?,
            },
        };
        let folded = self.fold_on(&mut fold, &order, |fold| memory.note(fold, self.method));
        if matches!(folded, Ok(()) | Err(LiveError::Cause(Cause::Compute(ComputeError::Stopped)))) {
            // The next fold continues from its end.
            memory.newest = Some(fold);
        }
        folded?;
        if self.is_kept {
            self.store(memory, READINGS_PER_CHECKPOINT);
        }
        Ok(memory.newest.as_ref().ok_or_else(|| self.readings.gone())?)
    }

    /// Stores the newest belief of an open session if it includes `more` readings more than the
    /// stored one.
    pub(super) fn store(&self, memory: &mut Memory, more: usize) {
        let order = memory.chronicle.order().to_vec();
        let Some(fold) = memory.unstored(more) else { return };
        let Some(conclusions) = fold.belief.conclusions() else { return };
        let Session { id, catalogue, version, .. } = self.session;
        let order = stored_order(&order[..fold.n]);
        if self.is_open() {
            self.checkpoints.keep(id, &Checkpoint { catalogue, version, order, conclusions });
            // The end of a session removes its checkpoint, perhaps before this one was stored.
            if !self.is_open() {
                self.checkpoints.remove(id);
            }
        }
    }

    fn is_open(&self) -> bool {
        let found = self.store.sessions().find(self.session.id).ok().flatten();
        let running = self.store.running(now_ms());
        let status = found.and_then(|session| status(&self.store, &session, &running).ok());
        status.is_some_and(|status| status.end.is_none())
    }

    /// The stored belief, if its readings are the first of `order`.
    fn resumed(&self, order: &[Touch]) -> Result<Option<Fold>, LiveError> {
        let Some(checkpoint) = self.checkpoints.find(self.session.id) else { return Ok(None) };
        let Checkpoint { catalogue, version, order: rests_on, conclusions } = checkpoint;
        let is_ours = (catalogue, version) == (self.session.catalogue, self.session.version);
        let Some(n) = begins_with(order, &rests_on).filter(|_| is_ours) else { return Ok(None) };
        let mut fold = self.nothing()?;
        for touches in order[..n].chunks(ENTRIES_PER_READ) {
            for ready in &self.readings.ready(touches)? {
                let Ready { stored, reading, sensor, id, .. } = &**ready;
                fold.clocks.take(stored.stamp_ns, id.as_ref());
                if !fold.belief.retrace(stored, reading, &sensor.description) {
                    return Ok(None);
                }
                fold.n += 1;
            }
        }
        if !fold.belief.resume(&conclusions) {
            return Ok(None);
        }
        metrics::counter!("palpate_beliefs_resumed_total").increment(1);
        Ok(Some(fold))
    }

    /// The belief after the journal's first `length` entries, folded from `start` if given,
    /// else from nothing.
    pub(super) fn past(&self, length: usize, start: Option<Start>) -> Result<Fold, LiveError> {
        let (order, begin) = match start {
            Some(start) => start,
            None => (self.chronicle(length)?.order().to_vec(), None),
        };
        let mut fold = begin.map_or_else(|| self.nothing(), Ok)?;
        self.fold_on(&mut fold, &order, |_| {})?;
        Ok(fold)
    }

    /// The chronicle of the journal's first `length` entries.
    pub(super) fn chronicle(&self, length: usize) -> Result<Chronicle, LiveError> {
        let mut chronicle = Chronicle::default();
        self.readings.tell(&mut chronicle, length)?;
        chronicle.settle();
        if chronicle.len() < length { Err(self.readings.gone().into()) } else { Ok(chronicle) }
    }

    /// The belief before any reading.
    pub(super) fn nothing(&self) -> Result<Fold, LiveError> {
        let mut belief =
            SessionBelief::new(&self.session, &self.model).map_err(|error| match error {
                BeliefError::Geometric(GeometricError::TablesFull { needed, in_use, max }) => {
                    LiveError::BeliefsFull { bytes: in_use.saturating_add(needed), max }
                }
                error => self.unusable(&error).into(),
            })?;
        belief.heed(self.asker.overdue());
        Ok(Fold { belief, n: 0, clocks: Clocks::default() })
    }

    /// Folds the missing presses of `order`; `each` receives the belief after each.
    fn fold_on(
        &self,
        fold: &mut Fold,
        order: &[Touch],
        mut each: impl FnMut(&Fold),
    ) -> Result<(), LiveError> {
        fold.belief.heed(self.asker.overdue());
        while fold.n < order.len() {
            let next = &order[fold.n..order.len().min(fold.n + ENTRIES_PER_READ)];
            for ready in &self.readings.ready(next)? {
                self.add(&mut fold.belief, ready)?;
                fold.clocks.take(ready.stored.stamp_ns, ready.id.as_ref());
                fold.n += 1;
                each(fold);
            }
            metrics::counter!("palpate_readings_folded_total").increment(next.len() as u64);
        }
        Ok(())
    }

    /// Adds a reading to a belief.
    pub(super) fn add(&self, belief: &mut SessionBelief, ready: &Ready) -> Result<(), LiveError> {
        if self.asker.is_gone() {
            return Err(ComputeError::Stopped.into());
        }
        self.asker.overdue().check();
        let Ready { stored, reading, sensor, .. } = ready;
        let added = belief.add(stored, reading, &sensor.description);
        Ok(added.map_err(|error| self.unusable(&error))?)
    }

    fn unusable(&self, error: &dyn std::error::Error) -> Cause {
        let id = self.session.id.to_string();
        Cause::Unusable { what: "session", id, reason: error.to_string() }
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
