//! Candidate turns: about the axes that the second moment of a surface permits.
//!
//! Every axis of a symmetry runs through the centroid of the surface and is an eigenvector of
//! its second moment: a principal axis, any direction across the distinct one when two
//! moments are equal, or any direction at all when all three are.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rayon::prelude::*;

use super::line::Line;
use crate::pose::Pose;
use crate::units::DEG;

/// Prime orders tried about principal axes; one of them divides every order up to 30.
const PRIMES: [u8; 10] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29];

/// Prime orders tried about any direction: those of polyhedra and of squat wheels.
const PRIMES_ANYWHERE: [u8; 6] = [2, 3, 5, 7, 11, 13];

/// Directions of a half sphere, about 7° apart.
const DIRECTIONS: usize = 420;

/// Number of directions kept for each order, and their smallest distance, rad.
const KEPT: usize = 8;
const KEPT_APART: f64 = 12.0 * DEG;

/// Largest angle between neighbouring half turns across an axis, rad.
pub(super) const ACROSS_STEP: f64 = 8.0 * DEG;

/// The centroid of a surface (metres) and its principal axes.
pub(super) struct Spread {
    pub(super) center: DVec3,
    /// Axes and their moments, least first.
    axes: [(DVec3, f64); 3],
    /// Share of their sum within which two moments count as equal.
    equal_within: f64,
}

impl Spread {
    /// The spread of points that are uniform on the surface; moments that differ by less than
    /// the share `equal_within` of their sum count as equal.
    pub(super) fn new(points: &[DVec3], equal_within: f64) -> Self {
        let n = points.len() as f64;
        let center = points.iter().sum::<DVec3>() / n;
        let mut moment = Matrix3::zeros();
        for position in points {
            let off = Vector3::from((*position - center).to_array());
            moment += off * off.transpose() / n;
        }
        let eigen = SymmetricEigen::new(moment);
        let axis = |index: usize| {
            let column = eigen.eigenvectors.column(index);
            let direction = DVec3::new(column[0], column[1], column[2]);
            (direction.normalize_or(DVec3::AXES[index]), eigen.eigenvalues[index])
        };
        let mut axes = [0, 1, 2].map(axis);
        axes.sort_by(|a, b| a.1.total_cmp(&b.1));
        Self { center, axes, equal_within }
    }

    /// The candidate turns, about lines through the centroid. `rate` is a fast estimate of a
    /// turn's misfit.
    pub(super) fn turns(&self, rate: &(dyn Fn(&Pose) -> f64 + Sync)) -> Vec<Pose> {
        let line = |direction| Line { point: self.center, direction };
        let mut turns: Vec<Pose> = Vec::new();
        for (direction, _) in self.axes {
            turns.extend(PRIMES.map(|order| line(direction).turn(TAU / f64::from(order))));
        }
        let equal = |a: usize, b: usize| {
            let (a, b) = (self.axes[a].1, self.axes[b].1);
            (a - b).abs() <= self.equal_within * (a + b)
        };
        match (equal(0, 1), equal(1, 2)) {
            (true, true) => turns.extend(self.turns_anywhere(rate)),
            (true, false) => turns.extend(half_turns_across(&line(self.axes[2].0), PI)),
            (false, true) => turns.extend(half_turns_across(&line(self.axes[0].0), PI)),
            (false, false) => {}
        }
        turns
    }

    /// The best few turns of each prime order among all directions.
    fn turns_anywhere(&self, rate: &(dyn Fn(&Pose) -> f64 + Sync)) -> Vec<Pose> {
        let mut kept = Vec::new();
        for order in PRIMES_ANYWHERE {
            let angle = TAU / f64::from(order);
            let directions: Vec<DVec3> = half_sphere(DIRECTIONS).collect();
            let mut rated: Vec<(f64, Line)> = directions
                .into_par_iter()
                .map(|direction| {
                    let line = Line { point: self.center, direction };
                    (rate(&line.turn(angle)), line)
                })
                .collect();
            rated.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut best: Vec<Line> = Vec::new();
            for (_, line) in rated {
                if best.len() < KEPT && best.iter().all(|other| other.angle_to(&line) > KEPT_APART)
                {
                    best.push(line);
                }
            }
            kept.extend(best.iter().map(|line| line.turn(angle)));
        }
        kept
    }
}

/// Half turns about directions across a line, over `range` of them (rad), at most
/// [`ACROSS_STEP`] and at most a fourth of the range apart.
pub(super) fn half_turns_across(line: &Line, range: f64) -> Vec<Pose> {
    let n = (range / ACROSS_STEP).ceil().max(4.0) as usize;
    let across = line.direction.any_orthonormal_vector();
    let half_turn = |step: usize| {
        let angle = range * step as f64 / n as f64;
        let direction = DQuat::from_axis_angle(line.direction, angle) * across;
        Line { point: line.point, direction }.turn(PI)
    };
    (0..n).map(half_turn).collect()
}

/// `n` directions spread evenly over half of the unit sphere (a Fibonacci lattice).
fn half_sphere(n: usize) -> impl Iterator<Item = DVec3> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    (0..n).map(move |index| {
        let z = 1.0 - (index as f64 + 0.5) / n as f64;
        let (sin, cos) = (golden * index as f64).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * cos, radius * sin, z)
    })
}
