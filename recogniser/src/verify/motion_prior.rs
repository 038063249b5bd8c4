//! The motion prior: density of an object's pose after an announced move (equation R15).
//!
//! Before any move it is the stated prior, if the session has one (equation R33).
//!
//! The search begins at the poses from before the move. Poses far from them, relative to the
//! stated motion, are less likely but never ruled out: the statement may be wrong.

use std::sync::Arc;

use nalgebra::Matrix6;
use palpate_core::reading::Looseness;

use super::hypothesis::Hypothesis;
use super::stated_prior::StatedPrior;
use crate::observe::inverse_pose::InversePose;

/// Maximum number of poses per object in the prior.
pub(crate) const POSES_MAX: usize = 8;

/// Number of touches that determine a pose by themselves.
const FIXED: usize = 3;

/// Share of moves that are larger than stated.
const WRONG: f32 = 0.02;

/// Least variance of the position (m²), and of the angle (rad²).
const VARIANCE_MIN: [f32; 2] = [1e-9, 1e-6];

/// Poses of one object from before it may have moved.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MotionPrior {
    /// Poses with their shares.
    pub(crate) poses: Vec<(InversePose, f32)>,
    /// Variance of the translation so far, m².
    pub(crate) position: f32,
    /// Variance of the rotation so far, rad².
    pub(crate) angle: f32,
    /// What the session states about its pose; `None` once it may have moved.
    pub(crate) stated: Option<StatedOf>,
}

/// A stated prior, of one object.
#[derive(Clone, Debug)]
pub(crate) struct StatedOf {
    pub(crate) prior: Arc<StatedPrior>,
    /// Index of the object.
    pub(crate) object: usize,
}

impl PartialEq for StatedOf {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.prior, &other.prior) && self.object == other.object
    }
}

impl MotionPrior {
    /// Heap bytes of its list.
    pub(crate) fn bytes(&self) -> usize {
        self.poses.capacity() * size_of::<(InversePose, f32)>()
    }

    /// The prior after a motion, by the best of an object's hypotheses.
    pub(crate) fn new(hypotheses: &[Hypothesis], motion: &Looseness) -> Self {
        let best = hypotheses.first().map_or(0.0, |hypothesis| hypothesis.score);
        let total: f32 = hypotheses.iter().map(|h| (h.score - best).exp()).sum();
        let at = |h: &Hypothesis| InversePose::new(h.rotation, h.translation);
        let pose = |h: &Hypothesis| (at(h), (h.score - best).exp() / total);
        let poses = hypotheses.iter().take(POSES_MAX).map(pose).collect();
        let (position, angle) = (motion.position.powi(2) as f32, motion.angle.powi(2) as f32);
        Self { poses, position, angle, stated: None }
    }

    /// Inflates it for one more move before the object was touched.
    pub(crate) fn inflate(&mut self, motion: &Looseness) {
        self.position += motion.position.powi(2) as f32;
        self.angle += motion.angle.powi(2) as f32;
    }

    /// Covariance that the motion adds to that of a pose (x, y, z in metres, then rad) until
    /// three touches have determined the pose.
    pub(crate) fn covariance(&self, n_touches: usize) -> Matrix6<f64> {
        let (p, r) = (f64::from(self.position), f64::from(self.angle));
        if n_touches >= FIXED {
            Matrix6::zeros()
        } else {
            Matrix6::from_diagonal(&[p, p, p, r, r, r].into())
        }
    }

    /// ln of the prior of a pose: by what the session states, and by the motion since.
    #[inline]
    pub(crate) fn log_density(&self, pose: &InversePose) -> f32 {
        let moved = self.log_moved(pose);
        if self.stated.is_none() { moved } else { moved + self.log_stated(pose) }
    }

    /// ln of the stated prior of a pose; 0 without a statement. Equation R33 of
    /// docs/camera-model.md.
    pub(crate) fn log_stated(&self, pose: &InversePose) -> f32 {
        let of = |stated: &StatedOf| stated.prior.log_density(stated.object, pose);
        self.stated.as_ref().map_or(0.0, of)
    }

    /// ln of the prior of a pose by motion: near 0 where the object was, at least ln of the share
    /// of wrong statements, and 0 if nothing is known. Equation R15 of docs/recogniser.md.
    fn log_moved(&self, pose: &InversePose) -> f32 {
        if self.poses.is_empty() {
            return 0.0;
        }
        let [position_min, angle_min] = VARIANCE_MIN;
        let near = |(before, weight): &(InversePose, f32)| {
            let moved = before.translation.distance_squared(pose.translation);
            let turned = before.angle_to(pose).powi(2);
            // Squares of 3 and 3 independent deviations.
            let square =
                moved / self.position.max(position_min) + turned / self.angle.max(angle_min);
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
        Hypothesis::new(rotation, translation, score)
    }

    const MOTION: Looseness = Looseness { position: 0.010, angle: 0.2 };

    #[test]
    fn a_pose_is_as_likely_as_the_motion_to_it() {
        let known = MotionPrior::new(&[at(0.0, 0.0, 5.0)], &MOTION);
        let prior = |x, angle| known.log_density(&at(x, angle, 0.0).inverse_pose());
        assert!(prior(0.0, 0.0).abs() < 1e-5);
        // One deviation each way: 0.98 · e⁻¹ + 0.02.
        assert!((prior(0.010, 0.2) - (0.98 * (-1.0f32).exp() + 0.02).ln()).abs() < 1e-3);
        assert!((prior(0.5, 2.0) - 0.02f32.ln()).abs() < 1e-3, "never ruled out");
        // Twice as loose, squared: half of the exponent.
        let mut twice = known.clone();
        twice.inflate(&MOTION);
        let found = twice.log_density(&at(0.010, 0.2, 0.0).inverse_pose());
        assert!((found - (0.98 * (-0.5f32).exp() + 0.02).ln()).abs() < 1e-3);
    }

    #[test]
    fn the_likelier_pose_of_before_counts_for_more() {
        let known = MotionPrior::new(&[at(0.0, 0.0, 2.0), at(0.3, 0.0, 1.0)], &MOTION);
        let prior = |x| known.log_density(&at(x, 0.0, 0.0).inverse_pose());
        // Shares e/(e + 1) and 1/(e + 1).
        let share = 1.0f32.exp() / (1.0f32.exp() + 1.0);
        assert!((prior(0.0) - (0.98 * share + 0.02).ln()).abs() < 1e-4);
        assert!((prior(0.3) - (0.98 * (1.0 - share) + 0.02).ln()).abs() < 1e-4);
        assert!(MotionPrior::default().log_density(&at(0.1, 0.0, 0.0).inverse_pose()).abs() < 1e-9);
    }
}
