//! Free space and coverage of touches, as evidence for or against a symmetry.
//!
//! A turn that takes a touched point into the space that the sensor occupied at another touch
//! is not a symmetry: no object was there. Touches settle a symmetry only when they are so
//! dense that a feature as large as a contact, such as a handle, would have been touched.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::cells::Cells;
use crate::object::MapPatch;
use crate::pose::Pose;
use crate::units::MM;

/// One touch of an object.
#[derive(Clone, Copy, Debug)]
pub struct Press {
    /// The patch of the touch in the map.
    pub patch: MapPatch,
    /// Pose of the sensor; its z points at the object. Object frame.
    pub object_from_sensor: Pose,
    /// Half the sides of the array along the sensor's x and y, metres.
    pub half: DVec2,
}

/// Depth of the solid part behind the sensor's face, metres. Chosen: the housing that the
/// simulator collides, and less than any arm that carries a sensor.
const HOUSING: f64 = 10.0 * MM;

/// Tolerated depth of a point in the sensor: coverings yield, and turns are known to about a
/// degree. Metres. Derived: the deepest presses are 1 mm, and half a degree at 40 mm is 0.4
/// mm.
const GIVES_WAY: f64 = 1.5 * MM;

/// Share of each half side of the array that counts: at the edge the turn's error shows.
const MIDDLE: f64 = 0.85;

/// Size of a feature as large as a contact: a disc of three quarters of the array's side. A
/// touch within its radius shows it.
const FEATURE: f64 = 0.75;

/// Largest share of the surface on which a feature may have been missed.
const MISSED_MAX: f64 = 0.02;

/// Rank k of the neighbour whose distance is the radius for the local density of touches: a disc
/// of this radius holds k touches.
const NEIGHBOUR: usize = 6;

/// The presses of an object, by position.
pub(super) struct Presses {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    sensor_from_object: Vec<Pose>,
    centers: Vec<DVec3>,
    half: Vec<DVec2>,
    cells: Cells,
}

impl Presses {
    pub(super) fn new(presses: &[Press]) -> Self {
        let positions: Vec<DVec3> = presses
            .iter()
            .map(|press| DVec3::from_array(press.patch.position.map(f64::from)))
            .collect();
        let normal = |press: &Press| press.object_from_sensor.turn(DVec3::NEG_Z);
        // The middle of the housing.
        let center = |press: &Press| press.object_from_sensor * (-0.5 * HOUSING * DVec3::Z);
        let centers: Vec<DVec3> = presses.iter().map(center).collect();
        let half: Vec<DVec2> = presses.iter().map(|press| MIDDLE * press.half).collect();
        let reach = half.iter().map(|half| half.extend(0.5 * HOUSING).length()).fold(0.0, f64::max);
        Self {
            cells: Cells::new(&centers, reach),
            sensor_from_object: presses.iter().map(|p| p.object_from_sensor.inverse()).collect(),
            positions,
            normals: presses.iter().map(normal).collect(),
            centers,
            half,
        }
    }

    /// The number of touched points that a motion (object to object) takes into a sensor.
    pub(super) fn contradicting(&self, motion: &Pose) -> usize {
        let is_inside = |point: DVec3| {
            let mut inside = false;
            self.cells.each_near(point, |press| {
                if inside || self.centers[press].distance_squared(point) > 1e-3 {
                    return;
                }
                let at = self.sensor_from_object[press] * point;
                let depth = -at.z;
                inside = (GIVES_WAY..HOUSING).contains(&depth)
                    && at.x.abs() < self.half[press].x
                    && at.y.abs() < self.half[press].y;
            });
            inside
        };
        self.positions.iter().filter(|position| is_inside(*motion * **position)).count()
    }

    /// Whether all touches lie within one contact, which is round from everywhere.
    fn are_one_place(&self) -> bool {
        let n = self.positions.len() as f64;
        let middle = self.positions.iter().sum::<DVec3>() / n;
        let feature = |half: &DVec2| FEATURE * half.min_element() / MIDDLE;
        let radius = self.half.iter().map(feature).fold(f64::INFINITY, f64::min);
        self.positions.iter().all(|at| at.distance(middle) <= radius)
    }

