//! Rigid poses: a unit quaternion and a translation, and the distances between them.
//!
//! A pose named `a_from_b` maps b's coordinates into a's; products cancel in the names.
//! Quaternions are given as x, y, z, w (ROS). Source of the distances: equation 5.36 and
//! Chirikjian and Zhou (1998), with the formulas settled in `docs/equations.md`.

use std::ops::Mul;

use glam::{DQuat, DVec3};
use thiserror::Error;

use crate::units::Beyond;

/// Tolerance of a given quaternion's norm about 1; it is then normalised.
pub const QUATERNION_NORM_TOLERANCE: f64 = 1e-2;

/// A rigid transformation: rotate, then translate (metres).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The rotation, always of norm 1.
    pub rotation: DQuat,
    /// The translation, in metres.
    pub translation: DVec3,
}

/// Error of seven numbers that are not a pose.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum PoseError {
    /// A component of the position is infinite or not a number.
    #[error("position component {axis} is {found}, expected a finite number of metres")]
    Position {
        /// The component: 0 is x, 1 is y, 2 is z.
        axis: usize,
        /// The given value.
        found: f64,
    },
    /// A component of the quaternion is infinite or not a number.
    #[error("quaternion component {component} is {found}, expected a finite number")]
    Component {
        /// The component in the order x, y, z, w.
        component: usize,
        /// The given value.
        found: f64,
    },
    /// The norm of the quaternion is not 1.
    #[error(
        "quaternion has norm {}, expected 1 (order x, y, z, w; no rotation is 0, 0, 0, 1)",
        Beyond(*norm, [1.0])
    )]
    Norm {
        /// The given norm.
        norm: f64,
    },
}

impl Pose {
    /// The identity.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// A pose from a position (metres) and a quaternion in the order x, y, z, w.
    ///
    /// # Errors
    /// [`PoseError`] when a number is not finite or the quaternion's norm differs from 1 by
    /// more than [`QUATERNION_NORM_TOLERANCE`].
    pub fn new(position: [f64; 3], quaternion_xyzw: [f64; 4]) -> Result<Self, PoseError> {
        if let Some(axis) = position.iter().position(|value| !value.is_finite()) {
            return Err(PoseError::Position { axis, found: position[axis] });
        }
        if let Some(component) = quaternion_xyzw.iter().position(|value| !value.is_finite()) {
            return Err(PoseError::Component { component, found: quaternion_xyzw[component] });
        }
        let rotation = DQuat::from_array(quaternion_xyzw);
        let norm = rotation.length();
        if !norm.is_finite() || (norm - 1.0).abs() > QUATERNION_NORM_TOLERANCE {
            return Err(PoseError::Norm { norm });
        }
        Ok(Self { rotation: rotation.normalize(), translation: DVec3::from_array(position) })
    }

    /// A pose bit by bit as stored: checked, but not normalised again, so that a repeated one
    /// equals the stored one.
    ///
    /// # Errors
    /// As [`Pose::new`].
    pub fn stored(position: [f64; 3], quaternion_xyzw: [f64; 4]) -> Result<Self, PoseError> {
        let checked = Self::new(position, quaternion_xyzw)?;
        Ok(Self { rotation: DQuat::from_array(quaternion_xyzw), ..checked })
    }

    /// A pose from parts that are valid already; the rotation is normalised.
    #[must_use]
    pub fn from_parts(rotation: DQuat, translation: DVec3) -> Self {
        Self { rotation: rotation.normalize(), translation }
    }

    /// The inverse: `b_from_a` of `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// Rotates a direction, without the translation.
    #[must_use]
    pub fn turn(&self, direction: DVec3) -> DVec3 {
        self.rotation * direction
    }

    /// The distance between the two origins, in metres.
    #[must_use]
    pub fn distance_to(&self, other: &Self) -> f64 {
        self.translation.distance(other.translation)
    }

    /// The angle between the two orientations, in radians within 0 ..= π.
    ///
    /// Equation 5.36, computed as 2·atan2(‖q_v‖, |q_w|), which is stable near π.
    #[must_use]
    pub fn angle_to(&self, other: &Self) -> f64 {
        rotation_angle(self.rotation.conjugate() * other.rotation)
    }
}

/// The angle of a rotation, in radians within 0 ..= π.
#[must_use]
pub fn rotation_angle(rotation: DQuat) -> f64 {
    2.0 * rotation.xyz().length().atan2(rotation.w.abs())
}

impl Mul<Pose> for Pose {
    type Output = Pose;

    fn mul(self, b_from_c: Pose) -> Pose {
        Pose {
            rotation: (self.rotation * b_from_c.rotation).normalize(),
            translation: self.rotation * b_from_c.translation + self.translation,
        }
    }
}

impl Mul<DVec3> for Pose {
    type Output = DVec3;

    fn mul(self, point_in_b: DVec3) -> DVec3 {
        self.rotation * point_in_b + self.translation
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;

    use super::*;
    use crate::rng::{Purpose, Stream};

    #[test]
    fn a_zero_quaternion_is_refused_with_its_norm() {
        let error = Pose::new([0.0; 3], [0.0; 4]).unwrap_err();
        assert_eq!(error, PoseError::Norm { norm: 0.0 });
        assert_eq!(Pose::new([0.0; 3], [0.0, 0.0, 0.0, 2.0]), Err(PoseError::Norm { norm: 2.0 }));
    }

    #[test]
    fn a_position_that_is_not_finite_is_refused_by_axis() {
        let error = Pose::new([0.0, f64::NAN, 0.0], [0.0, 0.0, 0.0, 1.0]).unwrap_err();
        assert!(matches!(error, PoseError::Position { axis: 1, .. }));
    }

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y() {
        let half = FRAC_PI_2 / 2.0;
        let pose = Pose::new([1.0, 2.0, 3.0], [0.0, 0.0, half.sin(), half.cos()]).unwrap();
        assert!((pose * DVec3::X).distance(DVec3::new(1.0, 3.0, 3.0)) < 1e-12);
        assert!((pose.angle_to(&Pose::IDENTITY) - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn the_angle_is_exact_at_half_a_turn() {
        let turned = Pose::from_parts(DQuat::from_rotation_x(PI), DVec3::ZERO);
        assert!((turned.angle_to(&Pose::IDENTITY) - PI).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn a_pose_and_its_inverse_cancel(seed in 0u64..1000) {
            let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
            let pose = Pose::from_parts(stream.rotation(), stream.direction());
            let nothing = pose * pose.inverse();
            prop_assert!(nothing.distance_to(&Pose::IDENTITY) < 1e-12);
            prop_assert!(nothing.angle_to(&Pose::IDENTITY) < 1e-7);
        }
    }
}
