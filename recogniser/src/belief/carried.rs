//! What is carried over when the object may have moved: which one it is stays as probable as it
//! was, where it is becomes loose.
//!
//! The poses of before are where the search begins, and poses far from them, measured by the
//! stated motion, are less likely, but never ruled out: the client may be wrong.

use nalgebra::Matrix6;

use super::hypothesis::Hypothesis;
use super::turned::Turned;
use palpate_core::reading::Looseness;

/// So many poses of an object are carried over.
pub(super) const POSES_MAX: usize = 8;

/// So many touches fix a pose by themselves.
const FIXED: usize = 3;

/// The share of motions larger than stated.
const WRONG: f32 = 0.02;

/// Poses of one object from before it may have moved.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Carried {
    pub(super) poses: Vec<(Turned, f32)>,
    /// Variances of the motion so far: m², rad².
    pub(super) position: f32,
    pub(super) angle: f32,
}

impl Carried {
    /// Bytes behind its list.
    pub(super) fn bytes(&self) -> usize {
        self.poses.capacity() * size_of::<(Turned, f32)>()
    }

    /// The likeliest of an object's hypotheses, after a motion.
    pub(super) fn of(hypotheses: &[Hypothesis], motion: &Looseness) -> Self {
        let best = hypotheses.first().map_or(0.0, |hypothesis| hypothesis.score);
        let total: f32 = hypotheses.iter().map(|h| (h.score - best).exp()).sum();
        let pose = |h: &Hypothesis| (h.pose(), (h.score - best).exp() / total);
        let poses = hypotheses.iter().take(POSES_MAX).map(pose).collect();
        let (position, angle) = (motion.position.powi(2) as f32, motion.angle.powi(2) as f32);
        Self { poses, position, angle }
    }

    /// It may have moved once more before it was touched.
    pub(super) fn loosen(&mut self, motion: &Looseness) {
        self.position += motion.position.powi(2) as f32;
        self.angle += motion.angle.powi(2) as f32;
    }

    /// What the motion adds to a pose's covariance (x, y, z in metres, then rad), as long as so
    /// few touches since say where the object is now.
    pub(super) fn covariance(&self, n_touches: usize) -> Matrix6<f64> {
        let (p, r) = (f64::from(self.position), f64::from(self.angle));
        if n_touches >= FIXED {
            Matrix6::zeros()
        } else {
            Matrix6::from_diagonal(&[p, p, p, r, r, r].into())
        }
    }

    /// ln of how likely a pose is after the motion: near 0 where the object was, no less than
    /// ln of the share of wrong statements. 0 without anything known.
    pub(super) fn log_prior(&self, pose: &Turned) -> f32 {
        if self.poses.is_empty() {
            return 0.0;
        }
        let near = |(before, weight): &(Turned, f32)| {
            let moved = before.translation.distance_squared(pose.translation);
            let turned = before.angle_to(pose).powi(2);
            // Squares of 3 and 3 independent deviations.
            let square = moved / self.position.max(1e-9) + turned / self.angle.max(1e-6);
            weight * (-0.5 * square).exp()
        };
        ((1.0 - WRONG) * self.poses.iter().map(near).sum::<f32>() + WRONG).ln()
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    fn at(x: f32, angle: f32, score: f32) -> Hypothesis {
        let (rotation, translation) = (Quat::from_rotation_z(angle), Vec3::new(x, 0.0, 0.0));
        Hypothesis { rotation, translation, score }
    }

    const MOTION: Looseness = Looseness { position: 0.010, angle: 0.2 };

    #[test]
    fn a_pose_is_as_likely_as_the_motion_to_it() {
        let carried = Carried::of(&[at(0.0, 0.0, 5.0)], &MOTION);
        let prior = |x, angle| carried.log_prior(&at(x, angle, 0.0).pose());
        assert!(prior(0.0, 0.0).abs() < 1e-5);
        // One deviation each way: 0.98 · e⁻¹ + 0.02.
        assert!((prior(0.010, 0.2) - (0.98 * (-1.0f32).exp() + 0.02).ln()).abs() < 1e-3);
        assert!((prior(0.5, 2.0) - 0.02f32.ln()).abs() < 1e-3, "never ruled out");
        // Twice as loose, squared: half of the exponent.
        let mut twice = carried.clone();
        twice.loosen(&MOTION);
        let found = twice.log_prior(&at(0.010, 0.2, 0.0).pose());
        assert!((found - (0.98 * (-0.5f32).exp() + 0.02).ln()).abs() < 1e-3);
    }

    #[test]
    fn the_likelier_pose_of_before_counts_for_more_and_nothing_known_says_nothing() {
        let carried = Carried::of(&[at(0.0, 0.0, 2.0), at(0.3, 0.0, 1.0)], &MOTION);
        let prior = |x| carried.log_prior(&at(x, 0.0, 0.0).pose());
        // Shares e/(e + 1) and 1/(e + 1).
        let share = 1.0f32.exp() / (1.0f32.exp() + 1.0);
        assert!((prior(0.0) - (0.98 * share + 0.02).ln()).abs() < 1e-4);
        assert!((prior(0.3) - (0.98 * (1.0 - share) + 0.02).ln()).abs() < 1e-4);
        assert!(Carried::default().log_prior(&at(0.1, 0.0, 0.0).pose()).abs() < 1e-9);
    }
}
