//! Recalibration from sessions whose object is known. Analytic objects, no simulator.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::reading::Felt;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_recogniser::belief::recalibrate::{Recalibration, recalibrate};
use palpate_recogniser::belief::{PastSession, SurfaceBelief};
use palpate_recogniser::model::{CalibrationBasis, EvidenceCalibration, SurfaceModel};
use palpate_recogniser::options::SurfaceOptions;

use crate::ellipsoids::*;

/// Readings of `n` sessions, eight touches each, whose sensor is off by `noise` (m) along each axis
/// in every touch; with the object of each.
fn sessions(n: usize, noise: f64, seed: u64) -> Vec<(usize, Vec<Felt>)> {
    let session = |index: usize| {
        let object = index % N_OBJECTS;
        let mut stream = Stream::new(seed, Purpose::Perturbation, index as u64);
        let readings = touches(object, 8, seed + index as u64).into_iter().map(|reading| {
            let off = noise * DVec3::new(stream.normal(), stream.normal(), stream.normal());
            Felt::Press(reading.moved_by(Pose::from_parts(glam::DQuat::IDENTITY, off)))
        });
        (object, readings.collect())
    };
    (0..n).map(session).collect()
}

fn past<'a>(
    sessions: &'a [(usize, Vec<Felt>)],
    sensor: &'a SensorDescription,
) -> Vec<PastSession<'a>> {
    let one = |(object, readings): &'a (usize, Vec<Felt>)| PastSession {
        readings: readings.iter().map(|reading| (reading, sensor)).collect(),
        truth: Some(*object),
        motion: None,
    };
    sessions.iter().map(one).collect()
}

fn recalibrated(n: usize, noise: f64) -> Recalibration {
    let (sensor, sessions) = (six_by_six(), sessions(n, noise, 70));
    let go_on = |_: usize, _: usize| ControlFlow::Continue(());
    recalibrate(&MODEL, &past(&sessions, &sensor), &go_on).unwrap()
}

/// Mean −ln probability of the true object after the last touch of fresh sessions.
fn loss(calibration: EvidenceCalibration, noise: f64) -> f64 {
    let sensor = six_by_six();
    let model = Arc::new(SurfaceModel::clone(&MODEL).with_calibration(calibration));
    let sessions = sessions(30, noise, 900);
    let one = |(object, readings): &(usize, Vec<Felt>)| {
        let options = SurfaceOptions::default();
        let mut belief = SurfaceBelief::new(model.clone(), options, None).unwrap();
        for reading in readings {
            belief.add(reading.press().unwrap(), &sensor);
        }
        -belief.posterior()[*object].max(1e-6).ln()
    };
    sessions.iter().map(one).sum::<f64>() / sessions.len() as f64
}

#[test]
fn a_noisier_sensor_is_recalibrated_for_sessions_to_come() {
    let found = recalibrated(36, 1.5 * MM);
    assert!(found.is_better(), "{found:?}");
    assert!(found.calibration.width > 1.0, "{found:?}");
    let (before, after) = (&found.before, &found.after);
    assert!(after.log_loss < before.log_loss, "{found:?}");
    assert!(after.calibration_error < before.calibration_error, "{found:?}");
    assert!(after.unknown_of_known < before.unknown_of_known, "{found:?}");
    assert_eq!(
        found.calibration.basis,
        CalibrationBasis::Sessions { sessions: 36, objects: N_OBJECTS }
    );
    // Sessions that neither calibration knows.
    let (before, after) = (loss(MODEL.calibration, 1.5 * MM), loss(found.calibration, 1.5 * MM));
    assert!(after < 0.8 * before, "{before} {after}");
}

#[test]
fn a_matched_sensor_keeps_its_width() {
    let found = recalibrated(24, 0.0);
    assert!((found.calibration.width - 1.0).abs() < 1e-12, "{found:?}");
    let accuracy = (found.before.accuracy, found.after.accuracy);
    assert!(accuracy.1 >= accuracy.0 - 1e-12, "{found:?}");
}

#[test]
fn a_repetition_gives_the_same_calibration() {
    assert_eq!(recalibrated(20, 1.0 * MM), recalibrated(20, 1.0 * MM));
}

#[test]
fn a_recalibration_can_be_stopped() {
    let (sensor, sessions) = (six_by_six(), sessions(20, 0.0, 3));
    let stop = |done: usize, total: usize| {
        assert!(done < total);
        if done > 30 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    assert_eq!(recalibrate(&MODEL, &past(&sessions, &sensor), &stop), None);
}
