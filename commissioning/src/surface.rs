//! Touches as points with normals on the object's surface: the search for its pose.
//!
//! A settled press has its origin just inside the surface and faces it. `object_from_session`
//! is found from pairs of touches with the distance and angles of pairs of surface points
//! (Drost et al. 2010), and refined together with the tool centre. Equations C1 and C2.

use glam::{DMat3, DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::stop::Stop;
use palpate_core::units::{DEG, MM};
use palpate_sim::press::PressSimulator;

use crate::solve::{Parameter, solve};

/// Deviations of a right touch: distance from the surface (m) and angle to its normal (rad).
/// Chosen: a covering is pressed in by about 1 mm, the controllers stop within 5°, and a tool
/// centre is off by a few millimetres and degrees before it is corrected.
const POINT: f64 = 3.0 * MM;
const ANGLE: f64 = 12.0 * DEG;

/// Prior deviations of the tool centre: offset (m) and tilt (rad). Chosen: twice what people get
/// wrong when they measure it.
pub(crate) const TOOL_OFFSET: f64 = 5.0 * MM;
pub(crate) const TOOL_TILT: f64 = 8.0 * DEG;

/// Points of the surface whose pairs are searched, and the bins of their features. Chosen: points
/// of an 80 mm object are then nearer to each other than a bin is wide.
const POINTS: usize = 300;
const DISTANCE_BINS: f64 = 16.0;
const ANGLE_BIN: f64 = 18.0 * DEG;

/// Pairs of touches that propose poses, and most proposals of each.
const PAIRS: usize = 12;
const PROPOSALS_MAX: usize = 400;

/// Proposals that are refined, and poses that are kept.
const REFINED: usize = 12;
const KEPT: usize = 6;

/// A place of the object in the session.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    /// The pose.
    pub(crate) object_from_session: Pose,
    /// Correction of the tool centre: `sent_from_true` sensor.
    pub(crate) tool: Pose,
    /// Mean misfit of the touches, 0 to 1. Equation C1.
    pub(crate) misfit: f64,
}

/// The object's surface with a table of its point pairs.
pub(crate) struct SurfaceSearch<'a> {
    simulator: &'a PressSimulator,
    stop: &'a Stop,
    points: Vec<(DVec3, DVec3)>,
    /// Key of the features, and both points; sorted.
    pairs: Vec<(u64, u16, u16)>,
    bin: f64,
}

impl<'a> SurfaceSearch<'a> {
    pub(crate) fn new(simulator: &'a PressSimulator, seed: u64, stop: &'a Stop) -> Self {
        let mut stream = Stream::new(seed, Purpose::Commissioning, 0);
        let drawn = (0..POINTS).map(|_| simulator.draw_point(&mut stream));
        let points: Vec<(DVec3, DVec3)> = drawn.map(|at| (at.point, at.normal)).collect();
        let bin = simulator.mesh().extent().length() / DISTANCE_BINS;
        let mut pairs = Vec::with_capacity(POINTS * POINTS);
        for (i, a) in points.iter().enumerate() {
            for (j, b) in points.iter().enumerate().filter(|(j, _)| *j != i) {
                pairs.push((key(cells(&features(a, b, bin))), i as u16, j as u16));
            }
        }
        pairs.sort_unstable();
        Self { simulator, stop, points, pairs, bin }
    }

    /// The likeliest places of the object, best first, for touches at these poses.
    pub(crate) fn search(&self, session_from_sensor: &[Pose], seed: u64) -> Vec<Placed> {
        let touches: Vec<(DVec3, DVec3)> = session_from_sensor
            .iter()
            .map(|pose| (pose.translation, pose.turn(-DVec3::Z)))
            .collect();
        let mut proposals: Vec<(f64, Pose)> = Vec::new();
        for (first, second) in self.chosen_pairs(&touches, seed) {
            let (a, b) = (&touches[first], &touches[second]);
            let found = self.alike(&features(a, b, self.bin));
            let stride = found.len().div_ceil(PROPOSALS_MAX).max(1);
            for &(i, j) in found.iter().step_by(stride) {
                let (p, q) = (&self.points[usize::from(i)], &self.points[usize::from(j)]);
                let object_from_session = frame(p, q) * frame(a, b).inverse();
                let misfit = self.misfit_of(&touches, object_from_session);
                proposals.push((misfit, object_from_session));
            }
        }
        proposals.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut distinct: Vec<Pose> = Vec::new();
        for (_, pose) in &proposals {
            if distinct.iter().all(|other| !self.is_same(pose, other)) {
                distinct.push(*pose);
            }
            if distinct.len() == REFINED {
                break;
            }
        }
        let mut refined: Vec<Placed> =
            distinct.iter().map(|pose| self.refine(session_from_sensor, *pose, true)).collect();
        refined.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
        let mut kept: Vec<Placed> = Vec::new();
        for placed in refined {
            let is_new =
                |k: &Placed| !self.is_same(&placed.object_from_session, &k.object_from_session);
            if kept.len() < KEPT && kept.iter().all(is_new) {
                kept.push(placed);
            }
        }
        kept
    }

