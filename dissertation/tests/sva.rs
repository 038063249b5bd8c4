//! Training and recognition on analytic objects: bumps on an ellipsoid, without a simulator.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::belief::MismatchError;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::{TrainingError, TrainingSet};
use palpate_core::units::MM;
use palpate_dissertation::sva::model::SvaModel;
use palpate_dissertation::sva::train::{
    SvaTrainError, TrainingConfig, learn_vocabulary, map_object,
};
use palpate_dissertation::sva::{SvaBelief, SvaOptions};

const N_OBJECTS: usize = 3;

/// Half axes of the ellipsoids, metres.
const HALF_AXES: [DVec3; N_OBJECTS] = [
    DVec3::new(0.040, 0.020, 0.012),
    DVec3::new(0.040, 0.032, 0.014),
    DVec3::new(0.040, 0.015, 0.030),
];

/// A touch of an ellipsoid whose appearance (a blob's width) varies along x and y.
fn touch(object: usize, stream: &mut Stream) -> Reading {
    let half = HALF_AXES[object];
    let on_sphere = stream.direction();
    let position = on_sphere * half;
    let normal = (on_sphere / half).normalize();
    let facing = DQuat::from_rotation_arc(DVec3::Z, -normal);
    let spin = DQuat::from_rotation_z(stream.uniform(0.0, std::f64::consts::TAU));
    let (width, height) = (1.2 + on_sphere.x, 1.2 + on_sphere.y);
    let pressures: Vec<Option<f64>> = (0..36)
        .map(|taxel| {
            let (x, y) = (f64::from(taxel % 6) - 2.5, f64::from(taxel / 6) - 2.5);
            let blob = (-0.5 * ((x / width).powi(2) + (y / height).powi(2))).exp();
            Some(12_000.0 * blob + 40.0 * stream.normal())
        })
        .collect();
    let pose = Pose::from_parts(facing * spin, position);
    Reading::new(SensorId(0), &SensorDescription::digitacts_6x6(), &pressures, pose).unwrap()
}

fn touches(object: usize, n: usize, seed: u64) -> Vec<Reading> {
    let mut stream = Stream::new(seed, Purpose::Sampling, object as u64);
    (0..n).map(|_| touch(object, &mut stream)).collect()
}

fn train() -> Arc<SvaModel> {
    let sensor = SensorDescription::digitacts_6x6();
    let readings: Vec<Vec<Reading>> = (0..N_OBJECTS).map(|o| touches(o, 300, 1)).collect();
    let sets: Vec<TrainingSet<'_>> =
        readings.iter().map(|readings| TrainingSet { readings, sensor: &sensor }).collect();
    let config = TrainingConfig::default();
    let vocabulary = learn_vocabulary(&sets, &config, 1).unwrap();
    let objects = sets
        .iter()
        .map(|set| Arc::new(map_object(set, &vocabulary, &config, Some(DVec3::ZERO)).unwrap()))
        .collect();
    Arc::new(SvaModel { vocabulary, association: config.association, objects })
}

fn recognise(
    catalogue: &Arc<SvaModel>,
    object: usize,
    session_from_object: Pose,
    n: usize,
) -> SvaBelief {
    let mut belief = SvaBelief::new(catalogue.clone(), SvaOptions::default(), None).unwrap();
    for reading in touches(object, n, 2) {
        let moved = reading.moved_by(session_from_object);
        belief.add(&moved, &SensorDescription::digitacts_6x6()).unwrap();
    }
    belief
}

