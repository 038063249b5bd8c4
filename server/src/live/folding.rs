//! Folding a session's readings into its belief, on a thread of the compute pool.
//!
//! The journal says which readings there are, the chronicle in which order they are folded.

use std::collections::BTreeMap;
use std::sync::Arc;

use palpate_core::reading::Reading;
use palpate_dissertation::geometric::GeometricError;
use palpate_store::entity::{ReadingId, Sensor, Session, StoredReading};
use palpate_store::journal::{Entry, Event, Journal};

use super::memory::{Fold, Memory, Start};
use super::order::{Chronicle, Touch, begins_with, stored_order};
use crate::asker::Asker;
use crate::belief::{BeliefError, SessionBelief};
use crate::catalogues::Model;
use crate::checkpoints::{Checkpoint, Checkpoints};
use crate::compute::ComputeError;
use crate::refusal::Refusal;
use crate::sensors::Sensors;
use crate::wire::reading::from_store;
use crate::wire::session::{Options, base};

/// How many entries of a journal are read at once.
const ENTRIES_PER_READ: usize = 256;

/// Everything that folding needs, on a thread of the pool.
pub(crate) struct Folding {
    pub(super) session: Session,
    pub(super) model: Arc<Model>,
    pub(super) journal: Journal,
    pub(super) sensors: Arc<Sensors>,
    pub(super) options: Options,
    pub(super) checkpoints: Arc<Checkpoints>,
    pub(super) asker: Asker,
}

/// So many readings are folded before their belief is stored, or stored again.
const READINGS_PER_CHECKPOINT: usize = 16;

/// A reading that is ready to be folded.
pub(super) struct Ready {
    pub(super) number: u32,
    pub(super) id: Option<ReadingId>,
    stored: StoredReading,
    reading: Reading,
    sensor: Arc<Sensor>,
}

impl Ready {
    /// Whether the object may have moved before it.
    pub(super) fn object_moved(&self) -> bool {
        self.stored.object_moved.is_some()
    }
}