    /// Places for a given pose of the object: with the tool centre refined, and as it is. A thin
    /// object lets the refinement slip through to its other side.
    pub(crate) fn refine_given(&self, poses: &[Pose], object_from_session: Pose) -> Vec<Placed> {
        let refined = self.refine(poses, object_from_session, false);
        let touches: Vec<(DVec3, DVec3)> =
            poses.iter().map(|pose| (pose.translation, pose.turn(-DVec3::Z))).collect();
        let misfit = self.misfit_of(&touches, object_from_session);
        let mut both = vec![refined, Placed { object_from_session, tool: Pose::IDENTITY, misfit }];
        both.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
        both
    }

    /// Refines the tool centre, and the object's pose if it `may_move`. Equation C2.
    pub(crate) fn refine(&self, poses: &[Pose], start: Pose, may_move: bool) -> Placed {
        let center = self.center();
        let mut parameters = vec![Parameter { prior: TOOL_OFFSET, step: 0.1 * MM }; 3];
        parameters.extend([Parameter { prior: TOOL_TILT, step: 0.3 * DEG }; 2]);
        if may_move {
            parameters.extend([Parameter { prior: 100.0 * MM, step: 0.1 * MM }; 3]);
            parameters.extend([Parameter { prior: 1.0, step: 0.3 * DEG }; 3]);
        }
        let unpack = |values: &[f64]| {
            let tool = Pose::from_parts(
                DQuat::from_scaled_axis(DVec3::new(values[3], values[4], 0.0)),
                DVec3::new(values[0], values[1], values[2]),
            );
            let moved = if may_move { moved(start, center, &values[5..11]) } else { start };
            (moved, tool)
        };
        let residuals = |values: &[f64]| -> Vec<f64> {
            let (object_from_session, tool) = unpack(values);
            let mut all = Vec::with_capacity(4 * poses.len());
            for pose in poses {
                let (off, turned) = self.off(object_from_session * *pose * tool);
                all.extend([off / POINT, turned.x / ANGLE, turned.y / ANGLE, turned.z / ANGLE]);
            }
            all
        };
        let start_values = vec![0.0; parameters.len()];
        let solution = solve(&parameters, &start_values, 4, 12, &residuals);
        let (object_from_session, tool) = unpack(&solution.values);
        let placed: Vec<Pose> = poses.iter().map(|pose| *pose * tool).collect();
        let touches: Vec<(DVec3, DVec3)> =
            placed.iter().map(|pose| (pose.translation, pose.turn(-DVec3::Z))).collect();
        let misfit = self.misfit_of(&touches, object_from_session);
        Placed { object_from_session, tool, misfit }
    }

    /// Middle of the object, about which poses are turned.
    pub(crate) fn center(&self) -> DVec3 {
        let (low, high) = self.simulator.mesh().bounds();
        0.5 * (low + high)
    }

    /// Diagonal of the box around the object, metres.
    pub(crate) fn diagonal(&self) -> f64 {
        self.simulator.mesh().extent().length()
    }

    /// Signed distance of a sensor's origin from the surface (m, positive outside), and the turn
    /// from its −z to the normal there (sine of the angle, as an axis).
    fn off(&self, object_from_sensor: Pose) -> (f64, DVec3) {
        let origin = object_from_sensor.translation;
        let (point, normal) = self.simulator.nearest(origin);
        let outward = object_from_sensor.turn(-DVec3::Z);
        let signed = (origin - point).length() * (origin - point).dot(normal).signum();
        (signed, outward.cross(normal) * if outward.dot(normal) < 0.0 { 5.0 } else { 1.0 })
    }

