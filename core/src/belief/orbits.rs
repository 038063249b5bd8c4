//! Modes of an answer modulo the symmetries of the objects.
//!
//! A mode represents its orbit: all poses that are equal to it under the object's symmetry. The
//! covariance says that the angle about a continuous axis is unknown.

use std::f64::consts::PI;

use glam::DVec3;
use nalgebra::Vector6;

use super::answer::PoseMode;
use crate::object::ObjectIdx;
use crate::symmetry::{AxisOrder, Symmetry, SymmetryAxis};

/// The variance of a uniform angle, rad²: over a full turn.
pub const ANY_TURN: f64 = PI * PI / 3.0;

/// Tolerances within which two poses are equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitScale {
    /// Largest distance between the centres, metres.
    pub distance: f64,
    /// Largest remaining angle under the best symmetry, rad.
    pub angle: f64,
}

/// Merges modes of one object that are equal under its symmetry into the first of them, adds
/// their weights, and makes the angle about a continuous axis unknown. Modes of objects
/// without a symmetry stay unchanged.
///
/// The result is sorted by weight; equal weights keep their order.
#[must_use]
pub fn merge_orbits<'a>(
    modes: Vec<PoseMode>,
    symmetry: impl Fn(ObjectIdx) -> &'a Symmetry,
    scale: &OrbitScale,
) -> Vec<PoseMode> {
    let mut kept: Vec<PoseMode> = Vec::with_capacity(modes.len());
    for mode in modes {
        let symmetry = symmetry(mode.object);
        let pose = &mode.session_from_object;
        let same = |other: &&mut PoseMode| {
            let OrbitScale { distance, angle } = *scale;
            other.object == mode.object
                && symmetry.look_alike(&other.session_from_object, pose, distance, angle)
        };
        match kept.iter_mut().find(same).filter(|_| !symmetry.is_none()) {
            Some(other) => other.weight += mode.weight,
            None => kept.push(mode),
        }
    }
    for mode in &mut kept {
        forget_turns(mode, symmetry(mode.object));
    }
    kept.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    kept
}

/// Makes the angles about continuous axes unknown.
fn forget_turns(mode: &mut PoseMode, symmetry: &Symmetry) {
    let pose = mode.session_from_object;
    let is_continuous = |axis: &&SymmetryAxis| axis.order == AxisOrder::Continuous;
    for axis in symmetry.axes.iter().filter(is_continuous) {
        let direction = pose.turn(axis.direction);
        // A turn ω about the axis moves the object's origin by ω × (origin − point of the axis).
        let moved: DVec3 = direction.cross(pose.translation - pose * axis.point);
        let way = Vector6::new(moved.x, moved.y, moved.z, direction.x, direction.y, direction.z);
        mode.covariance += ANY_TURN * way * way.transpose();
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use nalgebra::Matrix6;

    use super::*;
    use crate::pose::Pose;
    use crate::units::{DEG, MM};

    const SCALE: OrbitScale = OrbitScale { distance: 3.0 * MM, angle: 6.0 * DEG };
    const CENTER: DVec3 = DVec3::new(10.0 * MM, 0.0, 0.0);

    fn mode(object: u32, degrees: f64, weight: f64) -> PoseMode {
        // A turn about the centre, which stays in place.
        let rotation = DQuat::from_rotation_z(degrees * DEG);
        PoseMode {
            object: ObjectIdx(object),
            session_from_object: Pose::from_parts(rotation, CENTER - rotation * CENTER),
            covariance: Matrix6::zeros(),
            weight,
        }
    }

    fn merged(modes: Vec<PoseMode>, order: AxisOrder) -> Vec<PoseMode> {
        let symmetries = [Symmetry::through(CENTER, &[(DVec3::Z, order)]), Symmetry::NONE];
        merge_orbits(modes, |object| &symmetries[object.0 as usize], &SCALE)
    }

    #[test]
    fn a_squares_quarter_turns_are_one_mode_an_eighth_is_not() {
        let modes = vec![
            mode(0, 0.0, 0.3),
            mode(1, 0.0, 0.25),
            mode(0, 92.0, 0.2),
            mode(0, 45.0, 0.15),
            mode(0, 181.0, 0.1),
        ];
        let found = merged(modes, AxisOrder::Finite(4));
        let weights: Vec<f64> = found.iter().map(|mode| mode.weight).collect();
        assert_eq!(found.len(), 3, "{weights:?}");
        // 0.3 + 0.2 + 0.1, then the other object, then the eighth.
        assert!((weights[0] - 0.6).abs() < 1e-12 && found[0].object == ObjectIdx(0));
        assert!((weights[1] - 0.25).abs() < 1e-12 && found[1].object == ObjectIdx(1));
        assert!((weights[2] - 0.15).abs() < 1e-12);
        assert!(found[0].session_from_object.angle_to(&Pose::IDENTITY) < 1e-9, "the best stays");
        assert_eq!(found[0].covariance, Matrix6::zeros(), "finite turns leave no doubt");
    }

    #[test]
    fn without_a_symmetry_nothing_is_merged() {
        let modes = vec![mode(1, 0.0, 0.6), mode(1, 0.5, 0.4)];
        assert_eq!(merged(modes.clone(), AxisOrder::Continuous), modes);
    }

    #[test]
    fn a_continuous_axis_frees_its_angle_and_keeps_its_point() {
        let found = merged(vec![mode(0, 0.0, 0.7), mode(0, 77.0, 0.2)], AxisOrder::Continuous);
        assert_eq!(found.len(), 1);
        assert!((found[0].weight - 0.9).abs() < 1e-12);
        let covariance = found[0].covariance;
        // The variance of a uniform angle within ±π: π²/3 = 3.2899. The origin lies 10 mm
        // from the axis, so it moves along y by 10 mm a radian, against the turn.
        assert!((covariance[(5, 5)] - 3.289_868).abs() < 1e-6);
        assert!((covariance[(1, 1)] - 3.289_868e-4).abs() < 1e-10);
        assert!((covariance[(1, 5)] + 3.289_868e-2).abs() < 1e-8);
        // The centre, 10 mm along x from the origin, does not move: δy + 0.01 · ω_z = 0.
        let lever = Vector6::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.01);
        assert!((lever.transpose() * covariance * lever)[0].abs() < 1e-12);
        assert!(covariance[(0, 0)].abs() < 1e-15 && covariance[(3, 3)].abs() < 1e-15);
    }
}
