//! The answer of a session: probabilities of identity and the most likely poses.
//!
//! Poses are `session_from_object`. Neighbouring bins of one object form one mode: its pose
//! is their mean, its covariance their spread plus that within a bin.

use glam::{DQuat, DVec3};
use nalgebra::{Matrix6, Vector6};

use crate::log_prob::{entropy_bits, log_sum_exp, normalize};
use crate::object::ObjectIdx;
use crate::pose::Pose;

/// A belief in the form returned to clients.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The probability of each object of the catalogue, in its order; with `unknown` they sum
    /// to 1.
    pub probabilities: Vec<f64>,
    /// The probability of "none of these"; 0 for methods that do not consider it.
    pub unknown: f64,
    /// The most likely poses over all objects, best first.
    pub modes: Vec<PoseMode>,
    /// Entropy of the identity, bits.
    pub entropy_bits: f64,
    /// Number of readings.
    pub n_readings: usize,
    /// Where the touches say that the sensor truly is; `None` for methods that do not estimate it,
    /// and while no object is likelier than not.
    pub sensor_shift: Option<SensorShift>,
    /// Order of the images that explains the touches better than the stated one; `None` as for
    /// `sensor_shift`, and when none does.
    pub image_doubt: Option<ImageDoubt>,
}

/// How images look at the likeliest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageDoubt {
    /// The likelier order.
    pub order: LikelierOrder,
    /// ln of the likelihood of all touches in that order over that in the stated one.
    pub log_ratio: f64,
    /// Number of touches with an image.
    pub n_touches: usize,
}

/// Order of images relative to the stated one, as far as stretches of contacts tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LikelierOrder {
    /// Rows or columns are reversed.
    Mirrored,
    /// Rows and columns are exchanged.
    Transposed,
    /// The image, or the sensor, is turned by a quarter.
    Turned,
}

/// Place of the sensor relative to the stated one, shared by all touches, in the sensor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorShift {
    /// x, y, z, metres.
    pub shift: DVec3,
    /// Standard deviation of each, metres.
    pub deviation: DVec3,
    /// Number of touches it rests on.
    pub n_touches: usize,
}

impl Answer {
    /// The most likely object; ties go to the first. `None` for an empty catalogue.
    #[must_use]
    pub fn best_object(&self) -> Option<ObjectIdx> {
        let best = self.probabilities.iter().enumerate().fold(None, |best, (object, p)| {
            if best.is_none_or(|(_, highest)| *p > highest) { Some((object, *p)) } else { best }
        });
        best.map(|(object, _)| ObjectIdx(object as u32))
    }

    /// The risk that the most probable answer, an object or "none of these", is wrong, if the
    /// client stops as soon as it is low enough, by a stop rule. `default_prior` is the prior of
    /// "none of these" if the session did not state one: the risk then allows for up to half of
    /// the objects being unknown.
    #[must_use]
    pub fn risk(&self, default_prior: Option<f64>, rule: StopRule) -> f64 {
        let known = self.probabilities.iter().copied().fold(0.0, f64::max);
        rule.risk(assured(known, self.unknown, default_prior))
    }
}

/// The probability of the most probable answer, an object with probability `known` or "none
/// of these", under the least favourable prior of "none of these". If the session stated a
/// prior, only that one counts; otherwise all priors from `default_prior` to one half.
#[must_use]
pub fn assured(known: f64, unknown: f64, default_prior: Option<f64>) -> f64 {
    if unknown >= known {
        // A higher prior of unknown objects would only raise it.
        return unknown;
    }
    let more = default_prior.map_or(1.0, |prior| ((1.0 - prior) / prior).max(1.0));
    known / (1.0 - unknown + unknown * more)
}

/// Excess and exponent of the stop rule: fitted on 2,400 sessions, half of unknown objects
/// (`palpate experiment unknown`, seed 101).
const EXCESS: f64 = 0.2;
const EXPONENT: f64 = 0.45;

/// How far the first answer that looks sure enough is overrated: stopping selects sessions that
/// are confident too early, the more so the higher the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopRule {
    /// Risk per (1 − p)^0.45; above 0.
    pub excess: f64,
}

impl Default for StopRule {
    fn default() -> Self {
        Self { excess: EXCESS }
    }
}

