//! Stored sensors: frozen bytes of schemas 1 to 5, and the largest description.
//!
//! `golden/sensors_v2.txt` is a sensor of schema 2; `golden/sensors_v3.txt` are one on a grid and one
//! with a list of taxels. Those of schema 4 have labels (`labels`). `golden/sensors_v5.txt` adds a
//! preset that its owner measured.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::sensor::layout::TAXELS_MAX;
use palpate_core::sensor::{
    ForceCurve, Layout, SensorDescription, SensorKnowledge, SensorParameters, Taxel,
};
use palpate_store::entity::Sensor;
use palpate_store::envelope::{Kind, seal};
use palpate_store::record::{Record, decode, encode};

use crate::bytes::{GOLDEN, current_of, is_sensor, thawed, unhex};
use crate::samples;

const GOLDEN_SENSORS_V2: &str = include_str!("golden/sensors_v2.txt");
const GOLDEN_SENSORS: &str = include_str!("golden/sensors_v3.txt");
const GOLDEN_SENSORS_V5: &str = include_str!("golden/sensors_v5.txt");

#[test]
fn frozen_sensors_of_schemas_2_and_3_are_read() {
    let coupled = samples::coupled_sensor(10);
    let described = [coupled.clone(), samples::listed_sensor(11)];
    assert_eq!(thawed(GOLDEN_SENSORS).sensors().all().unwrap(), described);
    assert_eq!(thawed(GOLDEN_SENSORS_V2).sensors().all().unwrap(), [coupled]);
}

#[test]
fn written_sensors_equal_the_frozen_bytes_and_are_read() {
    let all = [samples::sensor(9), samples::coupled_sensor(10), samples::listed_sensor(11)];
    let current = current_of(&[], async |database| {
        for sensor in &all {
            database.sensors().create(sensor).await.unwrap();
        }
    });
    let lines: Vec<&str> = current.lines().filter(|line| is_sensor(line)).collect();
    assert_eq!(lines, GOLDEN_SENSORS_V5.lines().collect::<Vec<_>>(), "{lines:#?}");
    assert_eq!(thawed(GOLDEN_SENSORS_V5).sensors().all().unwrap(), all);
}

#[test]
fn presets_of_older_schemas_are_of_data_sheets() {
    let [measured, listed] = [samples::sensor(9), samples::listed_sensor(11)];
    let thumb = Sensor { preset: Some("xela-uskin-4x4".to_owned()), ..measured.clone() };
    // Schema 4 has the same payload. Presets of real arrays and descriptions were data sheets by
    // default, so that somebody said `measured`.
    let sheet = Sensor { knowledge: SensorKnowledge::DataSheet, ..measured.clone() };
    for (stored, read) in [(&measured, &sheet), (&listed, &listed), (&thumb, &thumb)] {
        let sealed = seal(Kind::Sensor, 4, &stored.to_payload());
        assert_eq!(&decode::<Sensor>(&sealed).unwrap(), read);
    }
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
    assert_eq!((kind, opened.schema), (Kind::Sensor as u16, 1));
    let preset = [&[1, 13, 0, 0, 0, 0, 0, 0, 0][..], b"digitacts-6x6"].concat();
    let at = opened.payload.windows(preset.len()).position(|bytes| bytes == preset).unwrap();
    let (before, after) = (&opened.payload[..at], &opened.payload[at + preset.len()..]);
    let payload = [before, &[0], after].concat();
    let found: Sensor = decode(&seal(Kind::Sensor, 1, &payload)).unwrap();
    assert_eq!((found.preset, found.knowledge), (None, SensorKnowledge::DataSheet));
}
