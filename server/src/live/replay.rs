//! Replay of a session's beliefs, revision by revision.
//!
//! Readings that came in time are folded once; a late one folds the readings after it again,
//! from the nearest kept belief. The work is done in slices, so that other sessions' readings
//! are not delayed, and ends at its time limit: the answer says where to continue.

use std::time::{Duration, Instant};

use palpate_core::belief::answer::Answer;
use palpate_schemas as wire;
use palpate_store::journal::Entry;

use super::error::LiveError;
use super::folding::Folding;
use super::memory::Memory;
use super::{Live, Tools};
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::wire::{count, history};

/// A slice of work on the compute pool.
pub(super) const SLICE: Duration = Duration::from_millis(100);
/// Time limit of the steps of one answer. Chosen: a page is answered within ten seconds even
/// for two concurrent requests whose readings take seconds each; `next_after` continues.
const TIME_MAX: Duration = Duration::from_secs(2);

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

impl Live {
    /// The steps after `after` up to `upto`, and the belief after the last of them.
    pub(crate) async fn replay(
        &self,
        tools: &Tools<'_>,
        question: ReplayQuestion,
    ) -> Result<wire::Replay, LiveError> {
        let begun = Instant::now();
        let newest = self.status(tools.store, now_ms())?.length;
        let upto = question.upto.unwrap_or(newest);
        self.check_revision(tools, "?upto", upto)?;
        if question.after > upto {
            let detail = format!("came {}, expected at most `upto`, {upto}", question.after);
            return Err(Cause::field("?after", detail).into());
        }
        let last = upto.min(question.after + question.limit);
        let mut walk = Walk {
            folding: self.folding(tools, Vec::new()),
            memory: Memory::default(),
            last: last as usize,
            steps: Vec::new(),
        };
        let after = question.after as usize;
        let mut is_over = false;
        while !is_over && (walk.steps.is_empty() || begun.elapsed() < TIME_MAX) {
            let slice = move || {
                let is_over = walk.go_on(after)?;
                Ok::<_, LiveError>((walk, is_over))
            };
            (walk, is_over) = tools.pool.place()?.run_long(slice).await??;
        }
        let reached = question.after + walk.steps.len() as u64;
        let last = move || walk.answer(question.poses).map(|answer| (answer, walk.steps));
        let (answer, steps) = tools.pool.place()?.run_long(last).await??;
        let belief = self.shown(reached, &answer);
        Ok(wire::Replay {
            session: self.session.id,
            upto: count(upto),
            steps,
            next_after: (reached < upto).then(|| count(reached)),
            belief,
        })
    }
}

impl Walk {
    /// Works for a slice of time; true at the end.
    fn go_on(&mut self, after: usize) -> Result<bool, LiveError> {
        let begun = Instant::now();
        if self.memory.chronicle.len() < after {
            self.folding.bring(&mut self.memory, after)?;
        }
        let next = self.memory.chronicle.len();
        let entries = self.folding.readings.entries(next, self.last)?;
        for entry in &entries {
            let step = self.step(entry)?;
            self.steps.push(step);
            if begun.elapsed() >= SLICE {
                break;
            }
        }
        Ok(entries.is_empty() || self.memory.chronicle.len() == self.last)
    }

    /// The answer after the last step.
    fn answer(&mut self, poses: usize) -> Result<Answer, LiveError> {
        let length = self.memory.chronicle.len();
        Ok(self.folding.bring(&mut self.memory, length)?.answer(poses))
    }

    /// Takes one entry.
    fn step(&mut self, entry: &Entry) -> Result<wire::ReplayStep, LiveError> {
        self.memory.take(entry);
        let stays = self.memory.settle();
        let late = stays + 1 < self.memory.chronicle.order().len();
        let length = self.memory.chronicle.len();
        let answer = self.folding.bring(&mut self.memory, length)?.answer(0);
        Ok(history::step(entry, late, &answer, &self.folding.model))
    }
}
