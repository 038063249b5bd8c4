//! Tests of proposals by a component, and of the evidence of two touches.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::object::ObjectIdx;
use palpate_core::reading::Looseness;

use super::*;
use crate::belief::pair_weight::{density_anywhere, pair_evidence, usual_density};
use crate::belief::posterior::log_posterior;
use crate::belief::stated_search::pair_correction;
use crate::model::SurfaceModel;
use crate::observe::touch::Touch;
use crate::options::SurfaceOptions;
use crate::pose_prior::{PoseHypothesis, PosePrior};
use crate::propose::proposals::PairEvidence;
use crate::test_support::{error, model_of, places, seen, single, some_pose};
use crate::verify::stated_prior::{StatedPrior, Statement};

fn common(objects: &[Vec<Touch>]) -> Common {
    Common::new(model_of(objects), SurfaceOptions::default(), None).unwrap()
}

/// Random places on each of `n` objects.
fn objects(n: u64, n_places: usize) -> Vec<Vec<Touch>> {
    (0..n).map(|index| places(n_places, index)).collect()
}

/// A component that has observed these places of an object, but concluded nothing.
fn observed(common: &Common, places: &[&Touch]) -> Component {
    let mut component = Component::new(Motion::Rest, common);
    for place in places {
        let touch = Some(seen(place, &some_pose(5)));
        component.observe(&Observed { touch, spaces: Vec::new() });
    }
    component
}

#[test]
fn an_unsteady_touch_proposes_nothing_once_poses_are_good() {
    let first = places(200, 0);
    // A second object just like the first one, of which no pose is known yet.
    let common = common(&[first.clone(), first.clone()]);
    let after = |evenness, is_known| {
        let newest = Touch { evenness, ..first[80].clone() };
        let mut component = observed(&common, &[&first[20], &first[40], &first[60], &newest]);
        let (rotation, translation) = single(&some_pose(5));
        let hypothesis = Hypothesis::new(rotation, translation, 60.0);
        let hypotheses = if is_known { vec![hypothesis] } else { Vec::new() };
        let known = ObjectBelief { hypotheses, ..ObjectBelief::new(0.0) };
        component.conclude(Stage::Poses, vec![known, ObjectBelief::new(0.0)], Places::default());
        component.propose_in_doubt(&common, true, false);
        let best = component.objects[1].hypotheses.first();
        best.is_some_and(|h| error(h.rotation, h.translation, &some_pose(5)).0 < 0.003)
    };
    assert!(after(1.0, true), "two objects are as likely");
    assert!(!after(0.2, true), "the next touch will do");
    assert!(after(0.2, false), "there is nothing else to go by");
}

#[test]
fn a_rejected_object_keeps_no_other_from_the_search() {
    let first = places(200, 0);
    let model = model_of(&[first.clone(), first.clone()]);
    // The first object explains five touches well, the second is 45 behind and has no pose.
    let found_at = |log_odds_of_none: f64| {
        let options = SurfaceOptions::default();
        let mut calibration = model.calibration;
        let component_of = |common: &Common| {
            let touched: Vec<&Touch> = (1..=5).map(|n| &first[20 * n]).collect();
            let mut component = observed(common, &touched);
            let (rotation, translation) = single(&some_pose(6));
            let hypotheses = vec![Hypothesis::new(rotation, translation, 45.0)];
            let known = ObjectBelief { hypotheses, log_evidence: 45.0, ..ObjectBelief::new(0.0) };
            component.conclude(
                Stage::Poses,
                vec![known, ObjectBelief::new(0.0)],
                Places::default(),
            );
            component
        };
        let common = Common::new(Arc::clone(&model), options, None).unwrap();
        let logs = log_posterior(&common, &component_of(&common).explained());
        let stage = &mut calibration.stages[2];
        stage.unknown += stage.temperature * (log_odds_of_none - (logs[2] - logs[0]));
        let model = Arc::new(SurfaceModel::clone(&model).with_calibration(calibration));
        let common = Common::new(model, options, None).unwrap();
        let mut component = component_of(&common);
        assert!(!component.is_poor(&common));
        component.propose_in_doubt(&common, true, false);
        let best = component.objects[1].hypotheses.first();
        best.is_some_and(|h| error(h.rotation, h.translation, &some_pose(5)).0 < 0.003)
    };
    assert!(!found_at(-2.0), "the first object is likely: the second is left behind");
    assert!(found_at(2.0), "none of these is likely: every object is searched");
}