    /// Number of further touches needed until touches `times` rarer would miss a feature as
    /// large as a contact on less than [`MISSED_MAX`] of the surface; 0 when no more are
    /// needed.
    pub(super) fn touches_needed(&self, times: f64) -> usize {
        let n = self.positions.len();
        if n <= NEIGHBOUR || self.are_one_place() {
            return super::PATCHES_MIN;
        }
        // The surface that each touch represents, and the number of touches a feature there has.
        let of_touch = |at: usize| {
            // Touches on the other side of a wall say nothing about this one.
            let mut squares: Vec<f64> = (0..n)
                .filter(|other| *other != at && self.normals[*other].dot(self.normals[at]) > 0.0)
                .map(|other| self.positions[other].distance_squared(self.positions[at]))
                .collect();
            let place = NEIGHBOUR.min(squares.len()).saturating_sub(1);
            squares.sort_unstable_by(f64::total_cmp);
            let squared = squares.get(place).copied().unwrap_or(1.0);
            let area = PI * squared.max(1e-12) / (NEIGHBOUR as f64 - 0.5);
            let radius = FEATURE * 2.0 * self.half[at].min_element() / MIDDLE;
            (area, PI * radius * radius / (times * area))
        };
        let touches: Vec<(f64, f64)> = (0..n).map(of_touch).collect();
        let total: f64 = touches.iter().map(|touch| touch.0).sum();
        let missed = |factor: f64| {
            let sum: f64 =
                touches.iter().map(|(area, within)| area * (-factor * within).exp()).sum();
            sum / total
        };
        if missed(1.0) <= MISSED_MAX {
            return 0;
        }
        let (mut low, mut high) = (1.0, 2.0);
        while missed(high) > MISSED_MAX && high < 1e4 {
            (low, high) = (high, 2.0 * high);
        }
        for _halving in 0..20 {
            let middle = 0.5 * (low + high);
            if missed(middle) > MISSED_MAX { low = middle } else { high = middle }
        }
        (((high - 1.0) * n as f64).ceil() as usize).max(1)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::DQuat;

    use super::*;
    use crate::rng::{Purpose, Stream};

    /// Touches all around a cylinder about z with a radius of 20 mm and a height of 80 mm.
    fn cylinder(n: usize, stream: &mut Stream) -> Presses {
        let touch = |_| {
            let (angle, up) = (stream.uniform(0.0, TAU), stream.uniform(-40.0, 40.0));
            let outward = DVec3::new(angle.cos(), angle.sin(), 0.0);
            let at = (20.0 * outward + DVec3::Z * up) * MM;
            let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, outward);
            let single = |v: DVec3| v.to_array().map(|value| value as f32);
            let (position, normal) = (single(at), single(outward));
            Press {
                patch: MapPatch { position, normal, normal_confidence: 1.0 },
                object_from_sensor: Pose::from_parts(turn, at),
                half: DVec2::splat(6.0 * MM),
            }
        };
        Presses::new(&(0..n).map(touch).collect::<Vec<Press>>())
    }

    #[test]
    fn more_touches_are_needed_where_they_are_sparse() {
        let mut stream = Stream::new(2, Purpose::Shape, 0);
        assert_eq!(cylinder(600, &mut stream).touches_needed(1.0), 0);
        // 10,053 mm² and features of 254 mm²: exp(−254 n/10,053) = 0.02 at n = 155 for
        // uniform touches, and more because they are not uniform.
        let few = cylinder(100, &mut stream);
        let (once, thrice) = (100 + few.touches_needed(1.0), 100 + few.touches_needed(3.0));
        assert!((155..400).contains(&once), "{once}");
        assert!(thrice.abs_diff(3 * once) <= 3, "{thrice} {once}");
    }
}
