//! The evidence of a session: all that its presses say of a pose, and poses settled on it.

use std::sync::Arc;

use super::HybridOptions;
use super::carried::Carried;
use super::hypothesis::Hypothesis;
use super::pattern::Pattern;
use super::refine::refine;
use super::score::{Kernel, Turned};
use super::sighting::Sighting;
use crate::surface::SurfaceMap;

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
    pub(super) options: &'a HybridOptions,
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
