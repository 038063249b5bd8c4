//! The history of a session: its belief at an earlier revision, the replay of all of them, and
//! the contribution of each reading.
//!
//! Earlier beliefs never change, so they need no turn at the session.
//!
//! A replay folds readings that came in time once; a late one folds the readings after it
//! again, from the nearest kept belief. An explanation is leave-one-out with the session's own
//! method: the readings are folded without each in turn, from the belief of those before it.
//! That takes n²/2 folds for n readings, so n is limited. Both end at a time limit; the answer of
//! a replay says where to continue.

use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_core::belief::answer::Answer;
use palpate_recogniser::belief::Misfit;
use palpate_schemas as wire;
use palpate_store::journal::Entry;

use super::belief::SessionBelief;
use super::folding::{Answered, Folding, Memory, Start};
use super::readings::Ready;
use super::{Live, LiveError};
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::Place;
use crate::wire::count;
use crate::wire::history::{self, Without};

/// Time limit of the steps of one replay. Chosen: a page is answered within ten seconds even
/// for two concurrent requests whose readings take seconds each; `next_after` continues.
const REPLAY_TIME_MAX: Duration = Duration::from_secs(2);
/// Time limit of one explanation.
const EXPLAIN_TIME_MAX: Duration = Duration::from_secs(60);
/// Maximum number of readings of an explained belief.
const EXPLAINED_READINGS_MAX: usize = 200;

/// A request for a replay.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReplayQuestion {
    /// The last revision; the newest when not given.
    pub(crate) upto: Option<u64>,
    /// The revision after which the steps begin.
    pub(crate) after: u64,
    /// Maximum number of steps.
    pub(crate) limit: u64,
    /// Maximum number of poses of a belief.
    pub(crate) poses: usize,
}

/// A replay in progress.
struct Walk {
    folding: Folding,
    memory: Memory,
    last: usize,
    steps: Vec<wire::ReplayStep>,
}

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
    /// How each reading lies on the likeliest object.
    misfits: Vec<Option<Misfit>>,
    /// The known beliefs without each reading.
    known: Vec<Without>,
}

impl Live {
    /// The belief after the first `at` entries of the session's journal.
    pub(crate) async fn belief_at(&self, poses: usize, at: u64) -> Result<wire::Belief, LiveError> {
        self.revision("?at", Some(at))?;
        let place = self.tools.pool.place()?;
        // Does not wait for a fold in progress.
        let start = self.turns.try_take().and_then(|state| state.memory.start(at));
        self.past(place, at, poses, start).await
    }

    /// The steps after `after` up to `upto`, and the belief after the last of them.
    pub(crate) async fn replay(&self, question: ReplayQuestion) -> Result<wire::Replay, LiveError> {
        let begun = Instant::now();
        let upto = self.revision("?upto", question.upto)?;
        if question.after > upto {
            let detail = format!("came {}, expected at most `upto`, {upto}", question.after);
            return Err(Cause::field("?after", detail).into());
        }
        let last = upto.min(question.after + question.limit);
        let mut walk = Walk {
            folding: Folding { is_kept: false, ..self.folding(Vec::new()) },
            memory: Memory::default(),
            last: last as usize,
            steps: Vec::new(),
        };
        let after = question.after as usize;
        let work = move || {
            let mut is_over = false;
            while !is_over && (walk.steps.is_empty() || begun.elapsed() < REPLAY_TIME_MAX) {
                is_over = walk.go_on(after, begun)?;
            }
            Ok::<_, LiveError>((walk.answer(question.poses)?, walk.steps))
        };
        let (answer, steps) = self.tools.pool.place()?.run_long(work).await??;
        let reached = question.after + steps.len() as u64;
        let belief = self.shown(reached, &answer);
        Ok(wire::Replay {
            session: self.session.id,
            upto: count(upto),
            steps,
            next_after: (reached < upto).then(|| count(reached)),
            belief,
        })
    }

    /// The contribution of each reading to the belief of a revision, the newest if none is named.
    pub(crate) async fn explain(&self, at: Option<u64>) -> Result<wire::Explanation, LiveError> {
        let begun = Instant::now();
        let revision = self.revision("?at", at)?;
        let folding = self.folding(Vec::new());
        let work = move || {
            let mut comparison = Comparison::begin(folding, revision as usize)?;
            while !comparison.is_complete() && begun.elapsed() < EXPLAIN_TIME_MAX {
                comparison.go_on()?;
            }
            Ok::<_, LiveError>(comparison)
        };
        let comparison = self.tools.pool.place()?.run_long(work).await??;
        let Comparison { readings, whole, known, misfits, .. } = comparison;
        let explained = readings.iter().zip(misfits).map(|(ready, misfit)| history::Explained {
            number: ready.number,
            id: ready.id.clone(),
            misfit,
        });
        let explained = explained.collect();
        Ok(history::explanation(&self.session, revision, explained, &whole, &known, &self.model))
    }