    fn misfit_of(&self, touches: &[(DVec3, DVec3)], object_from_session: Pose) -> f64 {
        self.stop.check();
        let misfit = |(point, outward): &(DVec3, DVec3)| {
            let (at, outward) = (object_from_session * *point, object_from_session.turn(*outward));
            let (nearest, normal) = self.simulator.nearest(at);
            let off = at.distance(nearest) / POINT;
            let turned = outward.angle_between(normal) / ANGLE;
            let squared = off * off + turned * turned;
            squared / (1.0 + squared)
        };
        touches.iter().map(misfit).sum::<f64>() / touches.len() as f64
    }

    /// Pairs of touches that are far apart or face different ways.
    fn chosen_pairs(&self, touches: &[(DVec3, DVec3)], seed: u64) -> Vec<(usize, usize)> {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for first in 0..touches.len() {
            for second in first + 1..touches.len() {
                let (a, b) = (&touches[first], &touches[second]);
                let apart = a.0.distance(b.0) / self.diagonal();
                pairs.push((apart.min(1.0) + 0.5 * a.1.cross(b.1).length(), first, second));
            }
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        pairs.truncate((pairs.len() / 2).max(PAIRS));
        let mut stream = Stream::new(seed, Purpose::Commissioning, 1);
        let n = pairs.len();
        (0..PAIRS.min(n)).map(|_| stream.index(n)).map(|at| (pairs[at].1, pairs[at].2)).collect()
    }

    /// Pairs of surface points whose features lie in the same or neighbouring bins.
    fn alike(&self, features: &[f64; 4]) -> Vec<(u16, u16)> {
        let around = cells(features);
        let mut found = Vec::new();
        for code in 0..81_i64 {
            let shift = [code % 3 - 1, code / 3 % 3 - 1, code / 9 % 3 - 1, code / 27 - 1];
            let cell: [i64; 4] = std::array::from_fn(|at| around[at] + shift[at]);
            if cell.iter().any(|c| *c < 0) {
                continue;
            }
            let wanted = key(cell);
            let first = self.pairs.partition_point(|pair| pair.0 < wanted);
            let same = self.pairs[first..].iter().take_while(|pair| pair.0 == wanted);
            found.extend(same.map(|pair| (pair.1, pair.2)));
        }
        found
    }

    fn is_same(&self, a: &Pose, b: &Pose) -> bool {
        let (from_a, from_b) = (a.inverse() * self.center(), b.inverse() * self.center());
        from_a.distance(from_b) < 6.0 * MM && a.angle_to(b) < 15.0 * DEG
    }
}

/// `start` moved by three metres and three radians about `center` of the object.
pub(crate) fn moved(start: Pose, center: DVec3, by: &[f64]) -> Pose {
    let turn = DQuat::from_scaled_axis(DVec3::new(by[3], by[4], by[5]));
    let shift = DVec3::new(by[0], by[1], by[2]);
    let about = Pose::from_parts(turn, center + shift - turn * center);
    about * start
}

/// Distance in bins, and the angles of the normals to the connection and to each other in bins.
fn features(a: &(DVec3, DVec3), b: &(DVec3, DVec3), bin: f64) -> [f64; 4] {
    let way = b.0 - a.0;
    let along = way.normalize_or(DVec3::X);
    let angle = |u: DVec3, v: DVec3| u.angle_between(v) / ANGLE_BIN;
    [way.length() / bin, angle(a.1, along), angle(b.1, along), angle(a.1, b.1)]
}

fn cells(features: &[f64; 4]) -> [i64; 4] {
    features.map(|value| value.clamp(0.0, 1e6) as i64)
}

fn key(cell: [i64; 4]) -> u64 {
    cell.iter().fold(0, |key, at| (key << 16) | (*at as u64).min(0xFFFF))
}

/// A frame at the first point of a pair, along the connection and its normals.
fn frame(a: &(DVec3, DVec3), b: &(DVec3, DVec3)) -> Pose {
    let x = (b.0 - a.0).normalize_or(DVec3::X);
    let sum = a.1 + b.1;
    let across = sum - sum.dot(x) * x;
    let own = a.1 - a.1.dot(x) * x;
    let across = if across.length() > 0.3 { across } else { own };
    let z = across.try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
    let turn = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z));
    Pose::from_parts(turn, 0.5 * (a.0 + b.0))
}
