//! The API's description: made from the routes, completed here, committed in
//! `schemas/openapi.json`.
//!
//! Every operation gets the common answers: problems with its path, its body and its query,
//! and an overloaded or failing server. A test fails when the committed file differs;
//! `UPDATE_OPENAPI=1 cargo test -p palpate-server openapi` rewrites it.

#[cfg(test)]
mod effects;
mod events;
mod examples;
#[cfg(any(test, not(feature = "swagger")))]
pub(crate) mod listing;
#[cfg(test)]
mod operations;
#[cfg(feature = "swagger")]
pub(crate) mod reader;
mod unions;
mod walk;

use std::sync::OnceLock;

use palpate_schemas::{
    BeliefDetail, FieldError, Job, PlyForm, Problem, SessionEvent, WebhookEvent,
};
use utoipa::OpenApi as _;
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{Content, Header, OpenApi, Ref, RefOr, Response};

use crate::problem::body::CONTENT_TYPE;
use crate::roles::{self, Rule, Who};
use crate::routes;
use walk::operations;
pub(crate) use walk::{operation_ids, operations_without_query};

/// Name of the security scheme.
const SCHEME: &str = "key";
const KEY: &str = "An API key, `palpate_…`, if the server requires one. `x-palpate-roles` of \
    an operation lists the roles that may call it; operations without it need no key.";

#[derive(utoipa::OpenApi)]
#[openapi(
    info(
        title = "Palpate",
        description = "Fleets of robots recognise objects by touch. Units are SI: metres, \
            pascals, seconds, radians. Quaternions are x, y, z, w. Errors are \
            `application/problem+json` (RFC 9457).",
        license(name = "Apache-2.0", identifier = "Apache-2.0"),
        contact(name = "The developers of Palpate"),
    ),
    servers((url = "/", description = "This server")),
    tags(
        (name = "sensors", description = "Tactile sensors: geometry and response"),
        (name = "analyses", description = "Computations about sensors; nothing is stored"),
        (name = "objects", description = "Objects to recognise: their meshes and training readings"),
        (name = "training", description = "Catalogues: trained versions, and the current one"),
        (name = "jobs", description = "Training jobs"),
        (name = "sessions", description = "Recognition: readings in, beliefs out"),
        (name = "keys", description = "API keys, robot names and the audit log"),
        (name = "webhooks", description = "Signed events for other programs"),
        (name = "admin", description = "Snapshots and compaction of the stored data"),
        (name = "site", description = "Health, metrics, version"),
    ),
    components(schemas(Problem, FieldError, SessionEvent, Job, BeliefDetail, PlyForm,
        WebhookEvent)),
)]
struct Document;

/// The description of the API that this server serves.
#[must_use]
pub fn document() -> OpenApi {
    let mut document = Document::openapi();
    document.merge(routes::api().into_openapi());
    for (path, item) in &mut document.paths.paths {
        operations(item).for_each(|(method, operation)| {
            add_roles(operation);
            add_location(operation);
            if method == "GET" {
                add_unchanged(operation);
            }
            add_problems(operation, method != "GET");
            events::describe_stream(operation);
            examples::add(path, operation);
        });
    }
    document.webhooks = Some(events::webhooks());
    let scheme = Http::builder().scheme(HttpAuthScheme::Bearer).description(Some(KEY));
    let components = document.components.get_or_insert_default();
    unions::name_variants(&mut components.schemas);
    unions::accept_null(&mut components.schemas);
    components.add_security_scheme(SCHEME, SecurityScheme::Http(scheme.build()));
    document
}

/// The description as it is served and committed: JSON, indented, with a final newline.
///
/// # Panics
/// Never: a description consists of strings, numbers and lists.
#[must_use]
pub fn text() -> &'static str {
    static TEXT: OnceLock<String> = OnceLock::new();
    TEXT.get_or_init(|| {
        let mut text = document().to_pretty_json().expect("a description can be written as JSON");
        text.push('\n');
        text
    })
}

/// Adds the permitted roles of an operation, or that it needs no key.
fn add_roles(operation: &mut Operation) {
    let rule = operation.operation_id.as_deref().and_then(roles::rule);
    let Some(Rule { who: Who::Holders(roles), .. }) = rule else {
        operation.security = Some(Vec::new());
        return;
    };
    // A server without keys takes requests without one.
    let open = SecurityRequirement::default();
    operation.security = Some(vec![SecurityRequirement::new(SCHEME, [""; 0]), open]);
    let named: Vec<&str> = roles.iter().map(|role| roles::name(*role)).collect();
    operation.extensions = Some(Extensions::from_iter([("x-palpate-roles", named)]));
    let responses = &mut operation.responses.responses;
    let needed = format!("The key has none of the required roles: {}", roles::listed(roles));
    responses.insert("401".to_owned(), problem("The API key is missing or not valid"));
    responses.insert("403".to_owned(), problem(&needed));
}

