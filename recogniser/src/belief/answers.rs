//! Answers: probabilities, and the hypotheses returned with them.
//!
//! A hypothesis represents all that look alike: those in one orbit of the object's symmetry
//! become one answer with the sum of their probabilities.

use glam::DVec3;
use palpate_core::belief::answer::{Answer, PoseMode, SensorShift};
use palpate_core::belief::orbits::merge_orbits;
use palpate_core::log_prob::{entropy_bits, log_sum_exp};
use palpate_core::object::ObjectIdx;
use palpate_core::symmetry::Symmetry;

use super::common::Common;
use super::image_doubt::image_doubt;
use super::object::ObjectBelief;
use crate::observe::observation::Observation;
use crate::options::SurfaceOptions;
use crate::refine::gauss_newton::{refine, uncertainty};
use crate::refine::likeness::{look_alike, orbit_scale};
use crate::verify::hypothesis::Hypothesis;

/// Hypotheses of less than this share of the belief add nothing to an answer.
const SHARE_MIN: f64 = 1e-6;

/// Probability below which a pose is returned without further refinement: robots do not move by
/// such poses.
const LIKELY_ENOUGH: f64 = 1e-3;

/// Probability of a pose from which its tool error is that of the session.
const LIKELY: f64 = 0.5;

/// Number of touches from which poses are refined; two touches do not determine a pose better
/// than its proposal.
const REFINED_FROM: usize = 3;

/// A component with the joint probabilities of its objects, "none of these" last.
#[derive(Clone, Copy)]
pub(super) struct Weighed<'a> {
    pub(super) touches: &'a [Observation],
    pub(super) objects: &'a [ObjectBelief],
    pub(super) joint: &'a [f64],
    /// Probability that its poses explain the touches.
    pub(super) posed: f64,
}

/// The answer with at most `n_modes` poses, without the number of readings. `posterior` has the
/// probability of each object, then of "none of these".
pub(super) fn answer(
    common: &Common,
    anchor: DVec3,
    components: &[Weighed<'_>],
    mut posterior: Vec<f64>,
    n_modes: usize,
) -> Answer {
    let entropy_bits = entropy_bits(&posterior);
    let unknown = posterior.pop().unwrap_or(0.0);
    let (model, options) = (&common.model, &common.options);
    let mut poses = Vec::new();
    for (component, of) in components.iter().enumerate() {
        for (object, belief) in of.objects.iter().enumerate() {
            let (place, symmetry) = ([component, object], model.symmetry(object));
            let probability = of.posed * of.joint[object];
            poses.extend(shares(place, probability, &belief.hypotheses, symmetry, n_modes));
        }
    }
    let poses = distinct(poses, |object| model.symmetry(object), n_modes, options);
    let (mut sensor_shift, mut doubt) = (None, None);
    let mode = |Share { share: weight, component, object, hypothesis }: Share| {
        let (of, map, kernel) = (&components[component], &model.maps()[object], &common.kernel);
        let (mut refined, n_touches) = (hypothesis, of.touches.len());
        if n_touches >= REFINED_FROM && weight > LIKELY_ENOUGH {
            refine(&mut refined, map, of.touches, kernel, options);
        }
        let found = uncertainty(&refined, map, of.touches, kernel, options);
        if weight > LIKELY && n_touches >= REFINED_FROM {
            let shift = refined.tool.as_dvec3();
            sensor_shift = Some(SensorShift { shift, deviation: found.tool, n_touches });
            doubt = image_doubt(of.touches, map, &refined.inverse_pose(), kernel);
        }
        PoseMode {
            object: ObjectIdx(object as u32),
            session_from_object: refined.session_from_object(anchor),
            covariance: found.pose + of.objects[object].motion_prior.covariance(n_touches),
            weight,
        }
    };
    let modes = poses.into_iter().map(mode).collect();
    let symmetry = |object: ObjectIdx| model.symmetry(object.0 as usize);
    let modes = merge_orbits(modes, symmetry, &orbit_scale(options));
    let probabilities = posterior;
    Answer {
        probabilities,
        unknown,
        modes,
        entropy_bits,
        n_readings: 0,
        sensor_shift,
        image_doubt: doubt,
    }
}

/// A hypothesis and its share of the belief.
#[derive(Clone, Copy, Debug)]
struct Share {
    share: f64,
    /// Its component of the belief.
    component: usize,
    object: usize,
    hypothesis: Hypothesis,
}

/// Shares of an object's hypotheses (best first) that may be among `n` answers, or add to one of
/// them. `probability` is the joint one of component and object.
fn shares<'a>(
    [component, object]: [usize; 2],
    probability: f64,
    hypotheses: &'a [Hypothesis],
    symmetry: &'a Symmetry,
    n: usize,
) -> impl Iterator<Item = Share> + 'a {
    let total = log_sum_exp(hypotheses.iter().map(|h| f64::from(h.score)));
    let shares = hypotheses.iter().map(move |hypothesis| {
        let share = probability * (f64::from(hypothesis.score) - total).exp();
        Share { share, component, object, hypothesis: *hypothesis }
    });
    let is_symmetric = !symmetry.is_none();
    let counts = move |(rank, found): &(usize, Share)| {
        *rank < n || (is_symmetric && found.share >= SHARE_MIN)
    };
    shares.enumerate().filter(counts).map(|(_, found)| found)
}

