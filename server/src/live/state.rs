//! Memory of a session: its belief, and answers for repeated requests.

use std::collections::VecDeque;

use palpate_schemas as wire;

use super::memory::Memory;

/// Number of answers remembered for repeated readings.
const ANSWERS_MAX: usize = 64;

#[derive(Default)]
pub(super) struct State {
    pub(super) memory: Memory,
    /// Beliefs that were answered to readings, by their revisions, newest last.
    answers: VecDeque<wire::Belief>,
}

impl State {
    pub(super) fn bytes(&self) -> usize {
        self.memory.bytes() + self.answers.iter().map(belief_bytes).sum::<usize>()
    }

    pub(super) fn remembered(&self, revision: u64) -> Option<wire::Belief> {
        let answers = self.answers.iter().rev();
        answers.into_iter().find(|belief| u64::from(belief.revision) == revision).cloned()
    }

    pub(super) fn remember(&mut self, belief: &wire::Belief) {
        if self.answers.len() == ANSWERS_MAX {
            self.answers.pop_front();
        }
        self.answers.push_back(belief.clone());
    }
}

/// Approximate memory of a remembered answer.
fn belief_bytes(belief: &wire::Belief) -> usize {
    let objects = belief.objects.iter().map(|object| size_of_val(object) + object.name.len());
    let poses = belief.poses.iter().map(|pose| size_of_val(pose) + pose.name.len() + 36 * 8);
    size_of::<wire::Belief>() + objects.sum::<usize>() + poses.sum::<usize>()
}