#[test]
fn unseen_touches_give_the_object_and_its_pose() {
    let catalogue = train();
    for object in 0..N_OBJECTS {
        let mut stream = Stream::new(3, Purpose::ObjectPose, object as u64);
        let true_pose = Pose::from_parts(stream.rotation(), 0.5 * stream.direction());
        let answer = recognise(&catalogue, object, true_pose, 12).answer(3);
        assert_eq!(answer.best_object(), Some(ObjectIdx(object as u32)), "{answer:?}");
        assert_eq!(answer.n_readings, 12);
        let mode = &answer.modes[0];
        let error = mode.session_from_object.distance_to(&true_pose);
        assert!(error < 8.0 * MM, "object {object}: {error} m");
        assert!((answer.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let catalogue = train();
    let answer_with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| recognise(&catalogue, 1, Pose::IDENTITY, 6).answer(5))
    };
    assert_eq!(answer_with(1), answer_with(4));
}

#[test]
fn before_any_reading_the_prior_is_the_answer() {
    let prior = [1.0, 3.0, 0.0];
    let belief = SvaBelief::new(train(), SvaOptions::default(), Some(&prior)).unwrap();
    let probabilities = belief.answer(1).probabilities;
    assert!((probabilities[1] - 0.75).abs() < 1e-12 && probabilities[2].abs() < 1e-12);
}

#[test]
fn an_object_ruled_out_by_the_prior_stays_ruled_out() {
    let catalogue = train();
    let options = SvaOptions::default();
    let mut belief = SvaBelief::new(catalogue, options, Some(&[0.0, 1.0, 1.0])).unwrap();
    for reading in touches(0, 6, 2) {
        belief.add(&reading, &SensorDescription::digitacts_6x6()).unwrap();
    }
    let answer = belief.answer(8);
    assert!(answer.probabilities[0].abs() < 1e-300);
    assert!(answer.modes.iter().all(|mode| mode.object != ObjectIdx(0)));
}

#[test]
fn a_prior_of_the_wrong_length_is_refused() {
    let error = SvaBelief::new(train(), SvaOptions::default(), Some(&[1.0])).unwrap_err();
    assert_eq!(error, MismatchError::Prior { expected: 3, found: 1 });
}

#[test]
fn a_press_without_contact_changes_no_probability() {
    let catalogue = train();
    let mut belief = recognise(&catalogue, 2, Pose::IDENTITY, 5);
    let before = belief.answer(3);
    let sensor = SensorDescription::digitacts_6x6();
    let nothing = Reading::new(SensorId(0), &sensor, &[Some(0.0); 36], Pose::IDENTITY).unwrap();
    belief.add(&nothing, &sensor).unwrap();
    let after = belief.answer(3);
    assert_eq!(before.probabilities, after.probabilities);
    assert_eq!(after.n_readings, 6);
}

#[test]
fn a_sensor_of_another_shape_is_refused_with_both_shapes() {
    let sensor = SensorDescription::digitacts_6x8();
    let reading = Reading::new(SensorId(0), &sensor, &[Some(1.0); 48], Pose::IDENTITY).unwrap();
    let mut belief = SvaBelief::new(train(), SvaOptions::default(), None).unwrap();
    let error = belief.add(&reading, &sensor).unwrap_err();
    assert_eq!(error, MismatchError::Shape { rows: 6, cols: 6, found_rows: 6, found_cols: 8 });
    assert_eq!(belief.n_readings(), 0);
}

#[test]
fn the_literal_filter_recognises_too() {
    let catalogue = train();
    let mut belief = SvaBelief::new(catalogue, SvaOptions::literal(), None).unwrap();
    for reading in touches(1, 10, 2) {
        belief.add(&reading, &SensorDescription::digitacts_6x6()).unwrap();
    }
    assert_eq!(belief.answer(1).best_object(), Some(ObjectIdx(1)));
}

#[test]
fn training_without_contact_is_refused() {
    let sensor = SensorDescription::digitacts_6x6();
    let nothing = Reading::new(SensorId(0), &sensor, &[Some(0.0); 36], Pose::IDENTITY).unwrap();
    let set = TrainingSet { readings: &[nothing], sensor: &sensor };
    let error = learn_vocabulary(&[set], &TrainingConfig::default(), 1).unwrap_err();
    assert_eq!(error, TrainingError::NothingTouched.into());
}

#[test]
fn too_few_touches_are_refused() {
    let sensor = SensorDescription::digitacts_6x6();
    let readings = touches(0, 9, 1);
    let set = TrainingSet { readings: &readings, sensor: &sensor };
    let config = TrainingConfig::default();
    let vocabulary = learn_vocabulary(&[set], &config, 1).unwrap();
    let error = map_object(&set, &vocabulary, &config, None).unwrap_err();
    assert!(error.to_string().contains("9 training readings"), "{error}");
}

#[test]
fn every_descriptor_trains_except_mr8() {
    let sensor = SensorDescription::digitacts_6x6();
    let readings = touches(0, 40, 1);
    let set = TrainingSet { readings: &readings, sensor: &sensor };
    for descriptor in DescriptorKind::ALL {
        let config = TrainingConfig { descriptor, n_classes: 4, ..TrainingConfig::default() };
        match learn_vocabulary(&[set], &config, 1) {
            Ok(vocabulary) => {
                assert!(descriptor.gives_one_feature());
                assert_eq!(vocabulary.mean.len(), descriptor.plan(6, 6).dimension());
                let norm = vocabulary.medoids[0].iter().map(|value| value * value).sum::<f64>();
                assert!((norm - 1.0).abs() < 1e-9, "{descriptor:?}");
            }
            Err(error) => {
                assert_eq!(error, SvaTrainError::SeveralFeatures { descriptor: "mr8" });
            }
        }
    }
}

#[test]
fn vectorize_trains_as_well() {
    let sensor = SensorDescription::digitacts_6x6();
    let readings = touches(0, 60, 1);
    let set = TrainingSet { readings: &readings, sensor: &sensor };
    let config =
        TrainingConfig { descriptor: DescriptorKind::Vectorize, ..TrainingConfig::default() };
    let vocabulary = learn_vocabulary(&[set], &config, 1).unwrap();
    assert_eq!((vocabulary.n_classes(), vocabulary.mean.len()), (25, 36));
    let map = map_object(&set, &vocabulary, &config, None).unwrap();
    assert_eq!(map.patches().len(), 60);
    // Origin at the centroid of the touches: their mean position is the origin.
    let mean: DVec3 =
        map.patches().iter().map(|p| DVec3::from_array(p.position.map(f64::from))).sum();
    assert!(mean.length() / 60.0 < 1e-6);
}
