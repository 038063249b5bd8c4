//! `/v1/fleet`

use axum::Json;
use axum::extract::State;
use palpate_schemas::{Fleet, FleetQuery};

use crate::app::App;
use crate::extract::Params;
use crate::refusal::Refusal;

/// Get the fleet
///
/// Returns the most recently active open sessions, with their robots and the time of their newest
/// reading. This is a snapshot: poll it, and follow beliefs with `GET /v1/events`.
#[utoipa::path(get, path = "/v1/fleet", operation_id = "get_fleet", tag = "sessions",
    params(FleetQuery),
    responses((status = 200, description = "The most recently active open sessions", body = Fleet)))]
pub(crate) async fn get_fleet(
    State(app): State<App>,
    Params(query): Params<FleetQuery>,
) -> Result<Json<Fleet>, Refusal> {
    Ok(Json(app.sessions().fleet(query).await?))
}
