//! `/v1/keys`, `/v1/whoami`, and the robot names that keys hold: `/v1/robots`.

use axum::Json;
use axum::extract::{Extension, State};
use axum::http::StatusCode;
use axum::response::Response;
use palpate_schemas::{
    ApiKey, ApiKeyPage, BindRobot, CreateKey, NewApiKey, PageQuery, Robot, RobotPage, RotateKey,
    Whoami,
};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments};
use crate::middleware::caller::Caller;
use crate::refusal::Refusal;
use crate::routes::documented::Conflict;

/// List the keys
///
/// Lists the keys without their secrets. A secret cannot be shown again.
#[utoipa::path(get, path = "/v1/keys", operation_id = "list_keys", tag = "keys",
    params(PageQuery),
    responses((status = 200, description = "A page of keys, oldest first", body = ApiKeyPage)))]
pub(crate) async fn list_keys(
    State(app): State<App>,
    Params(query): Params<PageQuery>,
) -> Result<Json<ApiKeyPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.keys.list(&query)).await?))
}

/// Create a key
///
/// Returns the secret, once. The first key takes effect at the next start: from then on the server
/// requires keys.
#[utoipa::path(post, path = "/v1/keys", operation_id = "create_key", tag = "keys",
    request_body = CreateKey,
    responses((status = 201, description = "The new key and its secret", body = NewApiKey),
        Conflict))]
pub(crate) async fn create_key(
    State(app): State<App>,
    JsonBody(request): JsonBody<CreateKey>,
) -> Result<Response, Refusal> {
    let created = app.keys.create(&request).await?;
    Ok(super::created(format!("/v1/keys/{}", created.key.id), created))
}

/// Get a key
///
/// Name, role and times of a key. Its secret is not shown again.
#[utoipa::path(get, path = "/v1/keys/{key}", operation_id = "get_key", tag = "keys",
    params(("key" = String, Path, description = "The key's id or name")),
    responses((status = 200, description = "The key", body = ApiKey)))]
pub(crate) async fn get_key(
    State(app): State<App>,
    Segments(key): Segments,
) -> Result<Json<ApiKey>, Refusal> {
    Ok(Json(app.keys.shown(&app.keys.get(&key)?)))
}

/// Revoke a key
///
/// Refuses the key from now on and ends the event streams it opened. The key stays in the list. 409
/// for the last admin key, which cannot be revoked.
#[utoipa::path(delete, path = "/v1/keys/{key}", operation_id = "revoke_key", tag = "keys",
    params(("key" = String, Path, description = "The key's id or name")),
    responses((status = 204, description = "The key is revoked"), Conflict))]
pub(crate) async fn revoke_key(
    State(app): State<App>,
    Segments(key): Segments,
) -> Result<StatusCode, Refusal> {
    app.keys.revoke(&key).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Rotate a key's secret
///
/// Returns the new secret, once. The previous secret stops working at once, or after `grace_s`
/// seconds. 409 if the key was revoked or has expired.
#[utoipa::path(post, path = "/v1/keys/{key}/rotate", operation_id = "rotate_key", tag = "keys",
    request_body = RotateKey,
    params(("key" = String, Path, description = "The key's id or name")),
    responses((status = 200, description = "The key and its new secret", body = NewApiKey),
        Conflict))]
pub(crate) async fn rotate_key(
    State(app): State<App>,
    Segments(key): Segments,
    JsonBody(request): JsonBody<RotateKey>,
) -> Result<Json<NewApiKey>, Refusal> {
    Ok(Json(app.keys.rotate(&key, &request).await?))
}

/// Show the caller's key and role
///
/// The role of the caller and, on a server with keys, the key of the request.
#[utoipa::path(get, path = "/v1/whoami", operation_id = "whoami", tag = "keys",
    responses((status = 200, description = "The caller's key and role", body = Whoami)))]
pub(crate) async fn whoami(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
) -> Json<Whoami> {
    Json(Whoami {
        keys_required: app.keys.required(),
        role: caller.role(),
        key: caller.key.as_ref().map(|key| app.keys.shown(key)),
        quota_bytes: app.storage.quota().filter(|_| caller.key.is_some()),
    })
}

/// List the robot names held by keys
///
/// A robot name belongs, across the whole fleet, to the key that first used it in a session's
/// reading. A reading posted under that name with another key is refused (403). Revoking a key
/// releases its names. On a server without keys, names belong to nobody.
#[utoipa::path(get, path = "/v1/robots", operation_id = "list_robots", tag = "keys",
    params(PageQuery),
    responses((status = 200, description = "A page of names", body = RobotPage)))]
pub(crate) async fn list_robots(
    State(app): State<App>,
    Params(query): Params<PageQuery>,
) -> Result<Json<RobotPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.keys.list_robots(&query)).await?))
}

/// Assign a robot name to a key
///
/// Takes the name from the key that held it. Stored readings keep the key they were written with.
/// 409 if the key was revoked.
#[utoipa::path(put, path = "/v1/robots/{robot}", operation_id = "bind_robot", tag = "keys",
    request_body = BindRobot,
    params(("robot" = String, Path, description = "The robot's name")),
    responses((status = 200, description = "The name and its key", body = Robot), Conflict))]
pub(crate) async fn bind_robot(
    State(app): State<App>,
    Segments(robot): Segments,
    JsonBody(request): JsonBody<BindRobot>,
) -> Result<Json<Robot>, Refusal> {
    Ok(Json(app.keys.bind_robot(&robot, &request).await?))
}

/// Release a robot name
///
/// The name then belongs to the next key that uses it.
#[utoipa::path(delete, path = "/v1/robots/{robot}", operation_id = "release_robot", tag = "keys",
    params(("robot" = String, Path, description = "The robot's name")),
    responses((status = 204, description = "Released")))]
pub(crate) async fn release_robot(
    State(app): State<App>,
    Segments(robot): Segments,
) -> Result<StatusCode, Refusal> {
    app.keys.release_robot(&robot).await?;
    Ok(StatusCode::NO_CONTENT)
}