impl StopRule {
    /// The risk that an answer with probability `p` is wrong when it is the first one above a
    /// threshold: excess (1 − p)^0.45, never less than 1 − p.
    #[must_use]
    pub fn risk(self, p: f64) -> f64 {
        let doubt = (1.0 - p).max(0.0);
        (self.excess * doubt.powf(EXPONENT)).max(doubt)
    }
}

/// The risk by the default stop rule.
#[must_use]
pub fn stopping_risk(p: f64) -> f64 {
    StopRule::default().risk(p)
}

/// One cluster of likely poses of one object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseMode {
    /// The object.
    pub object: ObjectIdx,
    /// The mean pose of the object in the session frame.
    pub session_from_object: Pose,
    /// Covariance of x, y, z (m) and rotation about the session's fixed x, y, z axes (rad),
    /// in ROS order.
    pub covariance: Matrix6<f64>,
    /// The probability of this object in this mode.
    pub weight: f64,
}

/// A pose of an object with the ln of its unnormalised probability.
#[derive(Clone, Copy, Debug)]
pub struct WeightedPose {
    /// The object.
    pub object: ObjectIdx,
    /// The pose.
    pub session_from_object: Pose,
    /// ln of its weight, on one scale for all objects.
    pub log_weight: f64,
}

/// Extent of a mode, and the uncertainty of a single pose.
#[derive(Clone, Copy, Debug)]
pub struct ModeScale {
    /// Largest distance of a member from the mode's best pose, metres.
    pub distance: f64,
    /// Largest angle of a member from the mode's best pose, rad.
    pub angle: f64,
    /// Standard deviation of a single pose's position, metres.
    pub position_deviation: f64,
    /// Standard deviation of a single pose's rotation, rad.
    pub rotation_deviation: f64,
}

/// Builds an answer. `log_objects` are the unnormalised ln probabilities of the objects,
/// `poses` the best poses on the same scale; at most `n_modes` modes are returned.
#[must_use]
pub fn answer(
    log_objects: &[f64],
    mut poses: Vec<WeightedPose>,
    n_modes: usize,
    scale: &ModeScale,
    n_readings: usize,
) -> Answer {
    let probabilities = normalize(log_objects);
    let total = log_sum_exp(log_objects.iter().copied());
    poses.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight).then(a.object.cmp(&b.object)));
    let mut modes = Vec::new();
    let mut left = poses.into_iter();
    while modes.len() < n_modes
        && let Some(best) = left.next()
    {
        // The best pose is always a member, even if rounding gives it a distance to itself.
        let (near, others): (Vec<_>, Vec<_>) = left.partition(|pose| belongs(pose, &best, scale));
        let members: Vec<WeightedPose> = std::iter::once(best).chain(near).collect();
        modes.push(mode(&members, &best, total, scale));
        left = others.into_iter();
    }
    modes.sort_by(|a: &PoseMode, b| b.weight.total_cmp(&a.weight));
    let entropy_bits = entropy_bits(&probabilities);
    Answer {
        probabilities,
        unknown: 0.0,
        modes,
        entropy_bits,
        n_readings,
        sensor_shift: None,
        image_doubt: None,
    }
}

fn belongs(pose: &WeightedPose, best: &WeightedPose, scale: &ModeScale) -> bool {
    let (a, b) = (&pose.session_from_object, &best.session_from_object);
    pose.object == best.object && a.distance_to(b) <= scale.distance && a.angle_to(b) <= scale.angle
}

