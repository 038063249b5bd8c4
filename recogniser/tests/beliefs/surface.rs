//! The surface recogniser on analytic objects: ellipsoids with varying contacts, no simulator.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::belief::MismatchError;
use palpate_core::belief::answer::Answer;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::observe::touch::observe_touch;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SAME_PLACE;

use crate::ellipsoids::*;

#[test]
fn unseen_touches_name_the_object_and_its_place() {
    for object in 0..N_OBJECTS {
        let truth = some_pose(object as u64);
        let answer = recognise(object, truth, 12).answer(3);
        assert_eq!(answer.best_object(), Some(ObjectIdx(object as u32)), "{answer:?}");
        assert!(answer.probabilities[object] > 0.95, "{answer:?}");
        assert_eq!(answer.n_readings, 12);
        let mode = &answer.modes[0];
        let error = mode.session_from_object.distance_to(&truth);
        assert!(error < 1.0 * MM, "object {object}: {error} m");
        // The stated deviation is at least a quarter of the error, along every axis.
        let off = mode.session_from_object.translation - truth.translation;
        for axis in 0..3 {
            let stated = mode.covariance[(axis, axis)].sqrt();
            assert!(off[axis].abs() < 4.0 * stated, "axis {axis}: {off} m, {stated} m");
        }
        let total = answer.probabilities.iter().sum::<f64>() + answer.unknown;
        assert!((total - 1.0).abs() < 1e-9);
        let shares: f64 = answer.modes.iter().map(|mode| mode.weight).sum();
        assert!(shares <= 1.0 + 1e-9, "{shares}");
    }
}

/// Checks that two answers are equal up to a motion of the session and rounding.
#[track_caller]
fn check_moved(answer: &Answer, moved: &Answer, motion: &Pose) {
    for (p, q) in answer.probabilities.iter().zip(&moved.probabilities) {
        assert!((p - q).abs() < 2e-3, "{answer:?}\n{moved:?}");
    }
    let expected = *motion * answer.modes[0].session_from_object;
    let found = moved.modes[0].session_from_object;
    assert!(found.distance_to(&expected) < 2e-5, "{} m", found.distance_to(&expected));
    assert!(found.angle_to(&expected) < 2e-3, "{} rad", found.angle_to(&expected));
}

#[test]
fn a_session_a_kilometre_away_gives_the_same_answer() {
    let far = Pose::from_parts(DQuat::IDENTITY, DVec3::new(1_000.0, -1_000.0, 500.0));
    for n in [1, 2, 3, 8] {
        let (near, away) = (recognise(1, Pose::IDENTITY, n), recognise(1, far, n));
        check_moved_if_posed(&near.answer(3), &away.answer(3), &far, n);
    }
}

#[test]
fn a_turned_session_gives_the_turned_answer() {
    let turned = some_pose(9);
    for n in [1, 2, 3, 8] {
        let (still, moved) = (recognise(0, Pose::IDENTITY, n), recognise(0, turned, n));
        check_moved_if_posed(&still.answer(3), &moved.answer(3), &turned, n);
    }
}

/// After few touches only the probabilities are compared, since poses tie.
#[track_caller]
fn check_moved_if_posed(answer: &Answer, moved: &Answer, motion: &Pose, n: usize) {
    if n > 4 {
        return check_moved(answer, moved, motion);
    }
    for (p, q) in answer.probabilities.iter().zip(&moved.probabilities) {
        assert!((p - q).abs() < 0.02, "{n}: {answer:?}\n{moved:?}");
    }
}

/// Enough objects that threads share them and candidates are retrieved; `n` and
/// `n + N_OBJECTS` are alike.
fn many() -> Arc<SurfaceModel> {
    let maps = (0..40).map(|n| MODEL.maps()[n % N_OBJECTS].clone()).collect();
    Arc::new(MODEL.with_maps(maps))
}

#[test]
fn the_right_one_of_many_is_named_from_few_candidates() {
    let model = many();
    assert!(model.joint_pairs().is_some() && MODEL.joint_pairs().is_none());
    let mut options = SurfaceOptions::default();
    // 7 of 40, and fewer with every touch.
    (options.budget.many.listed_per_root, options.budget.many.explored) = (1, 0);
    for object in 0..N_OBJECTS {
        let mut belief = SurfaceBelief::new(model.clone(), options, None).unwrap();
        for reading in touches(object, 12, 2) {
            belief.add(&reading, &six_by_six());
        }
        let answer = belief.answer(1);
        let alike = answer.probabilities.iter().skip(object).step_by(N_OBJECTS);
        assert!(alike.sum::<f64>() > 0.9, "{object}: {answer:?}");
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let model = many();
    let answer_with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut belief =
                SurfaceBelief::new(model.clone(), SurfaceOptions::default(), None).unwrap();
            for reading in touches(1, 6, 2) {
                belief.add(&reading, &six_by_six());
            }
            belief.answer(5)
        })
    };
    assert_eq!(answer_with(1), answer_with(4));
}

