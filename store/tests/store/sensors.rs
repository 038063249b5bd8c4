//! Stored sensors: frozen bytes of schemas 1 to 4, and the largest description.
//!
//! `golden/sensors_v2.txt` is a sensor of schema 2; `golden/sensors_v3.txt` are one on a grid and one
//! with a list of taxels. Those of schema 4 have labels (`labels`).

use std::sync::Arc;

use glam::DVec3;
use palpate_core::sensor::layout::TAXELS_MAX;
use palpate_core::sensor::{
    ForceCurve, Layout, SensorDescription, SensorKnowledge, SensorParameters, Taxel,
};
use palpate_store::entity::Sensor;
use palpate_store::record::{decode, encode};

use crate::bytes::{GOLDEN, is_sensor, thawed, unhex};
use crate::samples;

const GOLDEN_SENSORS_V2: &str = include_str!("golden/sensors_v2.txt");
const GOLDEN_SENSORS: &str = include_str!("golden/sensors_v3.txt");

#[test]
fn frozen_sensors_of_schemas_2_and_3_are_read() {
    let coupled = samples::coupled_sensor(10);
    let described = [coupled.clone(), samples::listed_sensor(11)];
    assert_eq!(thawed(GOLDEN_SENSORS).sensors().all().unwrap(), described);
    assert_eq!(thawed(GOLDEN_SENSORS_V2).sensors().all().unwrap(), [coupled]);
}

#[test]
fn the_largest_description_fits_one_value() {
    let mut largest = samples::coupled_sensor(12);
    let known = largest.description.parameters().clone();
    let taxel = |n: u32| Taxel {
        position: DVec3::new(f64::from(n % 9), f64::from(n / 9), 0.0) * 2e-3,
        normal: DVec3::Z,
        width: 1e-3,
    };
    let layout = Layout::list((0..TAXELS_MAX as u32).map(taxel).collect()).unwrap();
    let knots = (0..64).map(|n| (f64::from(n) * 1e-5, f64::from(n) * 10.0)).collect();
    let force_curve = ForceCurve::new(knots).unwrap();
    let parameters = SensorParameters { layout: Some(Arc::new(layout)), force_curve, ..known };
    largest.description = SensorDescription::new(parameters).unwrap();
    largest.name = "x".repeat(64);
    let bytes = encode(&largest).len();
    assert!(bytes <= palpate_store::engine::VALUE_BYTES_MAX, "{bytes}");
    assert_eq!(decode::<Sensor>(&encode(&largest)).unwrap(), largest);
}

#[test]
fn described_sensors_of_schema_1_are_of_data_sheets() {
    // The frozen preset without its name: an absent text is one byte 0 instead of 1, a length
    // of 8 bytes and the text.
    let line = GOLDEN.lines().find(|line| is_sensor(line)).unwrap();
    let sealed = unhex(line.split_once(' ').unwrap().1);
    let (kind, opened) = palpate_store::envelope::open_any(&sealed).unwrap();
    assert_eq!((kind, opened.schema), (palpate_store::envelope::Kind::Sensor as u16, 1));
    let preset = [&[1, 13, 0, 0, 0, 0, 0, 0, 0][..], b"digitacts-6x6"].concat();
    let at = opened.payload.windows(preset.len()).position(|bytes| bytes == preset).unwrap();
    let (before, after) = (&opened.payload[..at], &opened.payload[at + preset.len()..]);
    let payload = [before, &[0], after].concat();
    let kind = palpate_store::envelope::Kind::Sensor;
    let found: Sensor = decode(&palpate_store::envelope::seal(kind, 1, &payload)).unwrap();
    assert_eq!((found.preset, found.knowledge), (None, SensorKnowledge::DataSheet));
}
