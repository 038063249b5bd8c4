//! The score of a pose by all observations of a session (S_h of equation R17).

use std::sync::Arc;

use palpate_core::stop::Stop;

use super::density::Kernel;
use super::free_space::contradiction;
use super::motion_prior::MotionPrior;
use super::tool_error;
use crate::model::SurfaceMap;
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::Observation;
use crate::observe::press_space::PressSpace;
use crate::options::SurfaceOptions;
use crate::propose::proposals::Proposal;

/// The observations of a session, with everything needed to score poses by them.
#[derive(Clone, Copy)]
pub(crate) struct Evidence<'a> {
    pub(crate) maps: &'a [Arc<SurfaceMap>],
    pub(crate) kernel: &'a Kernel,
    pub(crate) touches: &'a [Observation],
    pub(crate) spaces: &'a [PressSpace],
    pub(crate) options: &'a SurfaceOptions,
    /// Ends loops over objects.
    pub(crate) stop: &'a Stop,
}

/// An object whose poses are scored.
#[derive(Clone, Copy)]
pub(crate) struct Known<'a> {
    pub(crate) map: &'a SurfaceMap,
    pub(crate) prior: &'a MotionPrior,
}

impl Evidence<'_> {
    /// The score of a pose (ln) of an object; `None` once it cannot reach `bar`.
    #[inline]
    pub(crate) fn score(&self, object: Known<'_>, pose: &InversePose, bar: f32) -> Option<f32> {
        self.score_in_turn(object, pose, self.touches.iter().rev(), bar)
    }

    /// The score by all `touches` in this order: a pose is dropped sooner if the touches that
    /// are likely to contradict it come first.
    ///
    /// Equation R17 of docs/recogniser.md.
    #[inline]
    pub(crate) fn score_in_turn<'a>(
        &self,
        object: Known<'_>,
        pose: &InversePose,
        touches: impl ExactSizeIterator<Item = &'a Observation>,
        bar: f32,
    ) -> Option<f32> {
        let map = object.map;
        let mut sum = self.kernel.score_all(map, pose, touches, bar)?;
        sum += object.prior.log_density(pose);
        sum += tool_error::log_density(pose.tool, &self.options.refinement);
        for space in self.spaces {
            if sum < bar {
                return None;
            }
            sum += contradiction(space, map, pose, &self.options.score);
        }
        Some(sum)
    }

    /// Keeps the `n` best proposals of a pair by the pair's weight and the scores of the
    /// `others`; keeps all if there are no others. A proposal fits its own pair by construction.
    pub(crate) fn keep_best_by(
        &self,
        others: &[&Observation],
        proposals: &mut Vec<Proposal>,
        n: usize,
        map: &SurfaceMap,
    ) {
        if proposals.len() <= n || others.is_empty() {
            return;
        }
        let pose = |proposal: &Proposal| InversePose::new(proposal.rotation, proposal.translation);
        let poses: Vec<InversePose> = proposals.iter().map(pose).collect();
        let scores = self.kernel.score_each(map, &poses, others);
        let rated = proposals.iter().zip(scores).map(|(p, score)| (p.weight.ln() + score, *p));
        let mut rated: Vec<(f32, Proposal)> = rated.collect();
        // A stable sort: ties keep the pair's order.
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        proposals.clear();
        proposals.extend(rated.iter().take(n).map(|(_, proposal)| *proposal));
    }

    /// Score (ln) of a pose by the newest touch and its press.
    pub(crate) fn newest(&self, map: &SurfaceMap, pose: &InversePose) -> f32 {
        let touch = self.touches.last().map_or(0.0, |touch| self.kernel.score(map, pose, touch));
        touch + self.newest_press(map, pose)
    }

    /// Score (ln) of a pose by the newest press.
    pub(crate) fn newest_press(&self, map: &SurfaceMap, pose: &InversePose) -> f32 {
        let space = self.spaces.last();
        space.map_or(0.0, |space| contradiction(space, map, pose, &self.options.score))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{Session, error, places, seen, single, some_pose};

    #[test]
    fn proposals_that_fit_the_other_touches_stay() {
        let places = places(400, 0);
        let truth = some_pose(3);
        let mut session = Session::over(std::slice::from_ref(&places), SurfaceOptions::default());
        session.touches = [5, 50, 90].map(|touch| seen(&places[touch], &truth)).to_vec();
        let evidence = session.evidence();
        let proposal = |index: u64, weight: f32| {
            let (rotation, translation) = single(&some_pose(index));
            Proposal { rotation, translation, weight }
        };
        // The true one is the pair's last choice.
        let all: Vec<Proposal> = [(7, 9.0), (8, 8.0), (9, 7.0), (3, 0.5)]
            .map(|(index, weight)| proposal(index, weight))
            .to_vec();
        let kept = |others: &[&Observation], n: usize| {
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