fn mode(
    members: &[WeightedPose],
    best: &WeightedPose,
    log_total: f64,
    scale: &ModeScale,
) -> PoseMode {
    let weights: Vec<f64> =
        members.iter().map(|member| (member.log_weight - best.log_weight).exp()).collect();
    let total: f64 = weights.iter().sum();
    let shares = || members.iter().zip(weights.iter().map(|weight| weight / total));

    let position: DVec3 =
        shares().map(|(m, share)| share * m.session_from_object.translation).sum();
    let rotation = shares().fold(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, (m, share)| {
        let q = m.session_from_object.rotation;
        let aligned = q.dot(best.session_from_object.rotation) < 0.0;
        sum + q * if aligned { -share } else { share }
    });
    let mean = Pose::from_parts(rotation, position);

    let single = Vector6::from_fn(|axis, _| {
        if axis < 3 { scale.position_deviation.powi(2) } else { scale.rotation_deviation.powi(2) }
    });
    let mut covariance = Matrix6::from_diagonal(&single);
    for (member, share) in shares() {
        let moved = member.session_from_object.translation - mean.translation;
        let turned = member.session_from_object.rotation * mean.rotation.conjugate();
        let turned = if turned.w < 0.0 { -turned } else { turned }.to_scaled_axis();
        let off = Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z);
        covariance += share * off * off.transpose();
    }
    let weight = (best.log_weight - log_total).exp() * total;
    PoseMode { object: best.object, session_from_object: mean, covariance, weight }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{DEG, MM};

    const SCALE: ModeScale =
        ModeScale { distance: 0.012, angle: 0.7, position_deviation: 0.0, rotation_deviation: 0.0 };

    fn weighted(object: u32, x: f64, angle: f64, weight: f64) -> WeightedPose {
        let pose = Pose::from_parts(DQuat::from_rotation_z(angle), DVec3::new(x, 0.0, 0.0));
        WeightedPose {
            object: ObjectIdx(object),
            session_from_object: pose,
            log_weight: weight.ln(),
        }
    }

    #[test]
    fn neighbouring_poses_form_one_mode_and_far_ones_another() {
        let poses = vec![
            weighted(0, 0.0, 0.0, 0.4),
            weighted(0, 8.0 * MM, 0.0, 0.4),
            weighted(0, 90.0 * MM, 0.0, 0.1),
            weighted(1, 0.0, 0.0, 0.1),
        ];
        let answer = answer(&[0.9_f64.ln(), 0.1_f64.ln()], poses, 5, &SCALE, 3);
        assert_eq!(answer.modes.len(), 3);
        let first = &answer.modes[0];
        assert!((first.weight - 0.8).abs() < 1e-9);
        assert!((first.session_from_object.translation.x - 4.0 * MM).abs() < 1e-9);
        // Two poses ±4 mm from their mean: variance 16 mm².
        assert!((first.covariance[(0, 0)] - 16e-6).abs() < 1e-12);
        assert_eq!(answer.best_object(), Some(ObjectIdx(0)));
    }

    #[test]
    fn rotations_spread_about_the_fixed_axes() {
        let poses = vec![weighted(0, 0.0, 10.0 * DEG, 0.5), weighted(0, 0.0, -10.0 * DEG, 0.5)];
        let answer = answer(&[0.0], poses, 1, &SCALE, 2);
        let mode = &answer.modes[0];
        assert!(mode.session_from_object.angle_to(&Pose::IDENTITY) < 1e-9);
        assert!((mode.covariance[(5, 5)] - (10.0 * DEG).powi(2)).abs() < 1e-9);
    }

    #[test]
    fn a_scale_of_zero_makes_every_pose_a_mode() {
        let alone = ModeScale { distance: 0.0, angle: 0.0, ..SCALE };
        // An angle whose quaternion has rounded components: its angle to itself is not 0.
        let poses = vec![weighted(0, 0.1, 0.7, 0.6), weighted(0, 0.1, 1.1, 0.4)];
        let answer = answer(&[0.0], poses, 5, &alone, 2);
        assert_eq!(answer.modes.len(), 2);
        assert!((answer.modes[0].weight - 0.6).abs() < 1e-12);
        assert!(answer.modes.iter().all(|mode| mode.session_from_object.rotation.is_finite()));
    }

    #[test]
    fn without_a_stated_prior_half_of_the_objects_may_be_unknown() {
        // Odds of none of these of 0.01 : 0.99 at a prior of 0.05 are nineteen times that at ½.
        let even = 0.99 / (0.99 + 19.0 * 0.01);
        assert!((assured(0.99, 0.01, Some(0.05)) - even).abs() < 1e-12);
        assert!((assured(0.99, 0.01, None) - 0.99).abs() < 1e-12);
        assert!((assured(0.99, 0.01, Some(0.8)) - 0.99).abs() < 1e-12, "more than half were");
        // "None of these" is likeliest: a higher prior would only make it surer.
        assert!((assured(0.1, 0.9, Some(0.05)) - 0.9).abs() < 1e-12);
        assert!((assured(0.6, 0.0, Some(0.05)) - 0.6).abs() < 1e-12, "no such answer");
    }

    #[test]
    fn a_certain_answer_has_zero_entropy() {
        let answer = answer(&[0.0, -1e4], vec![], 3, &SCALE, 9);
        assert!(answer.entropy_bits.abs() < 1e-12 && answer.modes.is_empty());
    }
}
