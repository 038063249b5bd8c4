//! The search in touches: turns that may be symmetries, laid onto the map, kept when they
//! explain it.

use rayon::prelude::*;

use super::axes::{ANGLE_MIN, Judge, Verified, symmetry};
use super::cloud::{Cloud, Sight, thinned};
use super::fit::fit;
use super::line::{Line, lever};
use super::seeds::Spread;
use super::verify::Baseline;
use super::{PATCHES_MIN, Symmetry};
use crate::patch::MapPatch;
use crate::pose::{Pose, rotation_angle};
use crate::units::DEG;

/// Patches of the blurred map, spread evenly.
const EVEN: usize = 256;

/// Patches that are looked at of larger maps.
const PATCHES_MAX: usize = 1_500;

/// Moments of touches that differ by less than this share of their sum count as equal.
const EQUAL_MOMENTS: f64 = 0.15;

/// A turn is looked at closely when the blurred map fits this much worse than itself.
const PROMISING: f64 = 1.6;

/// A turn is fitted to one patch in so many before it is fitted to all.
const SPARSE: usize = 5;

/// A map under search.
struct Search {
    sharp: Cloud,
    baseline: Baseline,
    blurred: Cloud,
    blurred_mean: f64,
    spread: Spread,
}

/// The symmetry of a map; none when fewer than [`PATCHES_MIN`] patches lie apart.
pub(super) fn discover(patches: &[MapPatch]) -> Symmetry {
    let step = patches.len().div_ceil(PATCHES_MAX).max(1);
    let looked_at: Vec<MapPatch> = patches.iter().step_by(step).copied().collect();
    let even = thinned(&looked_at, EVEN);
    if even.len() < PATCHES_MIN {
        return Symmetry::NONE;
    }
    let search = Search::new(&looked_at, &even);
    let blurred = &search.blurred;
    let rate = |turn: &Pose| {
        (0..blurred.len()).step_by(4).map(|patch| blurred.explain(turn, patch).misfit).sum()
    };
    symmetry(&search, search.spread.turns(&rate))
}

impl Search {
    /// Of all patches and of those that lie evenly.
    fn new(patches: &[MapPatch], even: &[MapPatch]) -> Self {
        let sharp = Cloud::new(patches, Sight::Sharp);
        let blurred = Cloud::new(even, Sight::Blurred);
        let left_out = (0..blurred.len()).map(|patch| blurred.explain_left_out(patch).misfit);
        let blurred_mean = left_out.sum::<f64>() / blurred.len() as f64;
        let spread = Spread::new(&blurred.positions, EQUAL_MOMENTS);
        Self { baseline: Baseline::new(&sharp), sharp, blurred, blurred_mean, spread }
    }
}

impl Judge for Search {
    fn verified(&self, turns: Vec<Pose>, n_max: usize) -> Vec<Verified> {
        let rated: Vec<(f64, Pose)> = turns
            .into_par_iter()
            .map(|turn| {
                let motion = fit(&self.blurred, turn, 10, 1);
                let misfits = self.blurred.misfits(&motion);
                (misfits.iter().sum::<f64>() / misfits.len() as f64, motion)
            })
            .collect();
        let mut promising: Vec<(f64, Pose)> = rated
            .into_iter()
            .filter(|(misfit, motion)| {
                *misfit <= PROMISING * self.blurred_mean
                    && rotation_angle(motion.rotation) >= ANGLE_MIN
            })
            .collect();
        promising.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut distinct: Vec<Pose> = Vec::new();
        for (_, motion) in promising {
            if distinct.iter().all(|other| other.angle_to(&motion) > 3.0 * DEG) {
                distinct.push(motion);
            }
        }
        distinct.truncate(n_max);
        let fitted: Vec<Option<Verified>> = distinct
            .into_par_iter()
            .map(|motion| {
                // Few patches find the way, and tell most turns from symmetries.
                let motion = fit(&self.sharp, motion, 12, SPARSE);
                if self.baseline.is_hopeless(&self.sharp, &motion, SPARSE) {
                    return None;
                }
                let motion = fit(&self.sharp, motion, 6, 1);
                let line = Line::of_turn(&motion, self.spread.center)?;
                let angle = rotation_angle(motion.rotation);
                let turns = angle >= ANGLE_MIN;
                let misfit = self.baseline.misfit(&self.sharp, &motion).filter(|_| turns)?;
                Some(Verified { line, angle, lever: lever(&motion), misfit })
            })
            .collect();
        fitted.into_iter().flatten().collect()
    }

    fn accepts(&self, line: &Line, angle: f64) -> bool {
        self.baseline.misfit(&self.sharp, &line.turn(angle)).is_some()
    }
}
