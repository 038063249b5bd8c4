//! `/v1/fleet`

use axum::Json;
use axum::extract::State;
use palpate_schemas::{AcknowledgeSessions, CloseSessions, Fleet, FleetChanged, FleetQuery};

use crate::app::App;
use crate::extract::{JsonBody, Params};
use crate::refusal::Refusal;

/// Get the fleet
///
/// Returns the open sessions, those that need attention first, with the reason, their robots and
/// their latest belief. This is a snapshot: poll it, and follow beliefs with `GET /v1/events`. A
/// session that changes its place between two pages may come twice or not at all.
#[utoipa::path(get, path = "/v1/fleet", operation_id = "get_fleet", tag = "sessions",
    params(FleetQuery),
    responses((status = 200, description = "A page of the open sessions", body = Fleet)))]
pub(crate) async fn get_fleet(
    State(app): State<App>,
    Params(query): Params<FleetQuery>,
) -> Result<Json<Fleet>, Refusal> {
    Ok(Json(app.sessions.fleet(query).await?))
}

/// Acknowledge the alarms of sessions
///
/// The alarms of these open sessions need no attention any more; later ones do, unless the
/// sessions are muted. What cannot be done for one session is in its result.
#[utoipa::path(post, path = "/v1/fleet/acknowledgements", operation_id = "acknowledge_sessions",
    tag = "sessions", request_body = AcknowledgeSessions,
    responses((status = 200, description = "What became of each session", body = FleetChanged)))]
pub(crate) async fn acknowledge_sessions(
    State(app): State<App>,
    JsonBody(request): JsonBody<AcknowledgeSessions>,
) -> Result<Json<FleetChanged>, Refusal> {
    Ok(Json(app.sessions.acknowledge(&request).await?))
}

/// Close sessions
///
/// Closes many sessions at once, without stating their true objects. What cannot be done for one
/// session is in its result.
#[utoipa::path(post, path = "/v1/fleet/closings", operation_id = "close_sessions",
    tag = "sessions", request_body = CloseSessions,
    responses((status = 200, description = "What became of each session", body = FleetChanged)))]
pub(crate) async fn close_sessions(
    State(app): State<App>,
    JsonBody(request): JsonBody<CloseSessions>,
) -> Result<Json<FleetChanged>, Refusal> {
    Ok(Json(app.sessions.close_many(&request).await?))
}
