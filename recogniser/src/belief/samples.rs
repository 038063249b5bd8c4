//! Posterior samples: objects in poses with probabilities, for the choice of the next touch.
//!
//! From two places on these are the hypotheses. After touches of one place there is no pose
//! yet; poses are drawn that lay a patch of similar appearance onto the first touch.

use glam::{DQuat, DVec3};
use palpate_core::log_prob::normalize;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;

use super::common::Common;
use super::object::ObjectBelief;
use crate::observe::observation::{Observation, Says};
use crate::observe::stretch::stretch_ratio;

/// Probability below which an object, or all poses of a kind, get no sample.
const PROBABILITY_MIN: f64 = 1e-3;

/// Minimum number of poses of an object that gets any, if it has this many.
const POSES_MIN: usize = 4;

/// Number of rotations of a patch about its normal among which a pose is drawn.
const N_TURNS: usize = 12;

/// An object in a pose, with its probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSample {
    /// The object.
    pub object: ObjectIdx,
    /// Its pose.
    pub session_from_object: Pose,
    /// Its share of the belief, 0 to 1.
    pub probability: f64,
}

impl PoseSample {
    /// The index of its object.
    pub(crate) fn index(&self) -> usize {
        self.object.0 as usize
    }
}

/// State from which poses are drawn.
#[derive(Clone, Copy)]
pub(super) struct Posed<'a> {
    pub(super) anchor: DVec3,
    pub(super) touches: &'a [Observation],
    pub(super) objects: &'a [ObjectBelief],
    /// Probability that its poses explain the touches.
    pub(super) posed: f64,
}

/// About `n` poses of the likeliest objects; none before the first touch. `posterior` has the
/// probability of each object and then of "none of these".
pub(super) fn samples(
    common: &Common,
    posed: &Posed<'_>,
    posterior: &[f64],
    n: usize,
    stream: &mut Stream,
) -> Vec<PoseSample> {
    if posed.touches.is_empty() {
        return Vec::new();
    }
    let mut samples = Vec::with_capacity(n);
    let probable = probable_objects(posterior);
    let hypotheses_of = |object: ObjectIdx| &posed.objects[object.0 as usize].hypotheses;
    let have_poses = probable.iter().any(|(object, _)| !hypotheses_of(*object).is_empty());
    let posed_share = match posed.posed {
        share if !have_poses || share < PROBABILITY_MIN => 0.0,
        share if share > 1.0 - PROBABILITY_MIN => 1.0,
        share => share,
    };
    for (object, share) in probable {
        let wanted = |share: f64| ((n as f64 * share).round() as usize).max(POSES_MIN);
        if posed_share < 1.0 {
            let share = (1.0 - posed_share) * share;
            let laid = Laid { object, share, n: wanted(share) };
            lay_onto_first_touch(common, posed, &laid, stream, &mut samples);
        }
        if posed_share <= 0.0 {
            continue;
        }
        let (share, wanted) = (posed_share * share, wanted(posed_share * share));
        let hypotheses = hypotheses_of(object);
        let kept = &hypotheses[..wanted.min(hypotheses.len())];
        let logs: Vec<f64> = kept.iter().map(|h| f64::from(h.score)).collect();
        let weighed = kept.iter().zip(normalize(&logs));
        samples.extend(weighed.map(|(hypothesis, weight)| PoseSample {
            object,
            session_from_object: hypothesis.session_from_object(posed.anchor),
            probability: share * weight,
        }));
    }
    samples
}

/// Objects probable enough for a pose, with their probabilities given that the object is a known
/// one.
fn probable_objects(posterior: &[f64]) -> Vec<(ObjectIdx, f64)> {
    let shares = posterior.split_last().map_or(posterior, |(_, known)| known);
    let known: f64 = shares.iter().sum();
    let even = 1.0 / shares.len().max(1) as f64;
    let of_known = |share: &f64| if known > 0.0 { share / known } else { even };
    let shares = shares.iter().map(of_known).enumerate();
    let probable = shares.filter(|(_, share)| *share >= PROBABILITY_MIN);
    probable.map(|(object, share)| (ObjectIdx(object as u32), share)).collect()
}

/// An object that is laid onto a touch in `n` poses, with its share of the belief.
struct Laid {
    object: ObjectIdx,
    share: f64,
    n: usize,
}

/// Draws poses of an object from a single touch by systematic sampling: a patch of similar
/// appearance is laid onto the touch and rotated about its normal.
fn lay_onto_first_touch(
    common: &Common,
    posed: &Posed<'_>,
    &Laid { object, share, n }: &Laid,
    stream: &mut Stream,
    samples: &mut Vec<PoseSample>,
) {
    let (touch, map) = (&posed.touches[0], &common.model.maps()[object.0 as usize]);
    let mut weights = Vec::with_capacity(map.patches().len() * N_TURNS);
    for patch in map.patches() {
        let ratio = touch.appearance_ratio(&patch.feature);
        let stretch = common.options.scale.direction * patch.elongation * touch.elongation;
        weights.extend((0..N_TURNS).map(|turn| {
            let angle = std::f32::consts::TAU * turn as f32 / N_TURNS as f32;
            ratio * stretch_ratio(stretch, angle.cos(), touch.steadiness.stretch_outliers)
        }));
    }
    let step = weights.iter().map(|weight| f64::from(*weight)).sum::<f64>() / n as f64;
    let mut next = step * stream.uniform(0.0, 1.0);
    let mut sum = 0.0;
    for (place, weight) in weights.iter().enumerate() {
        sum += f64::from(*weight);
        while next < sum {
            next += step;
            let patch = &map.patches()[place / N_TURNS];
            let jitter = stream.uniform(-0.5, 0.5);
            let turn = ((place % N_TURNS) as f64 + jitter) / N_TURNS as f64;
            let frame = |normal: glam::Vec3, direction: glam::Vec3| {
                frame(normal.as_dvec3(), direction.as_dvec3())
            };
            let turned = DQuat::from_rotation_z(std::f64::consts::TAU * turn);
            let session_from_patch = match touch.says {
                // Nothing is known about the orientation.
                Says::Position => stream.rotation(),
                _ => frame(touch.normal, touch.direction) * turned,
            };
            let object_from_patch = frame(patch.normal, patch.direction);
            let rotation = (session_from_patch * object_from_patch.conjugate()).normalize();
            let position = posed.anchor + touch.position.as_dvec3();
            let translation = position - rotation * patch.position.as_dvec3();
            let session_from_object = Pose::from_parts(rotation, translation);
            let probability = share / n as f64;
            samples.push(PoseSample { object, session_from_object, probability });
        }
    }
}

/// The rotation whose z is a normal and whose x is a direction at right angles to it, both of
/// norm 1.
fn frame(normal: DVec3, direction: DVec3) -> DQuat {
    let x = (direction - direction.dot(normal) * normal).try_normalize();
    let x = x.unwrap_or_else(|| normal.any_orthonormal_vector());
    DQuat::from_mat3(&glam::DMat3::from_cols(x, normal.cross(x), normal))
}