#[test]
fn a_press_that_touched_nothing_only_counts() {
    let nothing = Reading::new(SensorId(0), &six_by_six(), &[Some(0.0); 36], some_pose(1)).unwrap();
    for n in 0..4 {
        let mut belief = recognise(2, some_pose(2), n);
        let before = belief.answer(3);
        belief.add(&nothing, &six_by_six());
        let after = belief.answer(3);
        assert_eq!(after, Answer { n_readings: n + 1, ..before });
    }
}

#[test]
fn the_same_reading_again_does_not_undo_what_it_said() {
    for object in 0..N_OBJECTS {
        let reading = touches(object, 1, 2).remove(0);
        let mut belief = belief();
        belief.add(&reading, &six_by_six());
        let once = belief.answer(1);
        for _ in 0..3 {
            belief.add(&reading, &six_by_six());
        }
        let often = belief.answer(1);
        assert!((once.unknown - often.unknown).abs() < 1e-9, "{once:?} {often:?}");
        for (p, q) in once.probabilities.iter().zip(&often.probabilities) {
            assert!((p - q).abs() < 1e-9, "{once:?} {often:?}");
        }
        assert_eq!(often.n_readings, 4);
    }
}

#[test]
fn repeating_touches_makes_nobody_as_sure_as_new_ones() {
    let readings = touches(1, 6, 4);
    let entropy = |order: &[usize]| {
        let mut belief = belief();
        for index in order {
            belief.add(&readings[*index], &six_by_six());
        }
        belief.answer(1).entropy_bits
    };
    assert!(entropy(&[0, 1, 2, 3, 4, 5]) < entropy(&[0, 1, 0, 1, 0, 1]));
}

#[test]
fn a_finer_sensor_recognises_what_a_coarser_one_learnt() {
    let fine = SensorDescription::fingertip_14x14();
    for object in 0..N_OBJECTS {
        let mut stream = Stream::new(5, Purpose::Sampling, object as u64);
        let mut belief = belief();
        for _ in 0..10 {
            belief.add(&touch(object, &fine, &mut stream), &fine);
        }
        let answer = belief.answer(1);
        assert_eq!(answer.best_object(), Some(ObjectIdx(object as u32)), "{answer:?}");
        let error = answer.modes[0].session_from_object.translation.length();
        assert!(error < 1.5 * MM, "object {object}: {error} m");
    }
}

#[test]
fn the_prior_is_the_first_answer_and_rules_objects_out() {
    let prior = [1.0, 3.0, 0.0];
    let options = SurfaceOptions::default();
    let mut belief = SurfaceBelief::new(MODEL.clone(), options, Some(&prior)).unwrap();
    let answer = belief.answer(2);
    // "None of these" has 0.05, the object three quarters of the rest.
    assert!((answer.probabilities[1] - 0.7125).abs() < 1e-12 && answer.modes.is_empty());
    assert!((answer.unknown - 0.05).abs() < 1e-12);
    for reading in touches(2, 6, 2) {
        belief.add(&reading, &six_by_six());
    }
    assert!(belief.answer(2).probabilities[2].abs() < 1e-300);
}

#[test]
fn a_prior_of_the_wrong_length_is_refused() {
    let options = SurfaceOptions::default();
    let error = SurfaceBelief::new(MODEL.clone(), options, Some(&[1.0])).unwrap_err();
    assert_eq!(error, MismatchError::Prior { expected: N_OBJECTS, found: 1 });
}

#[test]
fn touches_of_one_place_differ_by_one_deviation() {
    let (sensor, readings) = (six_by_six(), touches(0, 600, 6));
    let seen: Vec<_> =
        readings.iter().filter_map(|r| observe_touch(r, &sensor, &MODEL.space)).collect();
    let (mut squares, mut n) = (0.0, 0.0);
    for (index, touch) in seen.iter().enumerate() {
        let near = seen[index + 1..].iter().filter(|other| {
            touch.position.distance(other.position) < SAME_PLACE
                && touch.normal.dot(other.normal) > 0.85
        });
        for other in near {
            squares += f64::from((touch.feature[0] - other.feature[0]).powi(2));
            n += 1.0;
        }
    }
    // The space was learnt on the nearest pairs, so that all pairs within reach differ somewhat
    // more.
    assert!(n > 100.0, "{n} pairs");
    let deviation = f64::sqrt(squares / n);
    assert!((0.5..2.0).contains(&deviation), "{deviation}");
}