#[test]
fn after_two_touches_candidates_have_poses_and_all_have_scores() {
    let all = objects(90, 60);
    let common = common(&all);
    let mut component = observed(&common, &[&all[2][3], &all[2][50]]);
    component.propose_by_first_pair(&common);
    let objects = component.objects;
    let posed = objects.iter().filter(|object| !object.hypotheses.is_empty()).count();
    assert!((32..=64).contains(&posed), "{posed}");
    assert!(objects.iter().all(|object| object.retrieval_score.is_normal()));
    // Objects off the list get no pose hypotheses.
    let bar = retrieval_bar(&objects, 64);
    let mut off = objects.iter().filter(|object| object.retrieval_score < bar);
    assert!(off.clone().count() > 20 && off.all(|object| object.hypotheses.is_empty()));
}

/// A component that felt two patches of object 2, beside a statement that names it and its pose; with
/// the ln of the objects' priors.
fn told(common: &Common, all: &[Vec<Touch>]) -> (Component, Vec<f64>) {
    let hypothesis = PoseHypothesis {
        object: Some(ObjectIdx(2)),
        session_from_object: some_pose(5),
        covariance: PoseHypothesis::diagonal(0.01, 0.17),
        weight: 1.0,
    };
    let said = PosePrior { hypotheses: vec![hypothesis], ..PosePrior::default() };
    let statement = Arc::new(Statement::new(&said, &common.prior.log_objects, 0.04).unwrap());
    let log_priors = statement.log_objects.clone();
    let stated = StatedPrior::new(statement, DVec3::ZERO, &common.options);
    let mut component = observed(common, &[&all[2][3], &all[2][50]]);
    component.state(Some(Arc::new(stated)));
    component.propose_by_first_pair(common);
    (component, log_priors)
}

#[test]
fn an_unlucky_pair_does_not_outweigh_a_stated_pose() {
    let all = objects(40, 60);
    let common = common(&all);
    let (mut component, log_priors) = told(&common, &all);
    // No stored pair of the true object is like the observed one, and another object has a hundred
    // times as many as usual.
    let usual = usual_density(&component.objects);
    component.objects[2].pair.evidence = 0.0;
    component.objects[2].hypotheses.clear();
    component.objects[7].pair.evidence = 100.0 * usual;
    component.weigh_pair(&common, 1.0);
    let log = |n: usize| component.objects[n].log_evidence + log_priors[n];
    assert!((0..40).all(|n| n == 2 || log(n) < log(2) - 3.0), "{} {}", log(2), log(7));
}

#[test]
fn stored_pairs_count_beside_stated_poses() {
    let all = objects(40, 60);
    let common = common(&all);
    let (mut component, _) = told(&common, &all);
    let usual = usual_density(&component.objects);
    let stated = Arc::clone(&component.stated.as_ref().unwrap().now);
    let mut object = component.objects[2].clone();
    object.log_evidence = pair_evidence(&object.pair, usual);
    let by_pairs = object.log_evidence + pair_correction(&object, &stated);
    let (mut by_poses, _) = told(&common, &all);
    by_poses.objects[2].log_evidence = object.log_evidence;
    let anywhere = density_anywhere([&by_poses.touches[0], &by_poses.touches[1]], &common.options);
    by_poses.weigh_stated(&common, (f64::from(usual) / anywhere).max(1.0));
    component.weigh_pair(&common, 1.0);
    let by_poses = by_poses.objects[2].log_evidence;
    let mean = (0.5 * (by_pairs.exp() + by_poses.exp())).ln();
    let found = component.objects[2].log_evidence;
    assert!((found - mean).abs() < 1e-6, "{found} {by_pairs} {by_poses}");
    assert!((by_pairs - by_poses).abs() > 0.1, "{by_pairs} {by_poses}");
}

