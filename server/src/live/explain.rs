//! Contribution of each reading to a belief, by comparison with the belief of all others.
//!
//! Leave-one-out with the session's own method: the readings are folded without each in turn,
//! from the belief of those before it. That takes n²/2 folds for n readings, so n is limited,
//! the work is done in slices and ends at its time limit.

use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_core::belief::answer::Answer;
use palpate_schemas as wire;

use super::error::LiveError;
use super::folding::Folding;
use super::readings::Ready;
use super::replay::SLICE;
use super::{Live, Tools};
use crate::clock::now_ms;
use crate::live::belief::SessionBelief;
use crate::wire::history::{self, Without};

/// Maximum number of readings of an explained belief.
const READINGS_MAX: usize = 200;
/// Time limit of one answer.
const TIME_MAX: Duration = Duration::from_secs(60);

/// A comparison in progress.
struct Comparison {
    folding: Folding,
    /// In folding order.
    readings: Vec<Arc<Ready>>,
    /// The belief of all readings.
    whole: Answer,
    /// The belief of the readings before the one left out.
    before: SessionBelief,
    /// The belief without that reading, and the number of readings it has folded or left out.
    without: Option<(SessionBelief, usize)>,
    /// Index of the first reading from which the object rests at its believed pose.
    resting: usize,
    /// The known beliefs without each reading.
    known: Vec<Without>,
}

impl Live {
    /// The contribution of each reading to the belief of a revision, the newest if none is named.
    pub(crate) async fn explain(
        &self,
        tools: &Tools<'_>,
        at: Option<u64>,
    ) -> Result<wire::Explanation, LiveError> {
        let begun = Instant::now();
        let newest = self.status(tools.store, now_ms())?.length;
        let revision = at.unwrap_or(newest);
        self.check_revision(tools, "?at", revision)?;
        let folding = self.folding(tools, Vec::new());
        let begin = move || Comparison::begin(folding, revision as usize);
        let mut comparison = tools.pool.place()?.run_long(begin).await??;
        while !comparison.is_complete() && begun.elapsed() < TIME_MAX {
            let slice = move || {
                comparison.go_on()?;
                Ok::<_, LiveError>(comparison)
            };
            comparison = tools.pool.place()?.run_long(slice).await??;
        }
        let Comparison { readings, whole, known, .. } = comparison;
        let ids = readings.iter().map(|ready| (ready.number, ready.id.clone())).collect();
        Ok(history::explanation(&self.session, revision, ids, &whole, &known, &self.model))
    }
}

impl Comparison {
    /// Folds all readings of a revision, and prepares to leave out the first.
    fn begin(folding: Folding, revision: usize) -> Result<Self, LiveError> {
        let chronicle = folding.chronicle(revision)?;
        let order = chronicle.order();
        if order.len() > READINGS_MAX {
            let (session, found) = (folding.session.id, order.len());
            return Err(LiveError::TooManyToExplain { session, found, max: READINGS_MAX });
        }
        let readings = folding.readings.ready(order)?;
        let before = folding.nothing()?.belief;
        let mut belief = before.clone();
        for reading in &readings {
            folding.add(&mut belief, reading)?;
        }
        let whole = belief.answer(0);
        let resting = readings.iter().rposition(|ready| ready.object_moved()).unwrap_or(0);
        Ok(Self { folding, readings, whole, before, without: None, resting, known: Vec::new() })
    }

    fn is_complete(&self) -> bool {
        self.known.len() == self.readings.len()
    }

    /// Works for a slice of time.
    fn go_on(&mut self) -> Result<(), LiveError> {
        let begun = Instant::now();
        while !self.is_complete() && begun.elapsed() < SLICE {
            let left_out = self.known.len();
            let (mut belief, next) =
                self.without.take().unwrap_or_else(|| (self.before.clone(), left_out + 1));
            match self.readings.get(next) {
                Some(reading) => {
                    self.folding.add(&mut belief, reading)?;
                    self.without = Some((belief, next + 1));
                }
                None => {
                    let reading = &self.readings[left_out];
                    let fit = || Folding::fit_bits(&belief, reading);
                    let fit_bits = if left_out >= self.resting { fit() } else { None };
                    self.known.push(Without { answer: belief.answer(0), fit_bits });
                    self.folding.add(&mut self.before, reading)?;
                }
            }
        }
        Ok(())
    }
}
