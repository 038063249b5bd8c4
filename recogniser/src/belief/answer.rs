//! Which hypotheses are answered: each stands for all that look like it.
//!
//! Hypotheses in different members of one orbit of the object's symmetry are one answer with
//! their probabilities added. Not here: refining what is answered.

use std::sync::Arc;

use glam::DQuat;

use super::hypothesis::Hypothesis;
use super::options::SurfaceOptions;
use crate::surface::SurfaceMap;
use palpate_core::belief::orbits::OrbitScale;
use palpate_core::log_prob::log_sum_exp;
use palpate_core::pose::Pose;
use palpate_core::symmetry::Symmetry;

/// Hypotheses of less than this share of the belief add nothing to an answer.
const SHARE_MIN: f64 = 1e-6;

/// A hypothesis and its share of the belief.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share {
    pub(super) share: f64,
    /// Of which belief it is, of an object that rests or moves.
    pub(super) belief: usize,
    pub(super) object: usize,
    pub(super) hypothesis: Hypothesis,
}

/// The shares of an object's hypotheses (best first) that may be among `n` answers, or add to
/// one of them. `probability` is the object's in a belief.
pub(super) fn shares<'a>(
    [belief, object]: [usize; 2],
    probability: f64,
    hypotheses: &'a [Hypothesis],
    symmetry: &'a Symmetry,
    n: usize,
) -> impl Iterator<Item = Share> + 'a {
    let total = log_sum_exp(hypotheses.iter().map(|h| f64::from(h.score)));
    let shares = hypotheses.iter().map(move |hypothesis| {
        let share = probability * (f64::from(hypothesis.score) - total).exp();
        Share { share, belief, object, hypothesis: *hypothesis }
    });
    let is_symmetric = !symmetry.is_none();
    let counts = move |(rank, found): &(usize, Share)| {
        *rank < n || (is_symmetric && found.share >= SHARE_MIN)
    };
    shares.enumerate().filter(counts).map(|(_, found)| found)
}

/// At most `n` hypotheses that look different, each with the share of all that look like it,
/// the likeliest first.
pub(super) fn distinct(
    mut all: Vec<Share>,
    maps: &[Arc<SurfaceMap>],
    n: usize,
    options: &SurfaceOptions,
) -> Vec<Share> {
    all.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.object.cmp(&b.object)));
    let mut kept: Vec<Share> = Vec::with_capacity(n);
    for found in all {
        let symmetry = maps[found.object].symmetry();
        // Within a belief what is one pose was merged before.
        let same = |other: &Share| {
            other.object == found.object
                && (other.belief != found.belief || !symmetry.is_none())
                && looks_like(&other.hypothesis, &found.hypothesis, symmetry, options)
        };
        match kept.iter().position(same) {
            Some(other) => kept[other].share += found.share,
            None if kept.len() < n => kept.push(found),
            None => {}
        }
    }
    kept.sort_by(|a, b| b.share.total_cmp(&a.share));
    kept
}

/// Whether two hypotheses of an object are one, or in one orbit of its symmetry.
pub(super) fn looks_like(
    first: &Hypothesis,
    second: &Hypothesis,
    symmetry: &Symmetry,
    options: &SurfaceOptions,
) -> bool {
    let scale = scale(options);
    symmetry.look_alike(&pose(first), &pose(second), scale.distance, scale.angle)
}

/// What is one hypothesis is one answer.
pub(super) fn scale(options: &SurfaceOptions) -> OrbitScale {
    let SurfaceOptions { merge_distance, merge_angle, .. } = *options;
    OrbitScale { distance: f64::from(merge_distance), angle: f64::from(merge_angle) }
}

/// The pose of a hypothesis, relative to the session's anchor.
fn pose(hypothesis: &Hypothesis) -> Pose {
    let rotation = DQuat::from_array(hypothesis.rotation.to_array().map(f64::from));
    Pose::from_parts(rotation, hypothesis.translation.as_dvec3())
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use glam::{DVec3, Quat, Vec3};

    use super::*;
    use crate::surface::map::SurfaceLayout;
    use palpate_core::symmetry::AxisOrder;

    fn maps() -> Vec<Arc<SurfaceMap>> {
        let map = || SurfaceMap::new(DVec3::ZERO, Vec::new(), SurfaceLayout::default());
        let half = Symmetry::through(DVec3::ZERO, &[(DVec3::Z, AxisOrder::Finite(2))]);
        vec![Arc::new(map().with_symmetry(half)), Arc::new(map())]
    }

    /// Turned by an angle about z; weights as ln scores.
    fn turned(angle: f32, weight: f32) -> Hypothesis {
        let rotation = Quat::from_rotation_z(angle);
        Hypothesis { rotation, translation: Vec3::ZERO, score: weight.ln() }
    }

    /// Objects and shares of at most `n` answers.
    fn answered(n: usize) -> Vec<(usize, f64)> {
        let (maps, options) = (maps(), SurfaceOptions::default());
        let hypotheses = [turned(0.0, 5.0), turned(PI, 4.0), turned(1.0, 1.0)];
        let mut all = Vec::new();
        for (object, probability) in [0.6, 0.4].into_iter().enumerate() {
            all.extend(shares([0, object], probability, &hypotheses, maps[object].symmetry(), n));
        }
        distinct(all, &maps, n, &options).iter().map(|found| (found.object, found.share)).collect()
    }

    #[track_caller]
    fn check(n: usize, expected: &[(usize, f64)]) {
        let found = answered(n);
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!(found.0, expected.0);
            assert!((found.1 - expected.1).abs() < 1e-6, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn half_turns_of_a_symmetric_object_are_one_answer_and_of_another_two() {
        // Of the first 0.6 · (5 + 4)/10 and 0.6/10, of the second 0.4 times 5, 4, 1 in ten.
        check(5, &[(0, 0.54), (1, 0.2), (1, 0.16), (0, 0.06), (1, 0.04)]);
    }

    #[test]
    fn what_is_not_listed_still_adds_to_what_looks_like_it() {
        check(1, &[(0, 0.54)]);
        check(0, &[]);
    }
}
