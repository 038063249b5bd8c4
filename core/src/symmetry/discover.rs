//! The search: turns that may be symmetries, laid onto the map, kept when they explain it.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::cloud::{Cloud, Sight, thinned};
use super::fit::fit;
use super::group;
use super::line::{Line, lever, nearest_point};
use super::seeds::{Spread, half_turns_across};
use super::verify::Baseline;
use super::{AxisOrder, PATCHES_MIN, Symmetry};
use crate::patch::MapPatch;
use crate::pose::{Pose, rotation_angle};
use crate::units::DEG;

/// The largest finite order; finer teeth than these count as continuous.
pub const ORDER_MAX: u8 = 30;

/// Patches of the blurred map, spread evenly.
const EVEN: usize = 256;

/// Patches that are looked at of larger maps.
const PATCHES_MAX: usize = 1_500;

/// A turn is looked at closely when the blurred map fits this much worse than itself.
const PROMISING: f64 = 1.6;

/// A turn is fitted to one patch in so many before it is fitted to all.
const SPARSE: usize = 5;

/// The most turns that are verified.
const VERIFIED_MAX: usize = 48;

/// Turns smaller than this say nothing: any smooth surface nearly fits itself. Below 2π/30.
const ANGLE_MIN: f64 = 11.0 * DEG;

/// Lines within this angle are one axis.
const SAME_AXIS: f64 = 10.0 * DEG;

/// The angles that prove an axis continuous: every order up to [`ORDER_MAX`] is off one of
/// them by a fourth of its step.
const PROBES: [f64; 7] =
    [37.0 * DEG, 61.0 * DEG, 83.0 * DEG, 101.0 * DEG, 127.0 * DEG, 149.0 * DEG, 167.0 * DEG];

/// A map under search.
struct Search {
    sharp: Cloud,
    baseline: Baseline,
    blurred: Cloud,
    blurred_mean: f64,
    spread: Spread,
}

/// An axis that was found.
#[derive(Clone, Copy)]
struct Found {
    line: Line,
    order: AxisOrder,
}

/// A turn that is a symmetry.
struct Verified {
    line: Line,
    /// How well the turn fixes its line, 0 to 1.
    lever: f64,
    /// Its mean misfit relative to that of patches left out.
    misfit: f64,
}

/// The line of the turn that fits best among those that fix their line well.
fn surest<'a>(turns: impl Iterator<Item = &'a Verified> + Clone) -> Option<Line> {
    let lever_max = turns.clone().map(|turn| turn.lever).fold(0.0, f64::max);
    turns
        .filter(|turn| turn.lever >= 0.5 * lever_max)
        .min_by(|a, b| a.misfit.total_cmp(&b.misfit))
        .map(|turn| turn.line)
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
    let turns = search.verified(search.spread.turns(&search.blurred), VERIFIED_MAX);
    let found = search.axes(&turns);
    let Some(main) = found.iter().max_by_key(|axis| rank(axis.order)).copied() else {
        return Symmetry::NONE;
    };
    match main.order {
        AxisOrder::Continuous => search.continuous(main),
        AxisOrder::Finite(order) => search.finite(main, order, &found),
    }
}

impl Search {
    /// Of all patches and of those that lie evenly.
    fn new(patches: &[MapPatch], even: &[MapPatch]) -> Self {
        let sharp = Cloud::new(patches, Sight::Sharp);
        let blurred = Cloud::new(even, Sight::Blurred);
        let left_out = (0..blurred.len()).map(|patch| blurred.explain_left_out(patch).misfit);
        let blurred_mean = left_out.sum::<f64>() / blurred.len() as f64;
        let spread = Spread::new(&blurred);
        Self { baseline: Baseline::new(&sharp), sharp, blurred, blurred_mean, spread }
    }

