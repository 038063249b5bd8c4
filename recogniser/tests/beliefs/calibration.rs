//! Calibration of the surface recogniser's probabilities, for any size of catalogue and any data
//! of calibration. Analytic objects, no simulator.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::belief::calibrate::{HeldBack, calibrate};
use palpate_recogniser::model::SurfaceMap;
use palpate_recogniser::model::{CalibrationBasis, EvidenceCalibration, SurfaceModel};
use palpate_recogniser::options::SurfaceOptions;

use crate::ellipsoids::*;

/// Probabilities after each of `n` touches of an object, "none of these" last.
fn stated(
    model: &Arc<SurfaceModel>,
    prior: Option<&[f64]>,
    unknown: f64,
    readings: &[Reading],
) -> Vec<Vec<f64>> {
    let options = SurfaceOptions { unknown, ..SurfaceOptions::default() };
    let mut belief = SurfaceBelief::new(model.clone(), options, prior).unwrap();
    let after = |reading| {
        belief.add(reading, &six_by_six());
        belief.posterior()
    };
    readings.iter().map(after).collect()
}

fn with_maps(maps: impl IntoIterator<Item = Arc<SurfaceMap>>) -> Arc<SurfaceModel> {
    Arc::new(MODEL.with_maps(maps.into_iter().collect()))
}

/// Checks that an object with a prior of zero has the same effect as its absence from `all`. The
/// first object is ruled out and touched.
#[track_caller]
fn check_ruled_out(all: Vec<Arc<SurfaceMap>>) {
    let prior: Vec<f64> = (0..all.len()).map(|o| f64::from(u8::from(o > 0))).collect();
    let without = with_maps(all[1..].to_vec());
    let with = with_maps(all);
    let readings = touches(0, 8, 2);
    let masked = stated(&with, Some(&prior), 0.5, &readings);
    for (after, (masked, expected)) in
        masked.iter().zip(stated(&without, None, 0.5, &readings)).enumerate()
    {
        assert!(masked[0].abs() < 1e-12, "after {after}: {masked:?}");
        for (found, expected) in masked[1..].iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-6, "after {after}: {masked:?}\n{expected:?}");
        }
    }
}

#[test]
fn an_object_with_a_prior_of_zero_has_no_part_in_the_search() {
    check_ruled_out(MODEL.maps().to_vec());
}

#[test]
fn nor_has_it_where_one_table_lists_many_objects() {
    let others = (0..40).map(|copy| MODEL.maps()[1 + copy % 2].clone());
    check_ruled_out(std::iter::once(MODEL.maps()[0].clone()).chain(others).collect());
}

#[test]
fn copies_of_an_object_do_not_change_the_odds_of_none_of_them() {
    let readings = touches(0, 5, 2);
    let unknown = |copies: usize| -> Vec<f64> {
        let model = with_maps((0..copies).map(|_| MODEL.maps()[0].clone()));
        stated(&model, None, 0.3, &readings).iter().map(|after| after[copies]).collect()
    };
    let (alone, many) = (unknown(1), unknown(20));
    for (after, (alone, many)) in alone.iter().zip(&many).enumerate() {
        let odds = |p: f64| (p / (1.0 - p)).ln();
        let grown = odds(*many) - odds(*alone);
        // The search of twenty objects omits little.
        assert!(grown.abs() < 0.2, "after {} touches: {alone} {many}", after + 1);
    }
}

