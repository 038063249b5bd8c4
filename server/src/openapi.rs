//! The API's description: made from the routes, finished here, committed in
//! `schemas/openapi.json`.
//!
//! Every operation gets the answers that any may give: problems with its path, its body and
//! its query, and a server that is busy or at fault. A test fails when the committed file
//! drifts; `UPDATE_OPENAPI=1 cargo test -p palpate-server openapi` rewrites it.

use std::sync::OnceLock;

use palpate_schemas::{FieldError, Job, Problem, SessionEvent};
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::path::{Operation, ParameterIn, PathItem};
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{Content, Header, OpenApi, Ref, RefOr, Response};
use utoipa::{IntoResponses, OpenApi as _, ToSchema};

use crate::problem::CONTENT_TYPE;
use crate::roles::{self, Rule, Who};
use crate::routes;

/// The answer of an operation that may not fit the state of things.
#[derive(IntoResponses)]
#[response(
    status = 409,
    content_type = "application/problem+json",
    description = "It does not fit the state of things, or something else has its name or number"
)]
pub(crate) struct Conflict(#[expect(dead_code, reason = "the type only documents")] Problem);

/// A mesh file, as its program wrote it.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct MeshFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);

/// A snapshot, as `docs/formats.md` draws it.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct SnapshotFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);

/// A map of contact as an image or a model.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct MapFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);

/// What the description calls keys.
const SCHEME: &str = "key";
const KEY: &str = "An API key, `palpate_…`, where the server asks for one. `x-palpate-roles` of \
    an operation lists the roles that may call it; operations without need no key.";

#[derive(utoipa::OpenApi)]
#[openapi(
    info(
        title = "Palpate",
        description = "Fleets of robots recognise objects by touch. Units are SI: metres, \
            pascals, seconds, radians. Quaternions are x, y, z, w. Errors are \
            `application/problem+json` (RFC 9457).",
        license(name = "Apache-2.0", identifier = "Apache-2.0"),
    ),
    servers((url = "/", description = "This server")),
    tags(
        (name = "sensors", description = "Tactile sensors: geometry and response"),
        (name = "analyses", description = "Questions about sensors, answered without storing"),
        (name = "objects", description = "Things to recognise: meshes and training readings"),
        (name = "training", description = "Catalogues: trained versions, and the current one"),
        (name = "jobs", description = "Trainings under way"),
        (name = "sessions", description = "Recognising: readings in, beliefs out"),
        (name = "keys", description = "API keys, and who changed what"),
        (name = "admin", description = "Copies of all that is stored"),
        (name = "site", description = "Health, metrics, version"),
    ),
    components(schemas(Problem, FieldError, SessionEvent, Job)),
)]
struct Document;

/// The description of the API that this server serves.
#[must_use]
pub fn document() -> OpenApi {
    let mut document = Document::openapi();
    document.merge(routes::api().into_openapi());
    for item in document.paths.paths.values_mut() {
        operations(item).for_each(|(method, operation)| {
            add_roles(operation);
            add_location(operation);
            add_problems(operation, method != "GET");
        });
    }
    let scheme = Http::builder().scheme(HttpAuthScheme::Bearer).description(Some(KEY));
    let components = document.components.get_or_insert_default();
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

/// Every operation as path, method and id.
pub(crate) fn operation_ids() -> Vec<(String, &'static str, String)> {
    let mut ids = Vec::new();
    for (path, item) in &mut routes::api().into_openapi().paths.paths {
        for (method, operation) in operations(item) {
            ids.push((path.clone(), method, operation.operation_id.clone().unwrap_or_default()));
        }
    }
    ids
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = (&'static str, &mut Operation)> {
    [
        ("GET", &mut item.get),
        ("PUT", &mut item.put),
        ("POST", &mut item.post),
        ("PATCH", &mut item.patch),
        ("DELETE", &mut item.delete),
    ]
    .into_iter()
    .filter_map(|(method, operation)| Some((method, operation.as_mut()?)))
}

/// Says which roles may call an operation; nothing of one that the table does not know.
fn add_roles(operation: &mut Operation) {
    let rule = operation.operation_id.as_deref().and_then(roles::rule);
    let Some(Rule { who: Who::Holders(roles), .. }) = rule else { return };
    operation.security = Some(vec![SecurityRequirement::new(SCHEME, [""; 0])]);
    let named: Vec<&str> = roles.iter().map(|role| roles::name(*role)).collect();
    operation.extensions = Some(Extensions::from_iter([("x-palpate-roles", named)]));
    let responses = &mut operation.responses.responses;
    let needed = format!("The key has none of the roles that this needs: {}", roles::listed(roles));
    responses.insert("401".to_owned(), problem("No API key came, or none that is let in"));
    responses.insert("403".to_owned(), problem(&needed));
}

/// What is made has a path, and the answer says which.
fn add_location(operation: &mut Operation) {
    for made in ["201", "202"] {
        if let Some(RefOr::T(response)) = operation.responses.responses.get_mut(made) {
            let mut location = Header::default();
            location.description = Some("The path of what was made".to_owned());
            response.headers.insert("location".to_owned(), location.into());
        }
    }
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
        add("404", "There is nothing with this id or name");
    }
    if has_body {
        add("400", "The body cannot be read");
        add("408", "The body did not arrive in time");
        add("413", "The body is too large");
        add("415", "The content type is not one of those expected");
    }
    if has_body || in_query {
        add("422", "A value is wrong; `errors` names it");
    }
    if writes {
        add("507", "The disk is full: nothing was stored");
    }
    add("500", "The server is at fault, or what is stored is damaged");
    add("503", "Too much at once, or stopping; `Retry-After` says when to ask again");
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
    fn the_committed_openapi_document_is_what_the_server_serves() {
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
    fn every_operation_has_what_generators_need() {
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

    #[test]
    fn no_schema_is_generic_or_untagged() {
        let json = serde_json::to_value(document()).unwrap();
        let schemas = json["components"]["schemas"].as_object().unwrap();
        for (name, schema) in schemas {
            assert!(name.chars().all(char::is_alphanumeric), "{name} is generic");
            assert!(schema.get("anyOf").is_none(), "{name} is untagged");
        }
        assert!(schemas.contains_key("SessionEvent"));
    }
}
