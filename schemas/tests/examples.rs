//! The committed examples are requests and answers as the types know them.

use palpate_schemas as wire;
use serde::{Serialize, de::DeserializeOwned};

#[track_caller]
fn check<T: DeserializeOwned + Serialize>(example: &str) {
    let parsed: T = serde_json::from_str(example).expect("the example parses");
    let written = serde_json::to_value(&parsed).expect("wire types can be written");
    let given: serde_json::Value = serde_json::from_str(example).expect("the example is JSON");
    assert_eq!(written, given, "the example is complete: nothing is lost or added");
}

#[test]
fn examples_parse_and_are_complete() {
    check::<wire::CreateSensor>(include_str!("../examples/create_sensor.json"));
    check::<wire::StartTraining>(include_str!("../examples/start_training.json"));
    check::<wire::CreateSession>(include_str!("../examples/create_session.json"));
    check::<wire::AddReadings>(include_str!("../examples/add_readings.json"));
    check::<wire::Problem>(include_str!("../examples/problem.json"));
}

#[test]
fn a_typo_in_a_request_is_not_ignored() {
    let error = serde_json::from_str::<wire::CreateSession>(r#"{"catalog": "default"}"#);
    assert!(error.unwrap_err().to_string().contains("unknown field `catalog`"));
}

#[test]
fn preset_names_are_those_of_the_wire() {
    for preset in wire::SensorPreset::ALL {
        assert_eq!(serde_json::to_value(preset).unwrap(), preset.name());
    }
}
