//! `…/labels` of sessions, objects, sensors and catalogues, and the aliases of versions.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use palpate_schemas::{Catalogue, ObjectInfo, Sensor, Session, SetAlias, SetLabels};

use crate::app::App;
use crate::extract::{JsonBody, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::Deleted;
use crate::wire;

/// Set a session's labels
///
/// Replaces all labels, also of an ended session. `GET /v1/sessions?labels=…` searches for them.
#[utoipa::path(put, path = "/v1/sessions/{session}/labels", operation_id = "set_session_labels",
    tag = "sessions", request_body = SetLabels,
    params(("session" = Uuid, Path, description = "The session's id")),
    responses((status = 200, description = "The session", body = Session)))]
pub(crate) async fn set_session_labels(
    State(app): State<App>,
    Segments(session): Segments,
    JsonBody(request): JsonBody<SetLabels>,
) -> Result<Json<Session>, Refusal> {
    Ok(Json(app.sessions.label(&session, request).await?))
}

/// Set an object's labels
///
/// Replaces all labels. `GET /v1/objects?labels=…` searches for them.
#[utoipa::path(put, path = "/v1/objects/{object}/labels", operation_id = "set_object_labels",
    tag = "objects", request_body = SetLabels,
    params(("object" = String, Path, description = "The object's id or name")),
    responses((status = 200, description = "The object", body = ObjectInfo)))]
pub(crate) async fn set_object_labels(
    State(app): State<App>,
    Segments(object): Segments,
    JsonBody(request): JsonBody<SetLabels>,
) -> Result<Json<ObjectInfo>, Refusal> {
    let object = app.objects.label(&object, request).await?;
    Ok(Json(app.objects.show(&object)?))
}

/// Set a sensor's labels
///
/// Replaces all labels; everything else of a sensor is immutable. `GET /v1/sensors?labels=…`
/// searches for them.
#[utoipa::path(put, path = "/v1/sensors/{sensor}/labels", operation_id = "set_sensor_labels",
    tag = "sensors", request_body = SetLabels,
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 200, description = "The sensor", body = Sensor)))]
pub(crate) async fn set_sensor_labels(
    State(app): State<App>,
    Segments(sensor): Segments,
    JsonBody(request): JsonBody<SetLabels>,
) -> Result<Json<Sensor>, Refusal> {
    let sensor = app.sensors.label(&sensor, request).await?;
    Ok(Json(app.sensors.show(&sensor)?))
}

/// Set a catalogue's labels
///
/// Replaces all labels. `GET /v1/catalogues?labels=…` searches for them.
#[utoipa::path(put, path = "/v1/catalogues/{name}/labels", operation_id = "set_catalogue_labels",
    tag = "training", request_body = SetLabels,
    params(("name" = String, Path, description = "The catalogue's name")),
    responses((status = 200, description = "The catalogue", body = Catalogue)))]
pub(crate) async fn set_catalogue_labels(
    State(app): State<App>,
    Segments(name): Segments,
    JsonBody(request): JsonBody<SetLabels>,
) -> Result<Json<Catalogue>, Refusal> {
    Ok(Json(wire::training::catalogue(&app.catalogues.label(&name, &request).await?)))
}

/// Let an alias name a version
///
/// Sessions can be opened with `alias` in place of a version; they keep the version that it names
/// then. `current` is set by `PUT …/current`. A version with an alias cannot be deleted.
#[utoipa::path(put, path = "/v1/catalogues/{name}/aliases/{alias}", operation_id = "set_alias",
    tag = "training", request_body = SetAlias,
    params(("name" = String, Path, description = "The catalogue's name"),
        ("alias" = String, Path, description = "The alias, such as `candidate`")),
    responses((status = 200, description = "The catalogue", body = Catalogue)))]
pub(crate) async fn set_alias(
    State(app): State<App>,
    Segments((name, alias)): Segments<(String, String)>,
    JsonBody(request): JsonBody<SetAlias>,
) -> Result<Json<Catalogue>, Refusal> {
    let catalogue = app.catalogues.set_alias(&name, &alias, request.version).await?;
    Ok(Json(wire::training::catalogue(&catalogue)))
}

/// Remove an alias
///
/// The version that it named stays, and so do sessions that were opened with it.
#[utoipa::path(delete, path = "/v1/catalogues/{name}/aliases/{alias}",
    operation_id = "remove_alias", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("alias" = String, Path, description = "The alias")),
    responses(Deleted))]
pub(crate) async fn remove_alias(
    State(app): State<App>,
    Segments((name, alias)): Segments<(String, String)>,
) -> Result<StatusCode, Refusal> {
    app.catalogues.remove_alias(&name, &alias).await?;
    Ok(StatusCode::NO_CONTENT)
}
