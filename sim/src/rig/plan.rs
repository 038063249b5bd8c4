//! Planar poses, and the rig's plan of 192 presses of a letter.
//!
//! Source: section 3.2.3: a 4 × 4 grid with 6.8 mm between positions, 12 angles at each.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::units::MM;

/// Positions along each side of the grid.
pub const N_POSITIONS: usize = 4;
/// Angles at each position.
pub const N_ANGLES: usize = 12;
/// Distance between neighbouring positions, metres.
pub const SPACING: f64 = 6.8 * MM;

/// Pose of a sensor that looks straight down, in the frame of a flat object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarPose {
    /// x of the sensor's centre, metres.
    pub x: f64,
    /// y of the sensor's centre, metres.
    pub y: f64,
    /// From the object's x axis to the sensor's, radians, counter-clockwise seen from above.
    pub angle: f64,
}

impl PlanarPose {
    /// The pose in space of a sensor whose free surface is `indentation` metres below the
    /// object's face z = 0: x_s = (cos t, sin t, 0), y_s = (sin t, −cos t, 0), z_s = (0, 0,
    /// −1).
    #[must_use]
    pub fn object_from_sensor(self, indentation: f64) -> Pose {
        let rotation = DQuat::from_rotation_z(self.angle) * DQuat::from_rotation_x(PI);
        Pose::from_parts(rotation, DVec3::new(self.x, self.y, -indentation))
    }

    /// The planar part of a pose; exact when the sensor looks straight down.
    #[must_use]
    pub fn of(object_from_sensor: Pose) -> Self {
        let along = object_from_sensor.turn(DVec3::X);
        let DVec3 { x, y, .. } = object_from_sensor.translation;
        Self { x, y, angle: along.y.atan2(along.x) }
    }
}

/// Every planned pose of one repetition: positions row by row from the lowest, all angles at
/// each before the next.
#[must_use]
pub fn plan() -> Vec<PlanarPose> {
    let along = |index: usize| (index as f64 - 0.5 * (N_POSITIONS as f64 - 1.0)) * SPACING;
    (0..N_POSITIONS * N_POSITIONS * N_ANGLES)
        .map(|press| {
            let (position, turn) = (press / N_ANGLES, press % N_ANGLES);
            let (x, y) = (along(position % N_POSITIONS), along(position / N_POSITIONS));
            PlanarPose { x, y, angle: TAU * turn as f64 / N_ANGLES as f64 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use palpate_core::units::DEG;

    use super::*;

    #[test]
    fn the_plan_is_that_of_the_dissertation() {
        let plan = plan();
        assert_eq!(plan.len(), 192);
        let first = PlanarPose { x: -10.2 * MM, y: -10.2 * MM, angle: 0.0 };
        assert!((plan[0].x - first.x).abs() + (plan[0].y - first.y).abs() < 1e-12);
        let last = plan[191];
        assert!((last.x - 10.2 * MM).abs() < 1e-12 && (last.angle - 330.0 * DEG).abs() < 1e-12);
        assert!((plan[12].x - plan[0].x - 6.8 * MM).abs() < 1e-12);
    }

    #[test]
    fn a_planar_pose_turns_the_axes_as_defined() {
        let at = PlanarPose { x: 0.003, y: -0.004, angle: 30.0 * DEG };
        let pose = at.object_from_sensor(0.001);
        let (sin, cos) = (30.0 * DEG).sin_cos();
        for (axis, expected) in [
            (DVec3::X, DVec3::new(cos, sin, 0.0)),
            (DVec3::Y, DVec3::new(sin, -cos, 0.0)),
            (DVec3::Z, DVec3::new(0.0, 0.0, -1.0)),
        ] {
            assert!(pose.turn(axis).distance(expected) < 1e-12, "{axis}");
        }
        assert!((pose.translation - DVec3::new(0.003, -0.004, -0.001)).length() < 1e-15);
        let back = PlanarPose::of(pose);
        assert!((back.angle - at.angle).abs() < 1e-12 && (back.x - at.x).abs() < 1e-15);
    }
}
