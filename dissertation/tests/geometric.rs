//! Planar recognition by force on analytic bodies: round bumps on a plane, without a simulator.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::f64::consts::PI;
use std::sync::{Arc, OnceLock};

use glam::{DQuat, DVec3};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_core::units::{DEG, MM};
use palpate_dissertation::geometric::model::GeometricModel;
use palpate_dissertation::geometric::train::{GeometricConfig, map_geometry};
use palpate_dissertation::geometric::{
    AdaptiveOptions, GeometricBelief, GeometricError, GeometricFilter, GeometricOptions, PosePrior,
    PreparedGeometry,
};

/// Bumps of two bodies: x, y (mm) and height (kPa), all 2.7 mm wide.
const BODIES: [&[[f64; 3]]; 2] = [
    &[[-8.0, -6.0, 9.0], [7.0, -7.0, 6.0], [0.0, 8.0, 8.0], [-2.0, 0.0, 5.0]],
    &[[-8.0, 6.0, 9.0], [7.0, 5.0, 7.0], [2.0, -8.0, 8.0]],
];

/// Height of the sensors in the bodies' frames.
const SENSORS: f64 = 2.0 * MM;

fn pressure(object: usize, x: f64, y: f64) -> f64 {
    let bump = |[cx, cy, height]: &[f64; 3]| {
        let squared = (x - cx * MM).powi(2) + (y - cy * MM).powi(2);
        1_000.0 * height * (-0.5 * squared / (2.7 * MM).powi(2)).exp()
    };
    BODIES[object].iter().map(bump).sum()
}

/// Half of the taxels are a fifth stronger.
fn gain(taxel: usize) -> f64 {
    if taxel.is_multiple_of(2) { 1.1 } else { 0.9 }
}

fn press(object: usize, stream: &mut Stream) -> Reading {
    let sensor = SensorDescription::digitacts_6x6();
    let place = DVec3::new(stream.uniform(-0.011, 0.011), stream.uniform(-0.011, 0.011), SENSORS);
    let turn = DQuat::from_rotation_z(stream.uniform(-PI, PI)) * DQuat::from_rotation_x(PI);
    let pose = Pose::from_parts(turn, place);
    let depth = 1.0 + 0.15 * stream.normal();
    let slip = 0.3 * MM * DVec3::new(stream.normal(), stream.normal(), 0.0);
    let pressures: Vec<Option<f64>> = (0..36)
        .map(|taxel| {
            let (x, y) = sensor.grid().center(taxel / 6, taxel % 6);
            let at = pose * DVec3::new(x, y, 0.0) + slip;
            let felt = depth * pressure(object, at.x, at.y) + 200.0 * stream.normal();
            Some((gain(taxel) * felt).max(0.0))
        })
        .collect();
    Reading::new(SensorId(7), &sensor, &pressures, pose).unwrap()
}

fn presses(object: usize, n: usize, seed: u64) -> Vec<Reading> {
    let mut stream = Stream::new(seed, Purpose::Sampling, object as u64);
    (0..n).map(|_| press(object, &mut stream)).collect()
}

fn model() -> GeometricModel {
    let sensor = SensorDescription::digitacts_6x6();
    let readings: Vec<Vec<Reading>> = (0..2).map(|object| presses(object, 150, 1)).collect();
    let sets: Vec<TrainingSet<'_>> =
        readings.iter().map(|readings| TrainingSet { readings, sensor: &sensor }).collect();
    map_geometry(&sets, &[DVec3::ZERO; 2], &GeometricConfig::planar()).unwrap()
}

fn prepared(model: GeometricModel) -> PreparedGeometry {
    PreparedGeometry::new(Arc::new(model))
}

/// A tilted plane away from the session's origin.
fn plane() -> Pose {
    let tipped = DQuat::from_rotation_y(70.0 * DEG) * DQuat::from_rotation_x(0.3);
    Pose::from_parts(tipped, DVec3::new(0.4, -0.2, 0.7))
}

fn options() -> GeometricOptions {
    let pose = PosePrior::Planar {
        session_from_plane: plane(),
        center: [0.1, 0.0],
        half_extent: 10.0 * MM,
        angle: 0.0,
        half_angle: PI,
    };
    GeometricOptions {
        pose,
        filter: GeometricFilter::Adaptive(AdaptiveOptions::default()),
        seed: 0,
    }
}

fn truth() -> Pose {
    // The bodies are pressed as deep as the map says: their faces then lie in the plane.
    static HEIGHT: OnceLock<f64> = OnceLock::new();
    let height = HEIGHT.get_or_init(|| model().maps[1].occupancy.shape().min().z);
    let place = DVec3::new(0.105, -0.004, -height);
    plane() * Pose::from_parts(DQuat::from_rotation_z(2.4), place)
}

