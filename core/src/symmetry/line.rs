//! A line in the object frame, the candidate axis of a symmetry.

use glam::{DMat3, DQuat, DVec3};

use crate::metric::outer;
use crate::pose::{Pose, rotation_angle};

/// A line: a point of it (metres) and its direction (norm 1), object frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    pub(super) point: DVec3,
    pub(super) direction: DVec3,
}

impl Line {
    /// The axis of a motion, its point nearest to `near`; the translation along the axis is
    /// dropped. `None` for a motion that does not turn.
    pub(super) fn of_turn(motion: &Pose, near: DVec3) -> Option<Self> {
        let direction = motion.rotation.xyz().try_normalize()?;
        // (I − R) off = moved has its solution across the line: off = moved/2 + cot(θ/2)/2 · u × moved.
        let moved = (*motion * near - near).reject_from_normalized(direction);
        let half = 0.5 * motion.rotation.w / motion.rotation.xyz().length();
        Some(Self { point: near + 0.5 * moved + half * direction.cross(moved), direction })
    }

    /// The turn about the line by `angle` (rad), object to object.
    pub(super) fn turn(&self, angle: f64) -> Pose {
        let rotation = DQuat::from_axis_angle(self.direction, angle);
        Pose::from_parts(rotation, self.point - rotation * self.point)
    }

    /// The angle between two lines, 0 to π/2.
    pub(super) fn angle_to(&self, other: &Self) -> f64 {
        let sine = self.direction.cross(other.direction).length();
        sine.atan2(self.direction.dot(other.direction).abs())
    }
}

/// The point with the least sum of weighted squared distances from lines; the one nearest to
/// the origin where that is ambiguous. Metres.
pub(super) fn nearest_point(lines: &[(Line, f64)]) -> DVec3 {
    let total: f64 = lines.iter().map(|line| line.1).sum();
    let mut matrix = DMat3::from_diagonal(DVec3::splat(1e-9 * total.max(f64::MIN_POSITIVE)));
    let mut sum = DVec3::ZERO;
    for (line, weight) in lines {
        let across = *weight * (DMat3::IDENTITY - outer(line.direction));
        matrix += across;
        sum += across * line.point;
    }
    matrix.inverse() * sum
}

/// Accuracy of the line that a turn defines: largest for half turns.
pub(super) fn lever(motion: &Pose) -> f64 {
    (0.5 * rotation_angle(motion.rotation)).sin().powi(2)
}
