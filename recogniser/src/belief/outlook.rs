//! What a belief expects: objects in poses with probabilities, for choosing where to touch next.
//!
//! From the second touch on these are the hypotheses. After the first one there is no pose
//! yet, but the touch was somewhere on the object: poses are drawn that lay a mapped touch
//! which looks like it onto it, turned about its normal. Poses are `session_from_object`.

use glam::{DQuat, DVec3};

use super::SurfaceBelief;
use super::stretch::aligned;
use crate::model::SurfaceModel;
use palpate_core::log_prob::normalize;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;

/// Objects less probable than this get no pose.
const PROBABILITY_MIN: f64 = 1e-3;

/// The fewest poses of an object that gets some, as far as it has them.
const POSES_MIN: usize = 4;

/// Turns of a mapped touch about its normal among which a pose is drawn.
const N_TURNS: usize = 12;

/// An object in a pose, and how probable that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// The object.
    pub object: ObjectIdx,
    /// Its pose.
    pub session_from_object: Pose,
    /// Its share of the belief, 0 to 1.
    pub probability: f64,
}

impl SurfaceBelief {
    /// What the belief knows the objects by.
    #[must_use]
    pub fn model(&self) -> &SurfaceModel {
        &self.model
    }

    /// How many readings touched something.
    #[must_use]
    pub fn n_touches(&self) -> usize {
        self.touches.len()
    }

    /// The probability of each object, then of none of them.
    #[must_use]
    pub fn shares(&self) -> Vec<f64> {
        self.probabilities()
    }

    /// About `n` of the likeliest objects in poses; nothing before the first touch. The
    /// probabilities are given that it is one of the known objects, and sum to 1 less what is
    /// left out.
    #[must_use]
    pub fn expected(&self, n: usize, stream: &mut Stream) -> Vec<Expected> {
        if self.touches.is_empty() {
            return Vec::new();
        }
        let mut expected = Vec::with_capacity(n);
        let probable = self.probable_objects();
        let leader = self.leader();
        let hypotheses_of = |object: ObjectIdx| &leader.objects[object.0 as usize].hypotheses;
        let have_poses = probable.iter().any(|(object, _)| !hypotheses_of(*object).is_empty());
        for (object, share) in probable {
            let wanted = ((n as f64 * share).round() as usize).max(POSES_MIN);
            if !have_poses {
                self.lay_onto_first_touch(object, share, wanted, stream, &mut expected);
                continue;
            }
            let hypotheses = hypotheses_of(object);
            let kept = &hypotheses[..wanted.min(hypotheses.len())];
            let logs: Vec<f64> = kept.iter().map(|h| f64::from(h.score)).collect();
            let weighed = kept.iter().zip(normalize(&logs));
            expected.extend(weighed.map(|(hypothesis, weight)| Expected {
                object,
                session_from_object: self.session_from_object(hypothesis),
                probability: share * weight,
            }));
        }
        expected
    }

    /// Objects worth a pose with their probabilities, given that it is a known one.
    fn probable_objects(&self) -> Vec<(ObjectIdx, f64)> {
        let mut shares = self.probabilities();
        shares.pop();
        let known: f64 = shares.iter().sum();
        let even = 1.0 / shares.len().max(1) as f64;
        let of_known = |share: f64| if known > 0.0 { share / known } else { even };
        let shares = shares.into_iter().map(of_known).enumerate();
        let probable = shares.filter(|(_, share)| *share >= PROBABILITY_MIN);
        probable.map(|(object, share)| (ObjectIdx(object as u32), share)).collect()
    }

    /// Draws poses of an object whose only touch is known, by systematic sampling.
    fn lay_onto_first_touch(
        &self,
        object: ObjectIdx,
        share: f64,
        n: usize,
        stream: &mut Stream,
        expected: &mut Vec<Expected>,
    ) {
        let (touch, map) = (&self.touches[0], &self.model.maps()[object.0 as usize]);
        let mut weights = Vec::with_capacity(map.patches().len() * N_TURNS);
        for patch in map.patches() {
            let looks = touch.appearance(&patch.feature);
            let stretch = self.options.scale.direction * patch.elongation * touch.elongation;
            weights.extend((0..N_TURNS).map(|turn| {
                let angle = std::f32::consts::TAU * turn as f32 / N_TURNS as f32;
                looks * aligned(stretch, angle.cos(), touch.steadiness.stretch_outliers)
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
                let session_from_patch = frame(touch.normal, touch.direction) * turned;
                let object_from_patch = frame(patch.normal, patch.direction);
                let rotation = (session_from_patch * object_from_patch.conjugate()).normalize();
                let position = self.anchor + touch.position.as_dvec3();
                let translation = position - rotation * patch.position.as_dvec3();
                let session_from_object = Pose::from_parts(rotation, translation);
                let probability = share / n as f64;
                expected.push(Expected { object, session_from_object, probability });
            }
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
