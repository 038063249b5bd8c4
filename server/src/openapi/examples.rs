//! Examples of requests and of a problem, from `schemas/examples`, where a test checks them
//! against the types, so that the description's examples parse.

use serde_json::Value;
use utoipa::openapi::path::Operation;
use utoipa::openapi::{Content, RefOr};

/// Operations and the example bodies of their descriptions.
const REQUESTS: [(&str, &str); 4] = [
    ("create_sensor", include_str!("../../../schemas/examples/create_sensor.json")),
    ("start_training", include_str!("../../../schemas/examples/start_training.json")),
    ("create_session", include_str!("../../../schemas/examples/create_session.json")),
    ("add_readings", include_str!("../../../schemas/examples/add_readings.json")),
];
const PROBLEM: &str = include_str!("../../../schemas/examples/problem.json");

/// Adds the examples of this operation's request, and of a refusal of its values.
pub(super) fn add(operation: &mut Operation) {
    let id = operation.operation_id.as_deref().unwrap_or_default();
    let request = REQUESTS.iter().find(|(operation, _)| *operation == id);
    if let (Some((_, text)), Some(RefOr::T(body))) = (request, &mut operation.request_body) {
        body.content.values_mut().for_each(|content| show(content, text));
    }
    if let Some(RefOr::T(refusal)) = operation.responses.responses.get_mut("422") {
        refusal.content.values_mut().for_each(|content| show(content, PROBLEM));
    }
}

fn show(content: &mut RefOr<Content>, example: &str) {
    if let RefOr::T(content) = content {
        content.example = Some(parsed(example));
    }
}

fn parsed(text: &str) -> Value {
    serde_json::from_str(text).expect("the committed examples are JSON, a test parses them")
}
