//! Tests of warnings: presses in wrong units are recognised, and correct ones pass.

use palpate_core::reading::SensorId;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::TaxelGrid;

use super::*;

/// A press in the middle of a 6 × 6 array, in pascal.
#[rustfmt::skip]
const PRESS: [f64; 36] = [
    0.0,   0.0,    0.0,    0.0,   0.0, 0.0,
    0.0, 900.0, 2500.0,    0.0,   0.0, 0.0,
    0.0, 1800.0, 4100.0, 900.0,   0.0, 0.0,
    0.0, 900.0, 2500.0,    0.0,   0.0, 0.0,
    0.0,   0.0,    0.0,    0.0,   0.0, 0.0,
    0.0,   0.0,    0.0,    0.0,   0.0, 0.0,
];

fn reading(pressures: &[f64], position: [f64; 3]) -> (Reading, Pose) {
    let pose = Pose::new(position, [0.0, 0.0, 0.0, 1.0]).unwrap();
    let image: Vec<Option<f64>> = pressures.iter().copied().map(Some).collect();
    let sensor = SensorDescription::digitacts_6x6();
    (Reading::new(SensorId(1), &sensor, &image, pose).unwrap(), pose)
}

fn codes(pressures: &[f64], position: [f64; 3]) -> Vec<WarningCode> {
    let (reading, pose) = reading(pressures, position);
    let sensor = SensorDescription::digitacts_6x6();
    let judged = Judged::press(&reading, &sensor, Some(pose));
    of_reading(judged).into_iter().map(|hint| hint.code).collect()
}

fn scaled(factor: f64) -> Vec<f64> {
    PRESS.iter().map(|pressure| pressure * factor).collect()
}

#[test]
fn a_press_in_another_unit_is_named_with_its_unit() {
    let sensor = SensorDescription::digitacts_6x6();
    let area = 0.0018 * 0.0018;
    let units = [(1e-3, "kPa"), (1e-5, "bar"), (area, "N for each taxel"), (1e-6, "MPa")];
    for (factor, unit) in units {
        let (reading, pose) = reading(&scaled(factor), [0.4, -0.1, 0.25]);
        let judged = Judged::press(&reading, &sensor, Some(pose));
        let hints = of_reading(judged);
        assert_eq!(hints.len(), 1, "{hints:?}");
        assert_eq!((hints[0].code, hints[0].field), (WarningCode::PressureUnit, "/image"));
        assert!(hints[0].detail.contains(&format!("probably in {unit}:")), "{}", hints[0].detail);
    }
    assert_eq!(codes(&scaled(1e3), [0.0; 3]), [WarningCode::PressureUnit], "millipascal");
}

#[test]
fn presses_empty_images_and_noise_give_no_warning() {
    assert_eq!(codes(&PRESS, [0.4, -0.1, 0.25]), []);
    assert_eq!(codes(&[0.0; 36], [0.4, -0.1, 0.25]), []);
    let mut n_warned = 0;
    for index in 0..2_000 {
        // The stated noise is 100 Pa; a sensor may be better than its description.
        let deviation = if index % 2 == 0 { 100.0 } else { 20.0 };
        let mut stream = Stream::new(7, Purpose::SensorNoise, index);
        let noise: Vec<f64> = (0..36).map(|_| deviation * stream.normal()).collect();
        n_warned += codes(&noise, [0.0; 3]).len();
    }
    // One of 1,000 images of white noise is as smooth as a press, and one in 800 has a taxel
    // four deviations below zero; fewer than ten of 2,000 images.
    assert!(n_warned < 10, "{n_warned} of 2000");
}

#[test]
fn positions_in_millimetres_and_far_frames_are_distinguished() {
    assert_eq!(codes(&PRESS, [400.0, -100.0, 250.0]), [WarningCode::PositionUnit]);
    assert_eq!(codes(&PRESS, [40e3, 0.0, 0.0]), [WarningCode::PositionFar]);
    assert_eq!(codes(&PRESS, [3.0, 2.0, 1.0]), []);
}

#[test]
fn each_mistake_gives_one_warning_per_request() {
    let sensor = SensorDescription::digitacts_6x6();
    let readings: Vec<(Reading, Pose)> = [[0.4, 0.0, 0.2], [0.4, 0.1, 0.2], [2.5, 0.0, 0.2]]
        .iter()
        .map(|position| reading(&scaled(1e-3), *position))
        .collect();
    let judged: Vec<Judged<'_>> = readings
        .iter()
        .map(|(reading, pose)| Judged::press(reading, &sensor, Some(*pose)))
        .collect();
    let found = of_readings(&judged, None);
    let pointers: Vec<(WarningCode, &str)> =
        found.iter().map(|warning| (warning.code, warning.pointer.as_str())).collect();
    let expected = [
        (WarningCode::PressureUnit, "/readings/0/image"),
        (WarningCode::PositionsApart, "/readings/2/pose/position"),
    ];
    assert_eq!(pointers, expected);
    assert!(found[0].detail.ends_with("(3 of 3 readings)"), "{}", found[0].detail);
    let elsewhere = of_readings(&judged[..1], Some(DVec3::new(4.0, 0.0, 0.0)));
    assert_eq!(elsewhere[1].code, WarningCode::PositionsApart);
}

#[test]
fn an_array_of_few_taxels_is_judged_by_size_alone() {
    let mut parameters = SensorDescription::digitacts_6x6().parameters().clone();
    parameters.grid = TaxelGrid { rows: 2, cols: 2, ..parameters.grid };
    let sensor = SensorDescription::new(parameters).unwrap();
    let judge = |pressures: [f64; 4]| {
        let image = pressures.map(Some);
        let reading = Reading::new(SensorId(1), &sensor, &image, Pose::IDENTITY).unwrap();
        of_reading(Judged::press(&reading, &sensor, None)).len()
    };
    assert_eq!((judge([4.1, 2.0, 1.0, 0.5]), judge([41.0, 20.0, 0.0, 5.0])), (1, 0));
}

#[test]
fn further_pairs_of_twins_are_counted() {
    let said = |n_pairs| of_twins((["mug".to_owned(), "cup".to_owned()], n_pairs)).detail;
    assert!(said(1).contains("have the same shape: touch"), "{}", said(1));
    assert!(said(2).contains("(and one more pair)"), "{}", said(2));
    assert!(said(7).contains("(and 6 more pairs)"), "{}", said(7));
}
