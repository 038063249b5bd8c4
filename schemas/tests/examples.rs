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
    check::<wire::AcknowledgeSessions>(include_str!("../examples/acknowledge_sessions.json"));
    check::<wire::AddTrainingReadings>(include_str!("../examples/add_object_readings.json"));
    check::<wire::AddReadings>(include_str!("../examples/add_readings.json"));
    check::<wire::AnalyseCoverings>(include_str!("../examples/analyse_coverings.json"));
    check::<wire::AskNextTouches>(include_str!("../examples/ask_next_touches.json"));
    check::<wire::BindRobot>(include_str!("../examples/bind_robot.json"));
    check::<wire::CalibrateSensor>(include_str!("../examples/calibrate_sensor.json"));
    check::<wire::Reading>(include_str!("../examples/check_reading.json"));
    check::<wire::CloseSession>(include_str!("../examples/close_session.json"));
    check::<wire::CloseSessions>(include_str!("../examples/close_sessions.json"));
    check::<wire::CommissionSensor>(include_str!("../examples/commission_sensor.json"));
    check::<wire::CreateKey>(include_str!("../examples/create_key.json"));
    check::<wire::CreateObject>(include_str!("../examples/create_object.json"));
    check::<wire::CreateSensor>(include_str!("../examples/create_sensor.json"));
    check::<wire::CreateSession>(include_str!("../examples/create_session.json"));
    check::<wire::ExtendSession>(include_str!("../examples/extend_session.json"));
    check::<wire::ForwardEntries>(include_str!("../examples/forward_entries.json"));
    check::<wire::ForwardSession>(include_str!("../examples/forward_session.json"));
    check::<wire::MergeMaps>(include_str!("../examples/merge_maps.json"));
    check::<wire::Problem>(include_str!("../examples/problem.json"));
    check::<wire::RecalibrateCatalogue>(include_str!("../examples/recalibrate_catalogue.json"));
    check::<wire::RotateKey>(include_str!("../examples/rotate_key.json"));
    check::<wire::SetCurrent>(include_str!("../examples/set_current.json"));
    check::<wire::SetLabels>(include_str!("../examples/set_catalogue_labels.json"));
    check::<wire::SetLabels>(include_str!("../examples/set_object_labels.json"));
    check::<wire::SetLabels>(include_str!("../examples/set_sensor_labels.json"));
    check::<wire::SetLabels>(include_str!("../examples/set_session_labels.json"));
    check::<wire::SetAlias>(include_str!("../examples/set_alias.json"));
    check::<wire::ShadowVersion>(include_str!("../examples/shadow_version.json"));
    check::<wire::StartTraining>(include_str!("../examples/start_training.json"));
    check::<wire::UpdateObject>(include_str!("../examples/update_object.json"));
    check::<wire::RotateWebhookSecret>(include_str!("../examples/rotate_webhook_secret.json"));
    check::<wire::UpdateWebhook>(include_str!("../examples/update_webhook.json"));
    check::<wire::CreateWebhook>(include_str!("../examples/create_webhook.json"));
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
