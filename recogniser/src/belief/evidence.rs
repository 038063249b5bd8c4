//! The evidence of a session: all that its presses say of a pose, and poses settled on it.

use std::sync::Arc;

use super::SurfaceOptions;
use super::carried::Carried;
use super::hypothesis::Hypothesis;
use super::pattern::Pattern;
use super::propose::Proposal;
use super::refine::refine;
use super::score::Kernel;
use super::sighting::Sighting;
use super::turned::Turned;
use crate::surface::SurfaceMap;
use palpate_core::stop::Stop;

/// A refined pose may score this much (ln) less: scores prefer poses on which touches lie on
/// mapped touches instead of between them.
const WORSE_MAX: f32 = 3.0;

/// What scores poses: the touches, and what all presses say of free and occupied space.
#[derive(Clone, Copy)]
pub(super) struct Evidence<'a> {
    pub(super) maps: &'a [Arc<SurfaceMap>],
    pub(super) kernel: &'a Kernel,
    pub(super) touches: &'a [Sighting],
    pub(super) patterns: &'a [Pattern],
    pub(super) options: &'a SurfaceOptions,
    /// What loops over objects heed.
    pub(super) stop: &'a Stop,
}

/// An object that poses are scored of: its map, and where it was before it moved.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    pub(super) map: &'a SurfaceMap,
    pub(super) carried: &'a Carried,
}

impl Evidence<'_> {
    /// The score of a pose (ln) of an object; `None` once it cannot reach `bar`.
    #[inline]
    pub(super) fn score(&self, object: Known<'_>, pose: &Turned, bar: f32) -> Option<f32> {
        self.score_in_turn(object, pose, self.touches.iter().rev(), bar)
    }

    /// The same by all `touches` in their turn: the sooner come those that are likely to
    /// contradict the pose, the sooner it is given up.
    #[inline]
    pub(super) fn score_in_turn<'a>(
        &self,
        object: Known<'_>,
        pose: &Turned,
        touches: impl ExactSizeIterator<Item = &'a Sighting>,
        bar: f32,
    ) -> Option<f32> {
        let map = object.map;
        let mut sum = self.kernel.score_all(map, pose, touches, bar)?;
        sum += object.carried.log_prior(pose);
        for pattern in self.patterns {
            if sum < bar {
                return None;
            }
            sum += pattern.contradiction(map, pose, &self.options.pattern);
        }
        Some(sum)
    }

    /// Leaves the `n` proposals of a pair that the other touches and the pair itself weigh most;
    /// all of them while there are no others. What a pair proposes fits the pair anyway.
    pub(super) fn keep_best_by(
        &self,
        others: &[&Sighting],
        proposals: &mut Vec<Proposal>,
        n: usize,
        map: &SurfaceMap,
    ) {
        if proposals.len() <= n || others.is_empty() {
            return;
        }
        let pose = |proposal: &Proposal| Turned::new(proposal.rotation, proposal.translation);
        let poses: Vec<Turned> = proposals.iter().map(pose).collect();
        let scores = self.kernel.score_each(map, &poses, others);
        let rated = proposals.iter().zip(scores).map(|(p, score)| (p.weight.ln() + score, *p));
        let mut rated: Vec<(f32, Proposal)> = rated.collect();
        // A stable sort: of equal ones the pair's order decides.
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        proposals.clear();
        proposals.extend(rated.iter().take(n).map(|(_, proposal)| *proposal));
    }

    /// What the newest `touch` and its pattern add to a pose's score.
    pub(super) fn newest(&self, map: &SurfaceMap, pose: &Turned) -> f32 {
        let touch = self.touches.last().map_or(0.0, |touch| self.kernel.score(map, pose, touch));
        touch + self.newest_pattern(map, pose)
    }

    /// What the newest press says against a pose.
    pub(super) fn newest_pattern(&self, map: &SurfaceMap, pose: &Turned) -> f32 {
        let pattern = self.patterns.last();
        pattern.map_or(0.0, |pattern| pattern.contradiction(map, pose, &self.options.pattern))
    }

    /// Refines a hypothesis and scores it anew; one that becomes clearly worse stays as it was.
    pub(super) fn settle(&self, hypothesis: &mut Hypothesis, object: Known<'_>) {
        let mut tried = *hypothesis;
        refine(&mut tried, object.map, self.touches, self.kernel, self.options);
        let bar = hypothesis.score - WORSE_MAX;
        if let Some(score) = self.score(object, &tried.pose(), bar)
            && score >= bar
        {
            *hypothesis = Hypothesis { score, ..tried };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::test_support::{belief_over, error, places, seen, single, some_pose};

    #[test]
    fn of_a_pairs_proposals_those_stay_that_fit_the_other_touches() {
        let places = places(400, 0);
        let truth = some_pose(3);
        let mut belief = belief_over(std::slice::from_ref(&places), SurfaceOptions::default());
        belief.touches = [5, 50, 90].map(|touch| seen(&places[touch], &truth)).to_vec();
        let (_, evidence) = belief.parts();
        let proposal = |index: u64, weight: f32| {
            let (rotation, translation) = single(&some_pose(index));
            Proposal { rotation, translation, weight }
        };
        // The true one is the pair's last choice.
        let all: Vec<Proposal> = [(7, 9.0), (8, 8.0), (9, 7.0), (3, 0.5)]
            .map(|(index, weight)| proposal(index, weight))
            .to_vec();
        let kept = |others: &[&Sighting], n: usize| {
            let mut proposals = all.clone();
            evidence.keep_best_by(others, &mut proposals, n, &evidence.maps[0]);
            proposals
        };
        let other = [&evidence.touches[0]];
        let best = kept(&other, 1);
        assert_eq!(best.len(), 1);
        assert!(error(best[0].rotation, best[0].translation, &truth).0 < 1e-5, "{best:?}");
        // Poses on which the other touch lies nowhere stay in the pair's order.
        let weights: Vec<f32> = kept(&other, 3).iter().map(|p| p.weight).collect();
        assert_eq!(weights, [0.5, 9.0, 8.0]);
        assert_eq!((kept(&other, 4).len(), kept(&[], 1).len()), (4, 4), "nothing to choose by");
    }
}
