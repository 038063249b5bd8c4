//! The symmetry of a known shape, such as a mesh: exact, without touches and without a seed.
//!
//! A turn is a symmetry when no part of the surface as large as the resolution of touch moves
//! off the surface by more than that resolution, or, where nothing fits the mesh that well,
//! by more than the error of coarse meshes. A handle, a notch and an engraved line therefore
//! count; the facets of a round body that touch cannot feel do not.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use nalgebra::{Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use super::Symmetry;
use super::axes::{ANGLE_MIN, Judge, ORDER_MAX, PROBES, VERIFIED_MAX, Verified, symmetry};
use super::cells::Cells;
use super::line::{Line, lever};
use super::seeds::Spread;
use crate::pose::{Pose, rotation_angle};
use crate::units::{DEG, MM};

/// Smallest difference that counts, metres. Chosen: heights of touches scatter by about this.
const DEPTH: f64 = 0.1 * MM;

/// Smallest difference as a share of the largest dimension. Chosen: [`DEPTH`] for 80 mm.
const DEPTH_SHARE: f64 = 1.0 / 800.0;

/// Difference that always counts, as a share of the largest dimension: 0.4 mm for 80 mm.
/// Fitted to the built-in objects, whose grids of 1 mm miss the forms they were made with by
/// up to 0.29 mm (tested in `palpate_sim::symmetry`); a mug's handle is 17 mm off.
const DEPTH_MAX_SHARE: f64 = 1.0 / 200.0;

/// Between the two, largest ratio of a turn's misfit to the best. Chosen.
const COARSE: f64 = 1.5;

/// Radius of a part that counts, as a share of the largest dimension: a taxel's pitch of 2 mm
/// for objects of 80 mm. The surface is averaged over it, so that a sharp edge rounded by a
/// coarse mesh is not a feature.
const PART_SHARE: f64 = 1.0 / 40.0;

/// Flat sides count as round when there are more than [`ORDER_MAX`] and they leave the round
/// by at most this share of the largest dimension. Derived: where a round is the largest
/// dimension, 31 sides leave it by ½ (1 − cos(π/31)) = 1/389 of that.
const FINE_SHARE: f64 = 1.0 / 389.0;

/// Maximum number of sides of a round that are searched; more leave it by less than
/// [`DEPTH_SHARE`].
const SIDES_MAX: u16 = 180;

/// Share of their sum within which two moments count as equal. Chosen: true symmetries have
/// equal moments to a thousandth (points are uniform); accidents cost time.
const EQUAL_MOMENTS: f64 = 0.02;

/// Number of points for a fast estimate of a turn, and for fitting it.
const GLANCED: usize = 128;
const FITTED: usize = 768;

/// A surface whose symmetry is sought.
pub struct Shape<'a> {
    /// Points uniform on the surface, as is every prefix of the list. Metres, object frame.
    pub points: &'a [DVec3],
    /// The point of the surface nearest to a point, and the normal there.
    pub nearest: &'a (dyn Fn(DVec3) -> (DVec3, DVec3) + Sync),
    /// The largest dimension, metres.
    pub size: f64,
}

/// A shape under search.
struct Search<'a> {
    shape: &'a Shape<'a>,
    cells: Cells,
    spread: Spread,
    radius: f64,
    depth: f64,
}

/// The symmetry of a shape.
pub(super) fn discover(shape: &Shape<'_>) -> Symmetry {
    if shape.points.is_empty() {
        return Symmetry::NONE;
    }
    let radius = PART_SHARE * shape.size;
    let depth = DEPTH.max(DEPTH_SHARE * shape.size);
    let depth_max = depth.max(DEPTH_MAX_SHARE * shape.size);
    let mut search = Search {
        shape,
        cells: Cells::new(shape.points, radius),
        spread: Spread::new(shape.points, EQUAL_MOMENTS),
        radius,
        depth: depth_max,
    };
    let turns = search.spread.turns(&|turn| search.glance(turn));
    let fitting = search.verified(turns, VERIFIED_MAX);
    let best = fitting.iter().map(|turn| turn.misfit).fold(f64::INFINITY, f64::min);
    search.depth = (COARSE * best).clamp(depth, depth_max);
    let turns = fitting.iter().filter(|turn| turn.misfit <= search.depth);
    symmetry(&search, turns.map(|turn| turn.line.turn(turn.angle)).collect())
}

