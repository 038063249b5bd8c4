//! Search for symmetries in touches: candidate turns are fitted to the map and kept if they
//! explain it.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::axes::{ANGLE_MIN, Judge, ORDER_MAX, Verified, angles, symmetry};
use super::cloud::{Cloud, Sight, thinned};
use super::fit::fit;
use super::line::{Line, lever};
use super::presses::{Press, Presses};
use super::seeds::{Spread, half_turns_across};
use super::verify::{Baseline, Judged, UNCLEAR};
use super::{AxisOrder, Finding, PATCHES_MIN, Symmetry, SymmetryAxis};
use crate::object::MapPatch;
use crate::pose::{Pose, rotation_angle};
use crate::units::DEG;

/// Number of patches of the blurred map, spread evenly.
const EVEN: usize = 256;

/// Maximum number of patches used of a large map.
const PATCHES_MAX: usize = 1_500;

/// Share of their sum within which two moments of touches count as equal.
const EQUAL_MOMENTS: f64 = 0.15;

/// Ratio of a turn's misfit on the blurred map to that of the map itself, below which it is
/// examined.
const PROMISING: f64 = 1.6;

/// A turn is fitted to one patch in this many before it is fitted to all.
const SPARSE: usize = 5;

/// Steps of fitting a turn about a line before it is judged; the line is known to a degree
/// and half a millimetre.
const REFINEMENTS: usize = 6;

/// Largest mean number, over the motions of a hypothesis, of touched points that a turn takes
/// into a sensor, beyond those in one anyway and twice their scatter: none, and one in five
/// hundred for many touches. Chosen: no object is where a sensor stood, but arms are not
/// exact; simulated turns of whole objects (seeds 101 to 103) took none.
const CONTRADICTING_MAX: f64 = 0.5;
const CONTRADICTING_SHARE: f64 = 1.0 / 500.0;

/// Angle beyond which a fitted turn is a different one than expected, rad.
const STRAYED: f64 = 4.0 * DEG;

/// Excess over another order's fit above which an order is rejected ([`Judged::worse_than`]);
/// near it the result is unclear. Chosen.
const WORSE: f64 = 1.0;
const NEARLY_WORSE: f64 = 0.8;
const CLEARLY_WORSE: f64 = 1.1;

/// Factor of the touches that a claim of symmetry needs over those that would show a feature
/// at all, since a single touch of it may be a chance. Chosen.
const CLAIMED: f64 = 1.25;

/// Number of turns of a finite order that are compared with those of a continuous one.
const RIVAL_TURNS: usize = 4;

/// Maximum number of turns that are judged together.
const TURNS_MAX: usize = 24;

/// A map under search.
struct Search {
    sharp: Cloud,
    baseline: Baseline,
    presses: Presses,
    usual: f64,
    blurred: Cloud,
    blurred_mean: f64,
    spread: Spread,
}

/// Finds the symmetry shown by touches.
pub(super) fn discover(presses: &[Press]) -> Finding {
    let step = presses.len().div_ceil(PATCHES_MAX).max(1);
    let looked_at: Vec<Press> = presses.iter().step_by(step).copied().collect();
    let patches: Vec<MapPatch> = looked_at.iter().map(|press| press.patch).collect();
    let even = thinned(&patches, EVEN);
    if even.len() < PATCHES_MIN {
        return Finding::Undetermined { touches_needed: PATCHES_MIN - even.len() };
    }
    let presses = Presses::new(&looked_at);
    let touches_needed = presses.touches_needed(1.0);
    if touches_needed > 0 {
        return Finding::Undetermined { touches_needed };
    }
    let search = Search::new(&patches, &even, presses);
    let blurred = &search.blurred;
    let rate = |turn: &Pose| {
        (0..blurred.len()).step_by(4).map(|patch| blurred.explain(turn, patch).misfit).sum()
    };
    let symmetry = symmetry(&search, search.spread.turns(&rate));
    let times = if symmetry.is_none() { 1.0 } else { CLAIMED };
    match search.presses.touches_needed(times) {
        0 if search.is_sure_of(&symmetry) => Finding::Settled(symmetry),
        // Twice the touches halve the variance of an unclear decision.
        0 => Finding::Undetermined { touches_needed: looked_at.len() },
        touches_needed => Finding::Undetermined { touches_needed },
    }
}

impl Search {
    /// A search over all patches and over evenly spread ones.
    fn new(patches: &[MapPatch], even: &[MapPatch], presses: Presses) -> Self {
        let sharp = Cloud::new(patches, Sight::Sharp);
        let blurred = Cloud::new(even, Sight::Blurred);
        let left_out = (0..blurred.len()).map(|patch| blurred.explain_left_out(patch).misfit);
        let blurred_mean = left_out.sum::<f64>() / blurred.len() as f64;
        let spread = Spread::new(&blurred.positions, EQUAL_MOMENTS);
        let usual = presses.contradicting(&Pose::IDENTITY) as f64;
        let baseline = Baseline::new(&sharp);
        Self { sharp, baseline, presses, usual, blurred, blurred_mean, spread }
    }

    /// The joint fit of some motions; `None` when a touch or many patches contradict them.
    fn judge(&self, motions: &[Pose]) -> Option<Judged> {
        let judged = self.baseline.judge(&self.sharp, motions)?;
        let both = motions.iter().flat_map(|motion| [*motion, motion.inverse()]);
        let n: usize = both.map(|motion| self.presses.contradicting(&motion)).sum();
        let mean = 0.5 * n as f64 / motions.len() as f64;
        let few = CONTRADICTING_MAX.max(CONTRADICTING_SHARE * self.sharp.len() as f64);
        let mean_max = self.usual + 2.0 * self.usual.sqrt() + few;
        (mean < mean_max).then_some(judged)
    }

