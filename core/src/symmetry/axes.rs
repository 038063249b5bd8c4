//! From turns that fit to a symmetry: their axes, how often each may be turned, and the group
//! that they make.
//!
//! What fits is decided elsewhere: by touches (`discover`) or by a mesh (`shape`).

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};

use super::group;
use super::line::{Line, nearest_point};
use super::seeds::half_turns_across;
use super::{AxisOrder, Symmetry};
use crate::pose::Pose;
use crate::units::DEG;

/// The largest finite order; finer teeth than these count as continuous.
pub const ORDER_MAX: u8 = 30;

/// The most turns that are verified.
pub(super) const VERIFIED_MAX: usize = 48;

/// Turns smaller than this say nothing: any smooth surface nearly fits itself. Below 2π/30.
pub(super) const ANGLE_MIN: f64 = 11.0 * DEG;

/// Half turns across a continuous axis that are tried: any of them would do.
const FLIPS_MAX: usize = 8;

/// Lines within this angle are one axis.
const SAME_AXIS: f64 = 10.0 * DEG;

/// The angles that prove an axis continuous: every order up to [`ORDER_MAX`] is off one of
/// them by a fourth of its step.
pub(super) const PROBES: [f64; 7] =
    [37.0 * DEG, 61.0 * DEG, 83.0 * DEG, 101.0 * DEG, 127.0 * DEG, 149.0 * DEG, 167.0 * DEG];

/// What an object is turned in front of: it says which turns leave the object as it is.
pub(super) trait Judge: Sync {
    /// The symmetries next to some turns, at most `n_max` of the most promising tried.
    fn verified(&self, turns: Vec<Pose>, n_max: usize) -> Vec<Verified>;

    /// Whether the turns about a line by some angles (rad) are symmetries, taken together.
    fn accepts(&self, line: &Line, angles: &[f64]) -> bool;

    /// Whether every turn about a line is a symmetry.
    fn is_continuous(&self, line: &Line) -> bool {
        self.accepts(line, &PROBES)
    }

    /// How often the object meets itself in a turn about a line; `None` when never.
    fn order(&self, line: &Line) -> Option<AxisOrder> {
        if self.is_continuous(line) {
            return Some(AxisOrder::Continuous);
        }
        // A small turn fits nearly anything a little: every multiple has to.
        let fits = |order: &AxisOrder| self.accepts(line, &angles(*order));
        (2..=ORDER_MAX).rev().map(AxisOrder::Finite).find(fits)
    }
}

/// The turns of an axis up to half a turn, rad; of a continuous one those that prove it.
pub(super) fn angles(order: AxisOrder) -> Vec<f64> {
    match order {
        AxisOrder::Continuous => PROBES.to_vec(),
        AxisOrder::Finite(order) => {
            (1..=order / 2).map(|k| TAU * f64::from(k) / f64::from(order)).collect()
        }
    }
}

/// An axis that was found.
#[derive(Clone, Copy)]
struct Found {
    line: Line,
    order: AxisOrder,
}

/// A turn that is a symmetry.
pub(super) struct Verified {
    pub(super) line: Line,
    /// By which angle it turns, rad.
    pub(super) angle: f64,
    /// How well the turn fixes its line, 0 to 1.
    pub(super) lever: f64,
    /// How badly it fits, 0 at best.
    pub(super) misfit: f64,
}

/// The symmetry that some turns lead to.
pub(super) fn symmetry(judge: &dyn Judge, turns: Vec<Pose>) -> Symmetry {
    let verified = judge.verified(turns, VERIFIED_MAX);
    let found = axes(judge, &verified);
    let Some(main) = found.iter().max_by_key(|axis| rank(axis.order)).copied() else {
        return Symmetry::NONE;
    };
    match main.order {
        AxisOrder::Continuous => continuous(judge, main),
        AxisOrder::Finite(order) => finite(judge, main, order, &found),
    }
}

/// The line of the turn that fits best among those that fix their line well.
fn surest<'a>(turns: impl Iterator<Item = &'a Verified> + Clone) -> Option<Line> {
    let lever_max = turns.clone().map(|turn| turn.lever).fold(0.0, f64::max);
    turns
        .filter(|turn| turn.lever >= 0.5 * lever_max)
        .min_by(|a, b| a.misfit.total_cmp(&b.misfit))
        .map(|turn| turn.line)
}

/// The axes of verified turns, and their orders; axes without one are left out.
fn axes(judge: &dyn Judge, turns: &[Verified]) -> Vec<Found> {
    let mut groups: Vec<Vec<&Verified>> = Vec::new();
    for turn in turns {
        match groups.iter_mut().find(|group| group[0].line.angle_to(&turn.line) < SAME_AXIS) {
            Some(group) => group.push(turn),
            None => groups.push(vec![turn]),
        }
    }
    let mut found: Vec<Found> = Vec::new();
    for group in groups {
        let Some(line) = surest(group.into_iter()) else { continue };
        let Some(order) = judge.order(&line) else { continue };
        let is_continuous = |found: &Found| found.order == AxisOrder::Continuous;
        let is_ball = order == AxisOrder::Continuous && found.iter().any(is_continuous);
        found.push(Found { line, order });
        if is_ball {
            break;
        }
    }
    found
}

/// The symmetry of an object with a continuous axis: a spindle, a rod alike at both ends, or
/// a ball.
fn continuous(judge: &dyn Judge, main: Found) -> Symmetry {
    let across = main.line.direction.any_orthonormal_vector();
    let other = Line { point: main.line.point, direction: across };
    let lines = [main.line, other].map(|line| (line, 1.0));
    let about = |direction, order| (direction, order);
    let tilts = half_turns_across(&main.line, PI)
        .into_iter()
        .filter_map(|flip| Some(Line::of_turn(&flip, main.line.point)?.turn(PROBES[2])));
    let tilts = judge.verified(tilts.collect(), FLIPS_MAX);
    let half_turns = judge.verified(half_turns_across(&main.line, PI), FLIPS_MAX);
    let direction = group::upward(main.line.direction);
    let is_across = |turn: &&Verified| turn.line.angle_to(&main.line) > 0.5 * PI - SAME_AXIS;
    // A turn that was tried may have ended as one about the main axis, which is known.
    if tilts.iter().any(|tilt| is_across(&tilt)) {
        let axes = DVec3::AXES.map(|axis| about(axis, AxisOrder::Continuous));
        return Symmetry::through(nearest_point(&lines), &axes);
    }
    let Some(flip) = surest(half_turns.iter().filter(is_across)) else {
        let center = nearest_point(&[(main.line, 1.0)]);
        return Symmetry::through(center, &[about(direction, AxisOrder::Continuous)]);
    };
    let across = flip.direction.reject_from_normalized(direction).normalize_or(across);
    let axes = [about(direction, AxisOrder::Continuous), about(across, AxisOrder::Finite(2))];
    Symmetry::through(nearest_point(&[(main.line, 1.0), (flip, 1.0)]), &axes)
}

/// The symmetry of an object whose highest order is finite.
fn finite(judge: &dyn Judge, main: Found, order: u8, found: &[Found]) -> Symmetry {
    let mut lines = vec![(main.line, 1.0)];
    let mut rotations = group::closure(&[turn(&main.line, order)]).unwrap_or_default();
    let half_turns = half_turns_across(&main.line, PI / f64::from(order));
    let flips = judge.verified(half_turns, VERIFIED_MAX);
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