#[test]
fn a_calibration_says_what_it_was_learnt_on() {
    let sensor = six_by_six();
    let readings: Vec<Vec<Reading>> = (0..N_OBJECTS).map(|o| touches(o, 12, 4)).collect();
    let basis = |model: &Arc<SurfaceModel>, n: usize| {
        let held_back: Vec<HeldBack<'_>> = readings[..model.maps().len()]
            .iter()
            .map(|readings| HeldBack { readings: &readings[..n], sensor: &sensor, run: None })
            .collect();
        calibrate(model, &held_back, SurfaceOptions::default(), 1)
    };
    let alone = with_maps([MODEL.maps()[0].clone()]);
    let default = EvidenceCalibration::default();
    for (model, n, expected) in [
        (&*MODEL, 12, CalibrationBasis::HeldBack { objects: N_OBJECTS }),
        (&*MODEL, 5, CalibrationBasis::FewReadings),
        (&alone, 12, CalibrationBasis::OneObject),
    ] {
        let found = basis(model, n);
        assert_eq!(found.basis, expected);
        let is_learnt = matches!(expected, CalibrationBasis::HeldBack { .. });
        assert_eq!(found.stages != default.stages, is_learnt, "{found:?}");
    }
}

/// Touches of the `index`th of many ellipsoids.
fn touches_of(index: usize, n: usize, seed: u64) -> Vec<Reading> {
    let mut shape = Stream::new(11, Purpose::Shape, index as u64);
    let half = DVec3::from_array([0; 3].map(|_| shape.uniform(0.012, 0.045)));
    let mut stream = Stream::new(seed, Purpose::Sampling, index as u64);
    (0..n).map(|_| touch_of(half, &six_by_six(), &mut stream)).collect()
}

/// The mean probability of "none of these" after each of `n` touches of these objects, with a
/// prior of a half.
fn unknown_of(model: &Arc<SurfaceModel>, objects: std::ops::Range<usize>, n: usize) -> Vec<f64> {
    let last = model.maps().len();
    let all: Vec<Vec<Vec<f64>>> = objects
        .flat_map(|object| [2, 3].map(|seed| touches_of(object, n, seed)))
        .map(|readings| stated(model, None, 0.5, &readings))
        .collect();
    let mean = |after: usize| all.iter().map(|s| s[after][last]).sum::<f64>() / all.len() as f64;
    (0..n).map(mean).collect()
}

/// A catalogue of the first `n` ellipsoids.
fn ellipsoids(n: usize) -> Arc<SurfaceModel> {
    with_maps((0..n).map(|index| map_of(&touches_of(index, 150, 1))))
}

/// The model calibrated on fifteen unseen touches of each object.
fn calibrated(model: Arc<SurfaceModel>) -> Arc<SurfaceModel> {
    let sensor = six_by_six();
    let unseen: Vec<Vec<Reading>> = (0..model.maps().len()).map(|o| touches_of(o, 15, 4)).collect();
    let held_back: Vec<HeldBack<'_>> =
        unseen.iter().map(|readings| HeldBack { readings, sensor: &sensor, run: None }).collect();
    let calibration = calibrate(&model, &held_back, SurfaceOptions::default(), 1);
    Arc::new(Arc::unwrap_or_clone(model).with_calibration(calibration))
}

/// Checks that the mean probability of "none of these" is about a half after each touch when
/// half of the sessions are with unknown objects.
#[track_caller]
fn check_half(model: &Arc<SurfaceModel>, n_touches: usize) {
    let known = unknown_of(model, 0..20, n_touches);
    let foreign = unknown_of(model, 60..80, n_touches);
    for (after, (known, foreign)) in known.iter().zip(&foreign).enumerate() {
        let mean = 0.5 * (known + foreign);
        assert!((mean - 0.5).abs() < 0.15, "{} touches: {known} {foreign}", after + 1);
    }
}

#[test]
fn a_catalogue_that_grows_to_sixty_objects_stays_calibrated() {
    let (small, large) = (calibrated(ellipsoids(3)), ellipsoids(60));
    let grown = Arc::new(Arc::unwrap_or_clone(large).with_calibration(small.calibration));
    // Appearance and pairs have the same weight among sixty objects as among three.
    check_half(&grown, 2);
    // The calibration of poses depends on the similarity of the objects.
    let anew = calibrated(grown);
    assert_eq!(anew.calibration.basis, CalibrationBasis::HeldBack { objects: 60 });
    check_half(&anew, 6);
}
