//! Folding of a session's readings into its belief, on a thread of the compute pool.
//!
//! The journal holds the readings, the chronicle their folding order.

use std::sync::Arc;

use palpate_dissertation::geometric::GeometricError;
use palpate_schemas::Method;
use palpate_store::entity::Session;

use super::belief::{BeliefError, SessionBelief};
use super::checkpoints::{Checkpoint, Checkpoints};
use super::error::LiveError;
use super::memory::{Fold, Memory, Start};
use super::order::{Chronicle, Touch, begins_with, stored_order};
use super::readings::{ENTRIES_PER_READ, Readings, Ready};
use crate::asker::Asker;
use crate::cause::Cause;
use crate::compute::ComputeError;
use crate::model::Model;

/// Everything that folding needs on a thread of the pool.
pub(crate) struct Folding {
    pub(super) session: Session,
    pub(super) model: Arc<Model>,
    pub(super) readings: Readings,
    pub(super) method: Method,
    pub(super) checkpoints: Arc<Checkpoints>,
    pub(super) asker: Asker,
}

/// Number of folded readings after which a belief is stored, or stored again.
const READINGS_PER_CHECKPOINT: usize = 16;

impl Folding {
    /// Updates the memory to the journal's first `length` entries.
    pub(super) fn bring<'memory>(
        &self,
        memory: &'memory mut Memory,
        length: usize,
    ) -> Result<&'memory SessionBelief, LiveError> {
        self.readings.tell(&mut memory.chronicle, length)?;
        memory.settle();
        let order = memory.chronicle.order().to_vec();
        let mut fold = match memory.begin() {
            Some(fold) => fold,
            None => match self.resumed(&order)? {
                Some(fold) => {
                    memory.is_stored(fold.n);
                    fold
                }
                None => self.nothing()?,
            },
        };
        let folded = self.fold_on(&mut fold, &order, |fold| memory.note(fold, self.method));
        if matches!(folded, Ok(()) | Err(LiveError::Cause(Cause::Compute(ComputeError::Stopped)))) {
            // The next fold continues from its end.
            memory.keep(fold);
        }
        folded?;
        self.store(memory, READINGS_PER_CHECKPOINT);
        Ok(memory.newest().ok_or_else(|| self.readings.gone())?)
    }

    /// Stores the newest belief if it includes `more` readings more than the stored one.
    pub(super) fn store(&self, memory: &mut Memory, more: usize) {
        let order = memory.chronicle.order().to_vec();
        let Some(fold) = memory.unstored(more) else { return };
        let Some(conclusions) = fold.belief.conclusions() else { return };
        let Session { id, catalogue, version, .. } = self.session;
        let order = stored_order(&order[..fold.n]);
        self.checkpoints.keep(id, &Checkpoint { catalogue, version, order, conclusions });
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
                let Ready { stored, reading, sensor, .. } = &**ready;
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
    /// else from nothing. `None` when the journal has fewer entries.
    pub(super) fn past(
        &self,
        length: usize,
        start: Option<Start>,
    ) -> Result<SessionBelief, LiveError> {
        let (order, begin) = match start {
            Some(start) => start,
            None => (self.chronicle(length)?.order().to_vec(), None),
        };
        let mut fold = match begin {
            Some(fold) => fold,
            None => self.nothing()?,
        };
        self.fold_on(&mut fold, &order, |_| {})?;
        Ok(fold.belief)
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
        Ok(Fold { belief, n: 0 })
    }

    /// Folds the missing presses of `order`; `each` receives the belief after each.
    pub(super) fn fold_on(
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
        let Ready { stored, reading, sensor, .. } = ready;
        let added = belief.add(stored, reading, &sensor.description);
        Ok(added.map_err(|error| self.unusable(&error))?)
    }

    /// log₂ ratio of a reading's density in a belief to that of a touch anywhere.
    pub(super) fn fit_bits(belief: &SessionBelief, ready: &Ready) -> Option<f64> {
        belief.fit_bits(&ready.reading, &ready.sensor.description)
    }

    fn unusable(&self, error: &dyn std::error::Error) -> Cause {
        let id = self.session.id.to_string();
        Cause::Unusable { what: "session", id, reason: error.to_string() }
    }
}
