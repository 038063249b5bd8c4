//! `/v1/robots`

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use palpate_schemas::{BindRobot, PageQuery, Robot, RobotPage};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::Conflict;

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
    Ok(Json(app.apart(move |app| app.keys().list_robots(&query)).await?))
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
    Ok(Json(app.keys().bind_robot(&robot, &request).await?))
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
    app.keys().release_robot(&robot).await?;
    Ok(StatusCode::NO_CONTENT)
}
