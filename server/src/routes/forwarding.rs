//! Forwarding: sessions that cells bring, packages that cells fetch, and how far a cell is.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use palpate_schemas::{
    EntriesForwarded, ForwardEntries, ForwardSession, Forwarding, PageQuery, SensorPackage,
    Session, VersionPackage,
};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::{Conflict, Ended};

/// Forward a session
///
/// For a cell (`palpate serve --forward-to`): creates its session here under the same id, or finds
/// it. The session does not expire; the cell closes it. 404 if this server does not have the
/// version, 409 if its version has another content, or if the id belongs to another session.
#[utoipa::path(put, path = "/v1/sessions/{session}", operation_id = "forward_session",
    tag = "sessions", request_body = ForwardSession,
    params(("session" = Uuid, Path, description = "The session's id at the cell, a UUIDv7")),
    responses((status = 200, description = "The session; `revision` tells how many entries it has",
        body = Session), Conflict))]
pub(crate) async fn forward_session(
    State(app): State<App>,
    Segments(session): Segments,
    JsonBody(request): JsonBody<ForwardSession>,
) -> Result<Json<Session>, Refusal> {
    Ok(Json(app.sessions.forward(&session, &request).await?))
}

/// Forward entries of a session
///
/// For a cell: appends readings and retractions at the numbers that they have there, so that a
/// repetition changes nothing. 409 if an entry has another content than the stored one, or does not
/// follow; 410 if the session was closed here.
#[utoipa::path(post, path = "/v1/sessions/{session}/forwarded", operation_id = "forward_entries",
    tag = "sessions", request_body = ForwardEntries,
    params(("session" = Uuid, Path, description = "The session's id")),
    responses((status = 200, description = "The number of entries now", body = EntriesForwarded),
        Conflict, Ended))]
pub(crate) async fn forward_entries(
    State(app): State<App>,
    Segments(session): Segments,
    JsonBody(request): JsonBody<ForwardEntries>,
) -> Result<Json<EntriesForwarded>, Refusal> {
    Ok(Json(app.sessions.forward_entries(&session, &request).await?))
}

/// Get the state of forwarding
///
/// Whether this server is a cell, what waits to be forwarded, and since when the line is down.
#[utoipa::path(get, path = "/v1/forwarding", operation_id = "get_forwarding", tag = "site",
    responses((status = 200, description = "The state", body = Forwarding)))]
pub(crate) async fn get_forwarding(State(app): State<App>) -> Json<Forwarding> {
    Json(app.outgoing.shown())
}

/// Get a version as a package
///
/// For a cell: describes a version so that another server can take it over with the same number,
/// and names its blocks, which `…/blocks/{hash}` returns.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}/package",
    operation_id = "get_package", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number")),
    responses((status = 200, description = "The package", body = VersionPackage)))]
pub(crate) async fn get_package(
    State(app): State<App>,
    Segments((name, version)): Segments<(String, String)>,
) -> Result<Json<VersionPackage>, Refusal> {
    Ok(Json(app.apart(move |app| app.catalogues.package(&name, &version)).await?))
}

/// Get a block of a version
///
/// The content of a block, which has the hash in the path.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}/blocks/{hash}",
    operation_id = "get_block", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("hash" = String, Path, description = "The block's BLAKE3 hash, in hexadecimal")),
    responses((status = 200, description = "The block", body = Vec<u8>,
        content_type = "application/octet-stream")))]
pub(crate) async fn get_block(
    State(app): State<App>,
    Segments((name, version, hash)): Segments<(String, String, String)>,
) -> Result<Response, Refusal> {
    let block = app.apart(move |app| app.catalogues.block(&name, &version, &hash)).await?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], block).into_response())
}

/// Get a sensor as a package
///
/// For a cell: the sensor with a page of its calibrations and passports, as they are stored.
#[utoipa::path(get, path = "/v1/sensors/{sensor}/package", operation_id = "get_sensor_package",
    tag = "sensors",
    params(("sensor" = String, Path, description = "The sensor's id or name"), PageQuery),
    responses((status = 200, description = "The package", body = SensorPackage)))]
pub(crate) async fn get_sensor_package(
    State(app): State<App>,
    Segments(sensor): Segments,
    Params(query): Params<PageQuery>,
) -> Result<Json<SensorPackage>, Refusal> {
    Ok(Json(app.apart(move |app| app.sensors.package(&sensor, &query)).await?))
}