/// Adds the header `Location` to the answers of creating operations.
fn add_location(operation: &mut Operation) {
    for made in ["201", "202"] {
        if let Some(RefOr::T(response)) = operation.responses.responses.get_mut(made) {
            let mut location = Header::default();
            location.description = Some("The path of the new resource".to_owned());
            response.headers.insert("location".to_owned(), location.into());
        }
    }
}

/// Adds the answer to a client that has what it asks for, where answers have an `ETag`.
fn add_unchanged(operation: &mut Operation) {
    let responses = &mut operation.responses.responses;
    let Some(RefOr::T(given)) = responses.get("200") else { return };
    let Some(etag) = given.headers.get("etag").cloned() else { return };
    let mut unchanged =
        Response::new("Not modified: the client has it, by a tag in `If-None-Match`");
    unchanged.headers.insert("etag".to_owned(), etag);
    responses.insert("304".to_owned(), unchanged.into());
}

fn add_problems(operation: &mut Operation, writes: bool) {
    let has = |place: ParameterIn| {
        let parameters = operation.parameters.iter().flatten();
        parameters.into_iter().any(|parameter| match parameter {
            RefOr::T(parameter) => parameter.parameter_in == place,
            RefOr::Ref(_) => false,
        })
    };
    let (in_path, in_query) = (has(ParameterIn::Path), has(ParameterIn::Query));
    let has_body = operation.request_body.is_some();
    let mut add = |status: &str, description: &str| {
        let responses = &mut operation.responses.responses;
        responses.entry(status.to_owned()).or_insert_with(|| problem(description));
    };
    if in_path {
        add("404", "Nothing has this id or name");
    }
    if has_body {
        add("400", "The body cannot be read");
        add("408", "The body did not arrive in time");
        add("413", "The body is too large");
        add("415", "The content type is not one of those expected");
    }
    if has_body || in_query {
        add("422", "A value is invalid; `errors` names it");
    }
    if writes {
        add("507", "The disk is full: nothing was stored");
    }
    add("429", "The client exceeds its share; `Retry-After` says when to try again");
    add("500", "Internal error, or the stored data is damaged");
    add("503", "Overloaded or shutting down; `Retry-After` says when to try again");
    for status in ["429", "503"] {
        if let Some(RefOr::T(response)) = operation.responses.responses.get_mut(status) {
            response.headers.extend(bound_headers());
        }
    }
}

/// The headers of answers over a limit; `RateLimit` is missing where there is no single limit.
fn bound_headers() -> impl Iterator<Item = (String, RefOr<Header>)> {
    let headers = [
        ("Retry-After", "Whole seconds to wait; absent if waiting does not help"),
        ("RateLimit-Policy", "The limit: its name, quota `q` and unit `qu`"),
        (
            "RateLimit",
            "The limit's name, the remaining quota `r` and the seconds `t` until it is replenished",
        ),
    ];
    headers.into_iter().map(|(name, description)| {
        let mut header = Header::default();
        header.description = Some(description.to_owned());
        (name.to_owned(), header.into())
    })
}

