//! Examples of requests and answers, and of a problem for each status.
//!
//! They are in `schemas/examples`. `tests/examples` sends every request to a server and records
//! the answers in `responses.json`; tests here and in `schemas` check that none is missing and
//! that the types know them.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use palpate_schemas::ProblemType;
use serde_json::{Value, json};
use utoipa::openapi::path::{Operation, ParameterBuilder, ParameterIn};
use utoipa::openapi::{Content, RefOr};

use crate::problem::body::{CONTENT_TYPE, title};
use crate::problem::status;

/// Operations and the example bodies of their requests.
const REQUESTS: [(&str, &str); 33] = [
    ("acknowledge_sessions", include_str!("../../../schemas/examples/acknowledge_sessions.json")),
    ("add_object_readings", include_str!("../../../schemas/examples/add_object_readings.json")),
    ("add_readings", include_str!("../../../schemas/examples/add_readings.json")),
    ("analyse_coverings", include_str!("../../../schemas/examples/analyse_coverings.json")),
    ("ask_next_touches", include_str!("../../../schemas/examples/ask_next_touches.json")),
    ("bind_robot", include_str!("../../../schemas/examples/bind_robot.json")),
    ("calibrate_sensor", include_str!("../../../schemas/examples/calibrate_sensor.json")),
    ("check_reading", include_str!("../../../schemas/examples/check_reading.json")),
    ("close_session", include_str!("../../../schemas/examples/close_session.json")),
    ("close_sessions", include_str!("../../../schemas/examples/close_sessions.json")),
    ("commission_sensor", include_str!("../../../schemas/examples/commission_sensor.json")),
    ("create_key", include_str!("../../../schemas/examples/create_key.json")),
    ("create_object", include_str!("../../../schemas/examples/create_object.json")),
    ("create_sensor", include_str!("../../../schemas/examples/create_sensor.json")),
    ("create_session", include_str!("../../../schemas/examples/create_session.json")),
    ("create_webhook", include_str!("../../../schemas/examples/create_webhook.json")),
    ("extend_session", include_str!("../../../schemas/examples/extend_session.json")),
    ("forward_entries", include_str!("../../../schemas/examples/forward_entries.json")),
    ("forward_session", include_str!("../../../schemas/examples/forward_session.json")),
    ("merge_maps", include_str!("../../../schemas/examples/merge_maps.json")),
    ("recalibrate_catalogue", include_str!("../../../schemas/examples/recalibrate_catalogue.json")),
    ("rotate_key", include_str!("../../../schemas/examples/rotate_key.json")),
    ("rotate_webhook_secret", include_str!("../../../schemas/examples/rotate_webhook_secret.json")),
    ("set_alias", include_str!("../../../schemas/examples/set_alias.json")),
    ("set_catalogue_labels", include_str!("../../../schemas/examples/set_catalogue_labels.json")),
    ("set_current", include_str!("../../../schemas/examples/set_current.json")),
    ("set_object_labels", include_str!("../../../schemas/examples/set_object_labels.json")),
    ("set_sensor_labels", include_str!("../../../schemas/examples/set_sensor_labels.json")),
    ("set_session_labels", include_str!("../../../schemas/examples/set_session_labels.json")),
    ("shadow_version", include_str!("../../../schemas/examples/shadow_version.json")),
    ("start_training", include_str!("../../../schemas/examples/start_training.json")),
    ("update_object", include_str!("../../../schemas/examples/update_object.json")),
    ("update_webhook", include_str!("../../../schemas/examples/update_webhook.json")),
];
/// Hash of a block, BLAKE3 in hexadecimal.
const BLOCK: &str = "9f2c5a0e7d41b8360c1fe9ab77d4253e6f80d1c2a4b59e3370f6128d9c4e5b7a";
/// Answers by operation, as a server gave them.
const RESPONSES: &str = include_str!("../../../schemas/examples/responses.json");
/// A refusal of a value.
const PROBLEM: &str = include_str!("../../../schemas/examples/problem.json");

/// What happened, for the problems that an operation may answer.
const PROBLEMS: [(ProblemType, &str); 16] = [
    (ProblemType::MalformedRequest, "the body is not JSON: EOF while parsing a value at line 1"),
    (ProblemType::Unauthenticated, "the request has no API key"),
    (ProblemType::Forbidden, "the key \"arm-3\" has the role robot, expected trainer or admin"),
    (ProblemType::NotFound, "there is no session 01890a5d-ac96-774b-bcce-b302099a8057"),
    (ProblemType::Timeout, "the body did not arrive within 60 s"),
    (ProblemType::Conflict, "the name \"mug\" is taken"),
    (ProblemType::SessionEnded, "the session was closed at 2026-11-26T02:24:37Z"),
    (ProblemType::PreconditionFailed, "the current version has revision 4, expected 3"),
    (ProblemType::BodyTooLarge, "the body is longer than 33.6 MB"),
    (
        ProblemType::UnsupportedMediaType,
        "the content type is text/plain, expected application/json",
    ),
    (ProblemType::PreconditionRequired, "the header If-Match is missing"),
    (ProblemType::TooManyRequests, "32 requests wait for this session: try again in 1 s"),
    (ProblemType::Internal, "internal error; the server's log has the reason"),
    (ProblemType::Overloaded, "all places of the compute pool are taken: try again in 1 s"),
    (ProblemType::StorageFull, "the disk is full: nothing was stored"),
    (ProblemType::InvalidValue, ""),
];