impl Folding {
    /// Brings what is in memory up to the journal's first `length` entries.
    pub(super) fn bring<'memory>(
        &self,
        memory: &'memory mut Memory,
        length: usize,
    ) -> Result<&'memory SessionBelief, Refusal> {
        self.read(length, memory.chronicle.len(), |entry| {
            memory.take(entry);
        })?;
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
        let folded = self.fold_on(&mut fold, &order, |fold| memory.note(fold, self.options.method));
        if matches!(folded, Ok(()) | Err(Refusal::Compute(ComputeError::Stopped))) {
            // Where it ended the next one goes on.
            memory.keep(fold);
        }
        folded?;
        self.store(memory, READINGS_PER_CHECKPOINT);
        memory.newest().ok_or_else(|| self.gone())
    }

    /// Stores the newest belief if it rests on `more` readings more than the one that is stored.
    pub(super) fn store(&self, memory: &mut Memory, more: usize) {
        let order = memory.chronicle.order().to_vec();
        let Some(fold) = memory.unstored(more) else { return };
        let Some(conclusions) = fold.belief.conclusions() else { return };
        let Session { id, catalogue, version, .. } = self.session;
        let order = stored_order(&order[..fold.n]);
        self.checkpoints.keep(id, &Checkpoint { catalogue, version, order, conclusions });
    }

    /// The belief that is stored, if it rests on what `order` begins with.
    fn resumed(&self, order: &[Touch]) -> Result<Option<Fold>, Refusal> {
        let Some(checkpoint) = self.checkpoints.find(self.session.id) else { return Ok(None) };
        let Checkpoint { catalogue, version, order: rests_on, conclusions } = checkpoint;
        let is_ours = (catalogue, version) == (self.session.catalogue, self.session.version);
        let Some(n) = begins_with(order, &rests_on).filter(|_| is_ours) else { return Ok(None) };
        let mut fold = self.nothing()?;
        for touches in order[..n].chunks(ENTRIES_PER_READ) {
            for Ready { stored, reading, sensor, .. } in &self.ready(touches)? {
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

    /// The belief after the journal's first `length` entries, folded anew; from `start`, when
    /// that is known to be on the way. `None` when the journal has fewer entries.
    pub(super) fn past(
        &self,
        length: usize,
        start: Option<Start>,
    ) -> Result<SessionBelief, Refusal> {
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

    /// What the journal's first `length` entries say.
    pub(super) fn chronicle(&self, length: usize) -> Result<Chronicle, Refusal> {
        let mut chronicle = Chronicle::default();
        self.read(length, 0, |entry| {
            chronicle.take(entry);
        })?;
        chronicle.settle();
        if chronicle.len() < length { Err(self.gone()) } else { Ok(chronicle) }
    }

    /// The belief before any reading.
    pub(super) fn nothing(&self) -> Result<Fold, Refusal> {
        let mut belief =
            SessionBelief::new(&self.session, &self.model).map_err(|error| match error {
                BeliefError::Geometric(GeometricError::TablesFull { needed, in_use, max }) => {
                    Refusal::BeliefsFull { bytes: in_use.saturating_add(needed), max }
                }
                error => self.unusable(&error),
            })?;
        belief.heed(self.asker.overdue());
        Ok(Fold { belief, n: 0 })
    }

    /// Folds the presses of `order` that are missing; `each` sees the belief after each.
    pub(super) fn fold_on(
        &self,
        fold: &mut Fold,
        order: &[Touch],
        mut each: impl FnMut(&Fold),
    ) -> Result<(), Refusal> {
        fold.belief.heed(self.asker.overdue());
        while fold.n < order.len() {
            let next = &order[fold.n..order.len().min(fold.n + ENTRIES_PER_READ)];
            for ready in &self.ready(next)? {
                self.add(&mut fold.belief, ready)?;
                fold.n += 1;
                each(fold);
            }
            metrics::counter!("palpate_readings_folded_total").increment(next.len() as u64);
        }
        Ok(())
    }

    /// The readings of presses, ready to be folded. A motion that the first frame of a press
    /// announced goes with the frame that counts.
    pub(super) fn ready(&self, touches: &[Touch]) -> Result<Vec<Ready>, Refusal> {
        let numbers =
            touches.iter().flat_map(|touch| touch.moved_by.into_iter().chain([touch.number]));
        let mut ready = self.numbered(numbers.collect())?;
        let mut in_order = Vec::with_capacity(touches.len());
        for touch in touches {
            let first = touch.moved_by.map(|first| ready.remove(&first).ok_or_else(|| self.gone()));
            let mut counts = ready.remove(&touch.number).ok_or_else(|| self.gone())?;
            if let Some(first) = first.transpose()? {
                counts.stored.object_moved = first.stored.object_moved;
            }
            in_order.push(counts);
        }
        Ok(in_order)
    }

    /// Readings by their numbers.
    fn numbered(&self, mut sorted: Vec<u32>) -> Result<BTreeMap<u32, Ready>, Refusal> {
        sorted.sort_unstable();
        let mut ready = BTreeMap::new();
        for run in sorted.chunk_by(|a, b| a + 1 == *b) {
            for entry in self.journal.entries(self.session.id, u64::from(run[0]), run.len())? {
                if let Some(one) = self.one(&entry)? {
                    ready.insert(one.number, one);
                }
            }
        }
        Ok(ready)
    }

    /// Takes a reading into account.
    pub(super) fn add(&self, belief: &mut SessionBelief, ready: &Ready) -> Result<(), Refusal> {
        if self.asker.is_gone() {
            return Err(ComputeError::Stopped.into());
        }
        let Ready { stored, reading, sensor, .. } = ready;
        belief.add(stored, reading, &sensor.description).map_err(|error| self.unusable(&error))
    }

    /// By how many bits a belief expects a reading more than a touch anywhere.
    pub(super) fn fit_bits(belief: &SessionBelief, ready: &Ready) -> Option<f64> {
        belief.fit_bits(&ready.reading, &ready.sensor.description)
    }

    fn one(&self, entry: &Entry) -> Result<Option<Ready>, Refusal> {
        let Event::Reading(stored) = &entry.event else { return Ok(None) };
        let robot = entry.reading_id.as_ref().map(|id| id.robot.as_str());
        let sensor = self.sensors.get(&stored.sensor.to_string())?;
        let calibration = self.sensors.calibrations().of(sensor.id, stored.calibration)?;
        let reading = from_store(stored, &sensor, calibration.as_deref())
            .map_err(|error| self.unusable(&error))?;
        let reading = match base(&self.options, robot) {
            Some(base) => reading.with_base(base),
            None => reading,
        };
        let (number, id) = (entry.seq as u32, entry.reading_id.clone());
        Ok(Some(Ready { number, id, stored: stored.clone(), reading, sensor }))
    }

    /// Some of the journal's entries from `next` on, before `last`.
    pub(super) fn entries(&self, next: usize, last: usize) -> Result<Vec<Entry>, Refusal> {
        let limit = ENTRIES_PER_READ.min(last.saturating_sub(next));
        Ok(self.journal.entries(self.session.id, next as u64, limit)?)
    }

    /// Reads the journal's entries from `next` up to `length`.
    fn read(
        &self,
        length: usize,
        next: usize,
        mut each: impl FnMut(&Entry),
    ) -> Result<(), Refusal> {
        let mut next = next;
        while next < length {
            let entries = self.entries(next, length)?;
            if entries.is_empty() {
                return Ok(());
            }
            entries.iter().for_each(&mut each);
            next += entries.len();
        }
        Ok(())
    }

    /// A reading that was there: the session was deleted.
    fn gone(&self) -> Refusal {
        Refusal::NotFound { what: "session", reference: self.session.id.to_string() }
    }

    fn unusable(&self, error: &dyn std::error::Error) -> Refusal {
        let id = self.session.id.to_string();
        Refusal::Unusable { what: "session", id, reason: error.to_string() }
    }
}