fn problem(description: &str) -> RefOr<Response> {
    let schema = Ref::from_schema_name("Problem");
    let content = Content::builder().schema(Some(schema)).build();
    Response::builder().description(description).content(CONTENT_TYPE, content).build().into()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_committed_description_is_the_served_one() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../schemas/openapi.json");
        if std::env::var_os("UPDATE_OPENAPI").is_some() {
            std::fs::write(path, text()).unwrap();
        }
        let committed = std::fs::read_to_string(path).unwrap();
        assert!(
            committed == text(),
            "schemas/openapi.json has drifted: \
             UPDATE_OPENAPI=1 cargo test -p palpate-server openapi rewrites it"
        );
    }

    #[test]
    fn operations_have_everything_that_generators_need() {
        let mut document = document();
        assert!(document.info.license.is_some() && document.servers.is_some());
        let mut ids = BTreeSet::new();
        for (path, item) in &mut document.paths.paths {
            for (_, operation) in operations(item) {
                let id = operation.operation_id.clone().unwrap_or_default();
                assert!(!id.is_empty() && ids.insert(id.clone()), "{path}: id {id:?}");
                assert!(operation.summary.as_ref().is_some_and(|s| !s.is_empty()), "{id}: summary");
                assert!(operation.tags.as_ref().is_some_and(|tags| tags.len() == 1), "{id}: tag");
                let responses = &operation.responses.responses;
                let n_success = responses.keys().filter(|status| status.starts_with('2')).count();
                assert_eq!(n_success, 1, "{id}: one success");
                for (status, response) in responses {
                    let RefOr::T(response) = response else { panic!("{id}: {status} is a ref") };
                    assert!(!response.description.is_empty(), "{id}: {status} description");
                    let is_problem = response.content.contains_key(CONTENT_TYPE);
                    let is_error = status.starts_with(['4', '5']);
                    assert_eq!(is_problem, is_error, "{id}: {status} content");
                }
            }
        }
        assert!(ids.len() > 30, "{}", ids.len());
    }

    /// Every `$ref` below a value.
    fn references<'a>(value: &'a serde_json::Value, found: &mut BTreeSet<&'a str>) {
        match value {
            serde_json::Value::Object(fields) => {
                found.extend(fields.get("$ref").and_then(serde_json::Value::as_str));
                fields.values().for_each(|field| references(field, found));
            }
            serde_json::Value::Array(items) => {
                items.iter().for_each(|item| references(item, found));
            }
            _ => {}
        }
    }

    #[test]
    fn every_reference_resolves() {
        let json = serde_json::to_value(document()).unwrap();
        let mut found = BTreeSet::new();
        references(&json, &mut found);
        assert!(found.contains("#/components/schemas/Problem"));
        for reference in found {
            let pointer = reference.trim_start_matches('#');
            assert!(json.pointer(pointer).is_some(), "{reference} leads nowhere");
        }
    }

    #[test]
    fn no_schema_is_generic_or_untagged() {
        let json = serde_json::to_value(document()).unwrap();
        let schemas = json["components"]["schemas"].as_object().unwrap();
        for (name, schema) in schemas {
            assert!(name.chars().all(char::is_alphanumeric), "{name} is generic");
            assert!(schema.get("anyOf").is_none(), "{name} is untagged");
            let is_of_rust = ["BTreeMap", "Vec", "Option", "Box"].contains(&name.as_str());
            assert!(!is_of_rust, "{name} is a type of Rust");
        }
        assert!(schemas.contains_key("SessionEvent"));
    }

    #[test]
    fn no_schema_has_a_field_of_its_own_name() {
        // Generated Python would give one variable two types.
        let json = serde_json::to_value(document()).unwrap();
        for (name, schema) in json["components"]["schemas"].as_object().unwrap() {
            let own = |field: &String| field.replace('_', "") == name.to_lowercase();
            let fields = schema["properties"].as_object();
            assert!(!fields.is_some_and(|fields| fields.keys().any(own)), "{name}");
        }
    }

    #[test]
    fn every_reference_leads_to_a_schema() {
        let json = serde_json::to_value(document()).unwrap();
        let schemas = json["components"]["schemas"].as_object().unwrap();
        let mut references = BTreeSet::new();
        collect_references(&json, &mut references);
        assert!(references.len() > 100, "{}", references.len());
        for reference in references {
            let name = reference.strip_prefix("#/components/schemas/");
            assert!(name.is_some_and(|name| schemas.contains_key(name)), "{reference}");
        }
    }

    fn collect_references(json: &serde_json::Value, found: &mut BTreeSet<String>) {
        match json {
            serde_json::Value::Object(fields) => {
                if let Some(serde_json::Value::String(reference)) = fields.get("$ref") {
                    found.insert(reference.clone());
                }
                fields.values().for_each(|value| collect_references(value, found));
            }
            serde_json::Value::Array(items) => {
                items.iter().for_each(|value| collect_references(value, found));
            }
            _ => {}
        }
    }

    #[test]
    fn every_union_of_objects_has_a_discriminator() {
        let json = serde_json::to_value(document()).unwrap();
        let schemas = json["components"]["schemas"].as_object().unwrap();
        let mut unions = Vec::new();
        for (name, schema) in schemas {
            let Some(items) = schema["oneOf"].as_array() else { continue };
            unions.push(name.as_str());
            let mapping = schema["discriminator"]["mapping"].as_object().unwrap();
            assert_eq!(mapping.len(), items.len(), "{name}");
            for (tag, reference) in mapping {
                let variant = reference.as_str().unwrap().rsplit('/').next().unwrap();
                let kind = &schemas[variant]["properties"]["kind"]["enum"];
                assert_eq!(*kind, serde_json::json!([tag]), "{name}");
            }
        }
        assert_eq!(unions, ["PosePrior", "SessionChange", "SessionEvent"]);
    }

    #[test]
    fn examples_of_requests_are_included() {
        let json = serde_json::to_value(document()).unwrap();
        let request = &json["paths"]["/v1/sessions"]["post"]["requestBody"]["content"];
        assert_eq!(request["application/json"]["example"]["frame_id"], "base_link");
        let readings = &json["paths"]["/v1/sessions/{session}/readings"]["post"];
        let refusal = &readings["responses"]["422"]["content"][CONTENT_TYPE]["example"];
        assert_eq!(refusal["errors"][0]["pointer"], "/readings/0/pose/orientation");
    }
}