fn belief(n: usize) -> GeometricBelief {
    let mut belief = GeometricBelief::new(&prepared(model()), options(), None).unwrap();
    for reading in presses(1, n, 2) {
        belief.add(&reading.moved_by(truth()), &SensorDescription::digitacts_6x6()).unwrap();
    }
    belief
}

#[test]
fn gains_are_learnt_without_a_calibration_run() {
    let model = model();
    let gains = &model.gains[0];
    assert_eq!(gains.sensor, SensorId(7));
    for (taxel, found) in gains.gains.iter().enumerate() {
        assert!((found / gain(taxel) - 1.0).abs() < 0.04, "taxel {taxel}: {found}");
    }
    let mosaic = model.maps[0].mosaic.as_ref().unwrap();
    let highest = mosaic.pressure().iter().copied().fold(0.0, f32::max);
    // The highest bump has 9 kPa; the kernel takes a tenth off.
    assert!((7_500.0..9_500.0).contains(&highest), "{highest}");
}

#[test]
fn the_body_and_its_pose_in_a_tilted_plane_are_found() {
    let belief = belief(6);
    let answer = belief.answer(2);
    assert_eq!(answer.best_object(), Some(ObjectIdx(1)), "{:?}", answer.probabilities);
    assert!((answer.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    let mode = &answer.modes[0];
    let off = mode.session_from_object.distance_to(&truth());
    let turned = mode.session_from_object.angle_to(&truth());
    assert!(off < 0.6 * MM && turned < 4.0 * DEG, "{} mm, {} degrees", off / MM, turned / DEG);
    // The error agrees with the covariance.
    let deviation = mode.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
    assert!((0.05 * MM..1.2 * MM).contains(&deviation), "{deviation}");
    assert!(off < 4.0 * deviation);
}

#[test]
fn marginals_peak_at_the_truth_and_sum_to_one() {
    let marginals = belief(6).marginals(ObjectIdx(1)).unwrap();
    let names: Vec<&str> = marginals.axes.iter().map(|axis| axis.axis).collect();
    assert_eq!(names, ["x", "y", "theta"]);
    for (axis, expected) in marginals.axes.iter().zip([0.105, -0.004, 2.4]) {
        let n = axis.probabilities.len() as f64;
        let mean: f64 = axis
            .probabilities
            .iter()
            .enumerate()
            .map(|(cell, p)| p * (axis.low + (cell as f64 + 0.5) * (axis.high - axis.low) / n))
            .sum();
        assert!((axis.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!((mean - expected).abs() < 0.06 * (axis.high - axis.low), "{}: {mean}", axis.axis);
    }
    assert_eq!(belief(0).marginals(ObjectIdx(9)), None);
}

#[test]
fn an_untouched_belief_is_the_prior() {
    let prior = GeometricBelief::new(&prepared(model()), options(), Some(&[3.0, 1.0]));
    let answer = prior.unwrap().answer(1);
    assert!((answer.probabilities[0] - 0.75).abs() < 1e-9);
    assert_eq!(answer.n_readings, 0);
}

#[test]
fn mismatched_inputs_are_refused_by_name() {
    let new = |model, options, prior| GeometricBelief::new(&prepared(model), options, prior).err();
    let mut unforced = model();
    for map in &mut unforced.maps {
        Arc::make_mut(map).mosaic = None;
    }
    let error = new(unforced, options(), None);
    assert_eq!(error, Some(GeometricError::NoMosaic { object: 0 }));
    let error = new(model(), options(), Some(&[1.0]));
    assert_eq!(error, Some(GeometricError::Prior { expected: 2, found: 1 }));
    let PosePrior::Planar { session_from_plane, center, angle, half_angle, .. } = options().pose
    else {
        panic!("the options of this file are planar");
    };
    let half_extent = f64::NAN;
    let pose = PosePrior::Planar { session_from_plane, center, half_extent, angle, half_angle };
    let error = new(model(), GeometricOptions { pose, ..options() }, None);
    assert!(matches!(error, Some(GeometricError::Range { field: "half_extent", .. })));
}

#[test]
fn a_tilted_press_is_refused_with_its_angle() {
    let mut belief = belief(0);
    let aside = Pose::from_parts(DQuat::from_rotation_x(40.0 * DEG), DVec3::ZERO);
    let reading = presses(0, 1, 3)[0].moved_by(plane() * aside);
    let error = belief.add(&reading, &SensorDescription::digitacts_6x6()).unwrap_err();
    let GeometricError::Tilt { degrees } = error else { panic!("{error}") };
    assert!((degrees - 40.0).abs() < 1e-6);
    assert_eq!(belief.n_readings(), 0);
}