#[test]
fn after_a_move_scores_begin_with_what_was_believed_before_it() {
    let common = common(&objects(3, 20));
    let mut component = Component::new(Motion::Rest, &common);
    component.objects[1].retrieval_score = 4.0;
    component.objects[2].is_ruled_out = true;
    component.move_on(None, &Looseness::default(), &[-0.5, -3.0, f64::NEG_INFINITY]);
    let scores = component.objects.iter().map(|object| object.retrieval_score);
    assert_eq!(scores.collect::<Vec<f64>>(), [0.0, -2.5, f64::NEG_INFINITY]);
}

#[test]
fn the_joint_table_and_an_objects_own_pairs_are_on_one_scale() {
    let all = objects(40, 60);
    let common = common(&all);
    let mut component = observed(&common, &[&all[2][3], &all[2][50]]);
    component.retrieve(&common, &[0]).unwrap();
    let by_table: Vec<PairEvidence> = component.objects.iter().map(|object| object.pair).collect();
    component.propose_by_first_pair(&common);
    let mut n_posed = 0;
    for (object, table) in component.objects.iter().zip(&by_table) {
        // With this few patches all are tabled, so that both are means over the same pairs.
        let PairEvidence { evidence, appearance, .. } = object.pair;
        assert!((evidence - table.evidence).abs() <= 1e-4 * evidence, "{table:?} {object:?}");
        assert!((appearance - table.appearance).abs() <= 1e-4 * appearance, "{table:?} {object:?}");
        n_posed += usize::from(!object.hypotheses.is_empty());
    }
    assert!(n_posed > 10 && by_table[2].evidence > 0.0, "{n_posed}");
}

#[test]
fn a_drifting_component_discounts_earlier_touches() {
    let all = objects(1, 60);
    let common = common(&all);
    let rest = observed(&common, &[&all[0][3], &all[0][50]]);
    let drifting = rest.drifting(Looseness { position: 0.01, angle: 0.1 });
    let weights = |component: &Component| -> Vec<f32> {
        component.touches.iter().map(|touch| touch.weight).collect()
    };
    assert_eq!(weights(&rest), [1.0, 1.0]);
    // Half at 10 mm, which is the amplitude.
    assert!((weights(&drifting)[0] - 0.5).abs() < 1e-6 && weights(&drifting)[1] > 1.0 - 1e-6);
    assert!(drifting.explained().motion.is_unannounced());
}

#[test]
fn the_pair_with_the_first_touch_counts_once() {
    let all = objects(40, 60);
    let common = common(&all);
    let first = &all[2][3];
    let beside = Touch { position: first.position + 0.004 * DVec3::X, ..first.clone() };
    let mut component = Component::new(Motion::Rest, &common);
    let mut scores = Vec::new();
    for place in [first, &beside, &all[2][50]] {
        scores = component.objects.iter().map(|object| object.retrieval_score).collect();
        let touch = seen(place, &some_pose(5)).weighed(&component.touches, None);
        component.add(&common, &Observed { touch: Some(touch), spaces: Vec::new() }, true);
    }
    let mut expected = common.objects();
    retrieve(&mut expected, &common.model, &component.touches, &[0, 1], &common.options).unwrap();
    for ((object, before), expected) in component.objects.iter().zip(scores).zip(expected) {
        let gain = object.retrieval_score - before;
        assert!((gain - expected.retrieval_score).abs() < 1e-9, "{gain} {expected:?}");
    }
}