impl Judge for Search<'_> {
    fn verified(&self, turns: Vec<Pose>, n_max: usize) -> Vec<Verified> {
        let mut rated: Vec<(f64, Pose)> =
            turns.into_par_iter().map(|turn| (self.glance(&turn), turn)).collect();
        rated.sort_by(|a, b| a.0.total_cmp(&b.0));
        rated.truncate(n_max);
        let fitted: Vec<Option<Verified>> = rated
            .into_par_iter()
            .map(|(_, turn)| {
                let motion = self.fit(turn);
                let line = Line::of_turn(&motion, self.spread.center)?;
                let angle = rotation_angle(motion.rotation);
                // A line has no orientation; its turns have.
                let motion = line.turn(angle);
                if angle < ANGLE_MIN || !self.may_be_symmetry(&motion, self.depth) {
                    return None;
                }
                let misfit = self.worst_part(&motion);
                let lever = lever(&motion);
                (misfit <= self.depth).then_some(Verified { line, angle, lever, misfit })
            })
            .collect();
        fitted.into_iter().flatten().collect()
    }

    fn accepts(&self, line: &Line, angles: &[f64]) -> bool {
        angles.iter().all(|angle| self.is_symmetry(&line.turn(*angle), self.depth))
    }

    fn is_continuous(&self, line: &Line) -> bool {
        let all =
            |depth: f64| PROBES.iter().all(|angle| self.is_symmetry(&line.turn(*angle), depth));
        let has_sides = |n: u16| self.is_symmetry(&line.turn(TAU / f64::from(n)), self.depth);
        all(self.depth)
            || (all(self.depth.max(FINE_SHARE * self.shape.size))
                && (u16::from(ORDER_MAX) + 1..=SIDES_MAX).any(has_sides))
    }
}

impl Search<'_> {
    /// The distance by which a motion takes a point off the surface, metres.
    fn off(&self, motion: &Pose, point: DVec3) -> f64 {
        let moved = *motion * point;
        moved.distance((self.shape.nearest)(moved).0)
    }

    /// The mean distance by which a few points are taken off the surface, metres.
    fn glance(&self, motion: &Pose) -> f64 {
        let points = &self.shape.points[..self.shape.points.len().min(GLANCED)];
        points.iter().map(|point| self.off(motion, *point)).sum::<f64>() / points.len() as f64
    }

    /// Whether a motion takes no part of the surface off it by more than `depth` metres.
    fn is_symmetry(&self, motion: &Pose, depth: f64) -> bool {
        self.may_be_symmetry(motion, depth) && self.worst_part(motion) <= depth
    }

    /// A necessary condition: the mean of a few points is below twice the depth.
    fn may_be_symmetry(&self, motion: &Pose, depth: f64) -> bool {
        self.glance(motion) <= 2.0 * depth
    }

    /// The mean distance of the part of the surface that is taken off farthest, metres.
    fn worst_part(&self, motion: &Pose) -> f64 {
        let points = self.shape.points;
        let off: Vec<f64> = points.iter().map(|point| self.off(motion, *point)).collect();
        let of_part = |point: &DVec3| {
            let (mut sum, mut count) = (0.0, 0.0);
            self.cells.each_near(*point, |other| {
                if points[other].distance_squared(*point) <= self.radius * self.radius {
                    sum += off[other];
                    count += 1.0;
                }
            });
            sum / f64::max(count, 1.0)
        };
        points.iter().map(of_part).fold(0.0, f64::max)
    }

    /// The motion near `motion` that fits the shape to itself best: Gauss–Newton steps from
    /// each moved point to the nearest plane of the surface.
    fn fit(&self, motion: Pose) -> Pose {
        let mut motion = motion;
        for _step in 0..12 {
            let Some((moved, turned)) = self.step(&motion) else { break };
            let rotation = DQuat::from_scaled_axis(turned) * motion.rotation;
            let center = self.spread.center;
            let shift = DQuat::from_scaled_axis(turned) * (motion.translation - center) + center;
            motion = Pose::from_parts(rotation, shift + moved);
            if moved.length() < 1e-4 * MM && turned.length() < 1e-4 * DEG {
                break;
            }
        }
        motion
    }

    /// One step: a translation (metres) and a rotation about the centre (rad).
    fn step(&self, motion: &Pose) -> Option<(DVec3, DVec3)> {
        let points = &self.shape.points[..self.shape.points.len().min(FITTED)];
        let found: Vec<(DVec3, DVec3, f64)> = points
            .iter()
            .map(|point| {
                let moved = *motion * *point;
                let (at, normal) = (self.shape.nearest)(moved);
                (moved - self.spread.center, normal, (at - moved).dot(normal))
            })
            .collect();
        // Outliers count little (Geman and McClure, 1987).
        let mean = found.iter().map(|(_, _, off)| off.abs()).sum::<f64>() / found.len() as f64;
        let scale = (3.0 * mean).max(self.depth);
        // Free directions stay.
        let n = found.len() as f64;
        let free = Vector6::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0) * (1e-6 * n)
            + Vector6::new(0.0, 0.0, 0.0, 1.0, 1.0, 1.0) * (1e-6 * n * self.shape.size.powi(2));
        let (mut hessian, mut gradient) = (Matrix6::from_diagonal(&free), Vector6::zeros());
        for (lever, normal, off) in found {
            let weight = (1.0 + (off / scale).powi(2)).powi(-2);
            let turning = lever.cross(normal);
            let column = |v: DVec3| Vector3::new(v.x, v.y, v.z);
            let mut row = Vector6::zeros();
            row.fixed_rows_mut::<3>(0).copy_from(&column(normal));
            row.fixed_rows_mut::<3>(3).copy_from(&column(turning));
            hessian.ger(weight, &row, &row, 1.0);
            gradient.axpy(weight * off, &row, 1.0);
        }
        let change = hessian.cholesky()?.solve(&gradient);
        let part = |from: usize| DVec3::new(change[from], change[from + 1], change[from + 2]);
        Some((part(0), part(3)))
    }
}
