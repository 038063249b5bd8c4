//! `/v1/robots`

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use palpate_schemas::{BindRobot, PageQuery, Robot, RobotPage};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segment1};
use crate::routes::documented::Conflict;
use crate::refusal::Refusal;

/// List the names of robots that belong to keys
///
/// A robot's name belongs to the key that used it first in a session's reading, over the whole
/// fleet; a reading that another key posts with it is refused (403). Revoking a key releases its
/// names. Where nobody is asked for a key, names belong to nobody.
#[utoipa::path(get, path = "/v1/robots", operation_id = "list_robots", tag = "keys",
    params(PageQuery),
    responses((status = 200, description = "A page of names", body = RobotPage)))]
pub(crate) async fn list_robots(
    State(app): State<App>,
    Params(query): Params<PageQuery>,
) -> Result<Json<RobotPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.keys().list_robots(&query)).await?))
}

/// Give a robot's name to a key
///
/// Whatever key it belonged to. What is stored keeps the key that it was written with. 409 when
/// the key was revoked.
#[utoipa::path(put, path = "/v1/robots/{robot}", operation_id = "bind_robot", tag = "keys",
    request_body = BindRobot,
    params(("robot" = String, Path, description = "The robot's name")),
    responses((status = 200, description = "The name and its key", body = Robot), Conflict))]
pub(crate) async fn bind_robot(
    State(app): State<App>,
    Segment1(robot): Segment1,
    JsonBody(request): JsonBody<BindRobot>,
) -> Result<Json<Robot>, Refusal> {
    Ok(Json(app.keys().bind_robot(&robot, &request).await?))
}

/// Release a robot's name
///
/// It belongs to the key that uses it next.
#[utoipa::path(delete, path = "/v1/robots/{robot}", operation_id = "release_robot", tag = "keys",
    params(("robot" = String, Path, description = "The robot's name")),
    responses((status = 204, description = "It belongs to no key")))]
pub(crate) async fn release_robot(
    State(app): State<App>,
    Segment1(robot): Segment1,
) -> Result<StatusCode, Refusal> {
    app.keys().release_robot(&robot).await?;
    Ok(StatusCode::NO_CONTENT)
}