/// At most `n` distinct hypotheses, likeliest first, each with the total share of all hypotheses
/// that look alike.
fn distinct<'a>(
    mut all: Vec<Share>,
    symmetry_of: impl Fn(usize) -> &'a Symmetry,
    n: usize,
    options: &SurfaceOptions,
) -> Vec<Share> {
    all.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.object.cmp(&b.object)));
    let mut kept: Vec<Share> = Vec::with_capacity(n);
    for found in all {
        let symmetry = symmetry_of(found.object);
        // Equal poses within a component were merged before.
        let same = |other: &Share| {
            other.object == found.object
                && (other.component != found.component || !symmetry.is_none())
                && look_alike(&other.hypothesis, &found.hypothesis, symmetry, options)
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

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use glam::{DVec3, Quat, Vec3};

    use super::*;
    use crate::model::SurfaceMap;
    use crate::model::map::SurfaceLayout;
    use palpate_core::symmetry::AxisOrder;

    fn maps() -> Vec<SurfaceMap> {
        let map = || SurfaceMap::new(DVec3::ZERO, Vec::new(), SurfaceLayout::default());
        let half = Symmetry::through(DVec3::ZERO, &[(DVec3::Z, AxisOrder::Finite(2))]);
        vec![map().with_symmetry(half), map()]
    }

    /// A hypothesis turned by an angle about z; its score is the ln of `weight`.
    fn turned(angle: f32, weight: f32) -> Hypothesis {
        let rotation = Quat::from_rotation_z(angle);
        Hypothesis::new(rotation, Vec3::ZERO, weight.ln())
    }

    /// Objects and shares of at most `n` answers.
    fn answered(n: usize) -> Vec<(usize, f64)> {
        let (maps, options) = (maps(), SurfaceOptions::default());
        let hypotheses = [turned(0.0, 5.0), turned(PI, 4.0), turned(1.0, 1.0)];
        let mut all = Vec::new();
        for (object, probability) in [0.6, 0.4].into_iter().enumerate() {
            all.extend(shares([0, object], probability, &hypotheses, maps[object].symmetry(), n));
        }
        let symmetry = |object: usize| maps[object].symmetry();
        distinct(all, symmetry, n, &options)
            .iter()
            .map(|found| (found.object, found.share))
            .collect()
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
    fn half_turns_are_one_answer_only_if_the_object_is_symmetric() {
        // First object: 0.6 · (5 + 4)/10 and 0.6/10; second object: 0.4 times 5/10, 4/10 and 1/10.
        check(5, &[(0, 0.54), (1, 0.2), (1, 0.16), (0, 0.06), (1, 0.04)]);
    }

    #[test]
    fn a_pose_off_the_list_adds_to_the_one_it_looks_like() {
        check(1, &[(0, 0.54)]);
        check(0, &[]);
    }
}
