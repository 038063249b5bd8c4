//! Tests of the mixture over motion, with components whose evidence is given.

use super::*;
use crate::belief::object::ObjectBelief;
use crate::belief::places::Places;
use crate::test_support::{model_of, places, seen, some_pose};
use crate::verify::hypothesis::Hypothesis;

/// Joint probabilities of two objects, up to a common factor.
type Row = [f64; 2];

/// A hypothesis at `x` metres with a score.
fn at(x: f32, score: f32) -> Hypothesis {
    Hypothesis::new(glam::Quat::IDENTITY, glam::Vec3::X * x, score)
}

/// Gives a component one hypothesis of each object, and the evidence of its row.
fn conclude(component: &mut Component, common: &Common, log_prior: f64, row: Row, of: Hypothesis) {
    let blank = || ObjectBelief { hypotheses: vec![of], ..ObjectBelief::new(0.0) };
    component.conclude(Stage::Poses, vec![blank(), blank()], Places::default());
    let without = log_posterior(common, &component.explained());
    let temperature = common.model.calibration.stages[2].temperature;
    let object = |(share, log): (f64, f64)| {
        let log_evidence = temperature * (share.ln() - log - log_prior);
        ObjectBelief { log_evidence, ..blank() }
    };
    let objects = row.into_iter().zip(without).map(object).collect();
    component.conclude(Stage::Poses, objects, Places::default());
}

/// A belief after four touches in which rest has one row and pose, and one drifting component
/// another row and a pose at 1 m. "None of these" has what the calibration gives it.
fn mixture(rest: Row, rest_pose: Hypothesis, drift: Row) -> SurfaceBelief {
    let model = model_of(&[places(60, 0), places(60, 1)]);
    let mut belief = SurfaceBelief::new(model, SurfaceOptions::default(), None).unwrap();
    for place in places(4, 0) {
        let touch = Some(seen(&place, &some_pose(5)));
        belief.rest.observe(&Observed { touch, spaces: Vec::new() });
    }
    let mut drifting = belief.rest.drifting(Looseness { position: 0.003, angle: 0.05 });
    let [p_rest, p_drift] = [0, 1].map(|n| log_priors(1).nth(n).unwrap());
    conclude(&mut belief.rest, &belief.common, p_rest, rest, rest_pose);
    conclude(&mut drifting, &belief.common, p_drift, drift, at(1.0, 40.0));
    belief.drifting = vec![drifting];
    belief
}

/// Whether drift of this probability ends when the best pose at rest has this score after four
/// touches. The factor leaves nothing to "none of these".
fn drift_ends(share: f64, score: f32) -> bool {
    let row = |p: f64| [0.5e30 * p, 0.5e30 * p];
    let mut belief = mixture(row(1.0 - share), at(0.0, score), row(share));
    belief.doubt_rest();
    belief.drifting.is_empty()
}

#[test]
fn drift_ends_once_rest_explains_the_touches_and_is_certain() {
    // Four touches are explained poorly below 4 · 6.
    assert!(drift_ends(0.000_9, 25.0));
    assert!(!drift_ends(0.001_1, 25.0), "drift is not negligible");
    assert!(!drift_ends(0.000_9, 23.0), "rest explains the touches poorly");
}

#[test]
fn a_move_starts_from_the_component_that_leads_by_all_touches() {
    // Rest leads by 0.35 to 0.33. The objects have 0.31 and 0.37 together; these shares as the
    // prior of the same touches, which would then count twice, let drift lead by 0.36 to 0.33.
    let mut belief = mixture([0.30, 0.05], at(0.0, 40.0), [0.01, 0.32]);
    assert_eq!(belief.leader(), None);
    belief.announce_move(&Looseness { position: 0.005, angle: 0.1 });
    let objects = belief.rest.explained().objects;
    for object in objects {
        let (pose, _) = object.motion_prior.poses[0];
        assert!(pose.translation.length() < 1e-6, "{pose:?}");
    }
}