    /// The joint fit of turns after each is fitted locally.
    fn judge_near(&self, turns: impl Iterator<Item = Pose>) -> Option<Judged> {
        self.judge(&turns.map(|turn| self.refined(turn)).collect::<Option<Vec<Pose>>>()?)
    }

    fn judge_order(&self, line: &Line, order: AxisOrder) -> Option<Judged> {
        self.judge_near(angles(order).into_iter().map(|angle| line.turn(angle)))
    }

    /// A turn fitted locally; `None` when no small change can make it a symmetry.
    fn refined(&self, turn: Pose) -> Option<Pose> {
        let motion = fit(&self.sharp, turn, REFINEMENTS, SPARSE);
        if self.baseline.is_hopeless(&self.sharp, &motion, SPARSE) {
            return None;
        }
        let motion = fit(&self.sharp, motion, REFINEMENTS, 1);
        if motion.angle_to(&turn) < STRAYED {
            return Some(motion);
        }
        // An unconstrained turn drifts, as that of a ball does, but its effect on the centre
        // is known.
        let center = self.spread.center;
        Some(Pose::from_parts(turn.rotation, motion * center - turn.turn(center)))
    }

    /// The finite orders about a line that fit better than every turn does, the highest
    /// first, with their margins.
    fn rivals(&self, line: &Line, every: &Judged) -> Vec<(u8, f64)> {
        let rival = |order: u8| {
            let few = angles(AxisOrder::Finite(order)).into_iter().take(RIVAL_TURNS);
            let few = self.judge_near(few.map(|angle| line.turn(angle)))?;
            let worse = every.worse_than(&few);
            (few.excess <= 1.0 && worse >= NEARLY_WORSE).then_some((order, worse))
        };
        (2..=ORDER_MAX).rev().filter_map(rival).collect()
    }

    /// Whether all turns of a symmetry together fit, and no higher one fits nearly as well.
    fn is_sure_of(&self, symmetry: &Symmetry) -> bool {
        let Some(main) = symmetry.axes.first() else { return true };
        let line = |axis: &SymmetryAxis| Line { point: axis.point, direction: axis.direction };
        let turns: Vec<Pose> = symmetry
            .axes
            .iter()
            .flat_map(|axis| angles(axis.order).into_iter().map(|angle| line(axis).turn(angle)))
            .collect();
        let step = turns.len().div_ceil(TURNS_MAX);
        let all = self.judge_near(turns.into_iter().step_by(step));
        if all.is_none_or(|all| all.excess > 1.0) {
            return false;
        }
        let Some(known) = self.judge_order(&line(main), main.order) else { return false };
        let refuted = |higher: Option<Judged>| {
            higher.is_none_or(|h| h.excess >= UNCLEAR || h.worse_than(&known) > CLEARLY_WORSE)
        };
        match main.order {
            AxisOrder::Continuous => {
                if !self.rivals(&line(main), &known).is_empty() {
                    return false;
                }
                let across = Line { direction: main.direction, point: self.spread.center };
                symmetry.axes.len() > 1
                    || half_turns_across(&across, PI)
                        .into_iter()
                        .all(|flip| refuted(self.judge_near(std::iter::once(flip))))
            }
            AxisOrder::Finite(order) => std::iter::once(AxisOrder::Continuous)
                .chain((2..=ORDER_MAX / order).map(|times| AxisOrder::Finite(times * order)))
                .all(|higher| refuted(self.judge_order(&line(main), higher))),
        }
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
                // A few patches suffice to converge and to reject most turns.
                let motion = fit(&self.sharp, motion, 12, SPARSE);
                if self.baseline.is_hopeless(&self.sharp, &motion, SPARSE) {
                    return None;
                }
                let motion = fit(&self.sharp, motion, 6, 1);
                let line = Line::of_turn(&motion, self.spread.center)?;
                let angle = rotation_angle(motion.rotation);
                let misfit = self.judge(&[motion])?.excess;
                let is_symmetry = misfit <= 1.0 && angle >= ANGLE_MIN;
                is_symmetry.then(|| Verified { line, angle, lever: lever(&motion), misfit })
            })
            .collect();
        fitted.into_iter().flatten().collect()
    }

    fn accepts(&self, line: &Line, angles: &[f64]) -> bool {
        self.judge_near(angles.iter().map(|angle| line.turn(*angle)))
            .is_some_and(|judged| judged.excess <= 1.0)
    }

    fn order(&self, line: &Line) -> Option<AxisOrder> {
        let fitting = |order| self.judge_order(line, order).filter(|judged| judged.excess <= 1.0);
        if let Some(every) = fitting(AxisOrder::Continuous) {
            let rivals = self.rivals(line, &every);
            // Orders without a common turn fit better by chance.
            let agree =
                |highest: u8| rivals.iter().all(|(order, _)| highest.is_multiple_of(*order));
            let clear = rivals.iter().any(|(_, worse)| *worse >= WORSE);
            if !rivals.first().is_some_and(|(highest, _)| clear && agree(*highest)) {
                return Some(AxisOrder::Continuous);
            }
        }
        // Turns of a near symmetry fit worse than those of a true one.
        let fitting: Vec<(AxisOrder, Judged)> = (2..=ORDER_MAX)
            .rev()
            .map(AxisOrder::Finite)
            .filter_map(|order| Some((order, fitting(order)?)))
            .collect();
        let is_best = |(_, judged): &&(AxisOrder, Judged)| {
            fitting.iter().all(|(_, other)| judged.worse_than(other) < WORSE)
        };
        fitting.iter().find(is_best).map(|(order, _)| *order)
    }
}