    /// The revision asked for, or else the newest. Refuses a future one.
    pub(crate) fn revision(&self, field: &str, asked: Option<u64>) -> Result<u64, LiveError> {
        let newest = self.status(now_ms())?.length;
        let revision = asked.unwrap_or(newest);
        if revision <= newest {
            return Ok(revision);
        }
        let detail = format!("came {revision}, but the session's revision is {newest}");
        Err(Cause::field(field, detail).into())
    }

    /// The belief of a revision, folded from `start`, or else from nothing.
    pub(super) async fn past(
        &self,
        place: Place,
        revision: u64,
        poses: usize,
        start: Option<Start>,
    ) -> Result<wire::Belief, LiveError> {
        let folding = self.folding(Vec::new());
        let work = move || -> Result<Answered, LiveError> {
            Ok(folding.past(revision as usize, start)?.answer(poses))
        };
        let answer = place.run_long(work).await??;
        Ok(self.shown(revision, &answer))
    }
}

impl Walk {
    /// Takes the next entries, until the time limit of a replay that `begun` then; true at the
    /// end.
    fn go_on(&mut self, after: usize, begun: Instant) -> Result<bool, LiveError> {
        if self.memory.chronicle.len() < after {
            self.folding.bring(&mut self.memory, after)?;
        }
        let next = self.memory.chronicle.len();
        let entries = self.folding.readings.entries(next, self.last)?;
        for entry in &entries {
            let step = self.step(entry)?;
            self.steps.push(step);
            if begun.elapsed() >= REPLAY_TIME_MAX {
                break;
            }
        }
        Ok(entries.is_empty() || self.memory.chronicle.len() == self.last)
    }

    /// The answer after the last step.
    fn answer(&mut self, poses: usize) -> Result<Answered, LiveError> {
        let length = self.memory.chronicle.len();
        Ok(self.folding.bring(&mut self.memory, length)?.answer(poses))
    }

    /// Takes one entry.
    fn step(&mut self, entry: &Entry) -> Result<wire::ReplayStep, LiveError> {
        self.memory.chronicle.take(entry, self.folding.readings.pose(entry)?);
        let stays = self.memory.settle();
        let late = stays + 1 < self.memory.chronicle.order().len();
        let length = self.memory.chronicle.len();
        let answer = self.folding.bring(&mut self.memory, length)?.belief.answer(0);
        Ok(history::step(entry, late, &answer, &self.folding.model))
    }
}

impl Comparison {
    /// Folds all readings of a revision, and prepares to leave out the first.
    fn begin(folding: Folding, revision: usize) -> Result<Self, LiveError> {
        let chronicle = folding.chronicle(revision)?;
        let order = chronicle.order();
        if order.len() > EXPLAINED_READINGS_MAX {
            let (session, found) = (folding.session.id, order.len());
            return Err(LiveError::TooManyToExplain {
                session,
                found,
                max: EXPLAINED_READINGS_MAX,
            });
        }
        let readings = folding.readings.ready(order)?;
        let before = folding.nothing()?.belief;
        let mut belief = before.clone();
        for reading in &readings {
            folding.add(&mut belief, reading)?;
        }
        let whole = belief.answer(0);
        let resting = readings.iter().rposition(|ready| ready.object_moved()).unwrap_or(0);
        let nearest = whole.best_object();
        let misfit = |(at, ready): (usize, &Arc<Ready>)| {
            let object = nearest.filter(|_| at >= resting)?;
            belief.misfit(object, &ready.reading, &ready.sensor.description)
        };
        let misfits = readings.iter().enumerate().map(misfit).collect();
        let (without, known) = (None, Vec::new());
        Ok(Self { folding, readings, whole, before, without, resting, misfits, known })
    }

    fn is_complete(&self) -> bool {
        self.known.len() == self.readings.len()
    }

    /// Folds the next reading.
    fn go_on(&mut self) -> Result<(), LiveError> {
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
                let fit = || belief.fit_bits(&reading.reading, &reading.sensor.description);
                let fit_bits = if left_out >= self.resting { fit() } else { None };
                self.known.push(Without { answer: belief.answer(0), fit_bits });
                self.folding.add(&mut self.before, reading)?;
            }
        }
        Ok(())
    }
}