/// Adds the examples of an operation's path, of its request and of its answers.
pub(super) fn add(path: &str, operation: &mut Operation) {
    let id = operation.operation_id.as_deref().unwrap_or_default();
    for parameter in operation.parameters.iter_mut().flatten() {
        let RefOr::T(parameter) = parameter else { continue };
        let example = part_of_path(id, &parameter.name);
        if parameter.parameter_in == ParameterIn::Path && example.is_some() {
            *parameter = ParameterBuilder::from(parameter.clone()).example(example).build();
        }
    }
    let request = REQUESTS.iter().find(|(operation, _)| *operation == id);
    if let (Some((_, text)), Some(RefOr::T(body))) = (request, &mut operation.request_body) {
        body.content.values_mut().for_each(|content| show(content, parsed(text)));
    }
    for (code, response) in &mut operation.responses.responses {
        let RefOr::T(response) = response else { continue };
        for (content_type, content) in &mut response.content {
            let example = if content_type == CONTENT_TYPE {
                problem(code, path)
            } else {
                recorded().get(id).filter(|_| is_text(content_type)).cloned()
            };
            if let Some(example) = example {
                show(content, example);
            }
        }
    }
}

/// The value of a part of an operation's path to which its example belongs; `None` for ids, which
/// every server gives anew.
fn part_of_path(operation: &str, name: &str) -> Option<Value> {
    Some(match (operation, name) {
        ("check_reading", "sensor") => json!("digitacts-6x6"),
        ("commission_sensor", "sensor") => json!("xela-uskin-4x4"),
        (_, "sensor") => json!("left-finger"),
        (_, "object") => json!("mug"),
        (_, "name") => json!("default"),
        ("shadow_version", "version") => json!(2),
        (_, "version") => json!(1),
        (_, "alias") => json!("candidate"),
        (_, "body") => json!("ridge"),
        (_, "hash") => json!(BLOCK),
        (_, "robot") => json!("arm-3"),
        (_, "seq") => json!(17),
        (_, "number") => json!(0),
        _ => return None,
    })
}

/// Whether a content type is shown as text; the others are files.
fn is_text(content_type: &str) -> bool {
    content_type == "application/json" || content_type.starts_with("text/")
}

fn recorded() -> &'static BTreeMap<String, Value> {
    static RECORDED: OnceLock<BTreeMap<String, Value>> = OnceLock::new();
    RECORDED.get_or_init(|| {
        serde_json::from_str(RESPONSES).expect("the committed answers are JSON, a test parses them")
    })
}

/// The problem of a status, as this path answers it; `None` for a status without one.
fn problem(code: &str, path: &str) -> Option<Value> {
    let (kind, detail) =
        PROBLEMS.iter().find(|(kind, _)| status(*kind).as_str() == code).copied()?;
    if kind == ProblemType::InvalidValue {
        return Some(parsed(PROBLEM));
    }
    Some(json!({
        "type": kind,
        "title": title(kind),
        "status": status(kind).as_u16(),
        "detail": detail,
        "instance": path,
        "request_id": "01890a5d-ac96-774b-bcce-b302099a8058",
        "errors": [],
    }))
}

fn show(content: &mut RefOr<Content>, example: Value) {
    if let RefOr::T(content) = content {
        content.example = Some(example);
    }
}

fn parsed(text: &str) -> Value {
    serde_json::from_str(text).expect("the committed examples are JSON, a test parses them")
}

#[cfg(test)]
mod tests {
    use super::super::document;
    use super::*;

    #[test]
    fn every_body_and_answer_but_files_has_an_example() {
        let described = serde_json::to_value(document()).unwrap();
        let mut missing = Vec::new();
        let items = described["paths"].as_object().unwrap();
        for operation in items.values().flat_map(|item| item.as_object().unwrap().values()) {
            let answers = operation["responses"].as_object().unwrap();
            let bodies = answers.iter().map(|(code, answer)| (code.as_str(), answer));
            for (name, body) in bodies.chain([("request", &operation["requestBody"])]) {
                for (content_type, content) in body["content"].as_object().into_iter().flatten() {
                    let is_shown = is_text(content_type) || content_type == CONTENT_TYPE;
                    if is_shown && content["example"].is_null() {
                        missing.push(format!("{} {name}", operation["operationId"]));
                    }
                }
            }
        }
        assert!(missing.is_empty(), "no example: {missing:#?}");
    }

    #[test]
    fn examples_belong_to_operations() {
        let ids = super::super::operation_ids();
        let known = |name: &str| ids.iter().any(|(_, _, id)| id == name);
        assert!(REQUESTS.iter().all(|(id, _)| known(id)));
        for id in recorded().keys() {
            assert!(known(id), "responses.json has an answer of {id}, which is no operation");
        }
    }
}