    /// The symmetries next to some turns, at most `n_max` of the most promising tried.
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
                let turns = rotation_angle(motion.rotation) >= ANGLE_MIN;
                let misfit = self.baseline.misfit(&self.sharp, &motion).filter(|_| turns)?;
                Some(Verified { line, lever: lever(&motion), misfit })
            })
            .collect();
        fitted.into_iter().flatten().collect()
    }

    /// The axes of verified turns, and their orders; axes without one are left out.
    fn axes(&self, turns: &[Verified]) -> Vec<Found> {
        let mut groups: Vec<Vec<&Verified>> = Vec::new();
        for turn in turns {
            match groups.iter_mut().find(|group| group[0].line.angle_to(&turn.line) < SAME_AXIS) {
                Some(group) => group.push(turn),
                None => groups.push(vec![turn]),
            }
        }
        let found: Vec<Option<Found>> = groups
            .into_par_iter()
            .map(|group| {
                let line = surest(group.into_iter())?;
                Some(Found { line, order: self.order(&line)? })
            })
            .collect();
        found.into_iter().flatten().collect()
    }

    fn accepts(&self, line: &Line, angle: f64) -> bool {
        self.baseline.misfit(&self.sharp, &line.turn(angle)).is_some()
    }

    /// How often the map meets itself in a turn about a line; `None` when never.
    fn order(&self, line: &Line) -> Option<AxisOrder> {
        if PROBES.iter().all(|angle| self.accepts(line, *angle)) {
            return Some(AxisOrder::Continuous);
        }
        // A small turn fits nearly anything a little: every multiple has to.
        let steps = (2..=ORDER_MAX).filter(|order| self.accepts(line, TAU / f64::from(*order)));
        let possible: Vec<u8> = steps.collect();
        let fits = |order: &&u8| {
            let step = TAU / f64::from(**order);
            (2..=**order / 2).all(|k| self.accepts(line, step * f64::from(k)))
        };
        possible.iter().rev().find(fits).map(|order| AxisOrder::Finite(*order))
    }

    /// The symmetry of a map with a continuous axis: a spindle, a rod alike at both ends, or
    /// a ball.
    fn continuous(&self, main: Found) -> Symmetry {
        let across = main.line.direction.any_orthonormal_vector();
        let other = Line { point: main.line.point, direction: across };
        let lines = [main.line, other].map(|line| (line, 1.0));
        let about = |direction, order| (direction, order);
        let tilts = self.verified(vec![other.turn(PROBES[2])], 1);
        let half_turns = self.verified(vec![other.turn(PI)], 1);
        let direction = group::upward(main.line.direction);
        if !tilts.is_empty() {
            let axes = DVec3::AXES.map(|axis| about(axis, AxisOrder::Continuous));
            return Symmetry::through(nearest_point(&lines), &axes);
        }
        let Some(flip) = surest(half_turns.iter()) else {
            let center = nearest_point(&[(main.line, 1.0)]);
            return Symmetry::through(center, &[about(direction, AxisOrder::Continuous)]);
        };
        let across = flip.direction.reject_from_normalized(direction).normalize_or(across);
        let axes = [about(direction, AxisOrder::Continuous), about(across, AxisOrder::Finite(2))];
        Symmetry::through(nearest_point(&[(main.line, 1.0), (flip, 1.0)]), &axes)
    }

    /// The symmetry of a map whose highest order is finite.
    fn finite(&self, main: Found, order: u8, found: &[Found]) -> Symmetry {
        let mut lines = vec![(main.line, 1.0)];
        let mut rotations = group::closure(&[turn(&main.line, order)]).unwrap_or_default();
        let half_turns = half_turns_across(&main.line, PI / f64::from(order));
        let flips = self.verified(half_turns, VERIFIED_MAX);
        let across = |flip: &&Verified| flip.line.angle_to(&main.line) > PI / 2.0 - SAME_AXIS;
        let flip = surest(flips.iter().filter(across)).map(|line| {
            let direction = line.direction.reject_from_normalized(main.line.direction).normalize();
            Found { line: Line { direction, ..line }, order: AxisOrder::Finite(2) }
        });
        for other in flip.iter().chain(found) {
            let AxisOrder::Finite(order) = other.order else { continue };
            let known = group::axes(&rotations).into_iter().any(|(direction, known)| {
                let line = Line { direction, ..other.line };
                known.is_multiple_of(order) && line.angle_to(&other.line) < SAME_AXIS
            });
            if known {
                continue;
            }
            // What does not close to a group was taken for a symmetry wrongly.
            let generators: Vec<DQuat> =
                rotations.iter().copied().chain([turn(&other.line, order)]).collect();
            if let Some(larger) = group::closure(&generators) {
                rotations = larger;
                lines.push((other.line, 1.0));
            }
        }
        let axes: Vec<(DVec3, AxisOrder)> = group::axes(&rotations)
            .into_iter()
            .map(|(direction, order)| (direction, AxisOrder::Finite(order)))
            .collect();
        Symmetry::through(nearest_point(&lines), &axes)
    }
}

fn turn(line: &Line, order: u8) -> DQuat {
    DQuat::from_axis_angle(line.direction, TAU / f64::from(order))
}

/// Higher orders first, continuous before all.
fn rank(order: AxisOrder) -> u16 {
    match order {
        AxisOrder::Continuous => u16::MAX,
        AxisOrder::Finite(order) => u16::from(order),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_finite_order_passes_all_probes_of_a_continuous_axis() {
        for order in 2..=ORDER_MAX {
            let step = TAU / f64::from(order);
            let off = PROBES.map(|angle| (angle / step - (angle / step).round()).abs());
            assert!(off.into_iter().fold(0.0, f64::max) > 0.25, "{order}: {off:?}");
        }
    }
}
