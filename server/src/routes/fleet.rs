//! `/v1/fleet`

use axum::Json;
use axum::extract::State;
use palpate_schemas::{Fleet, FleetQuery};

use crate::app::App;
use crate::extract::Params;
use crate::refusal::Refusal;

/// Look at the fleet
///
/// The open sessions in which something happened last, with their robots and the time of their
/// newest reading. Ask again now and then; what is believed in between comes by
/// `GET /v1/events`.
#[utoipa::path(get, path = "/v1/fleet", operation_id = "get_fleet", tag = "sessions",
    params(FleetQuery),
    responses((status = 200, description = "The open sessions", body = Fleet)))]
pub(crate) async fn get_fleet(
    State(app): State<App>,
    Params(query): Params<FleetQuery>,
) -> Result<Json<Fleet>, Refusal> {
    Ok(Json(app.sessions().fleet(query).await?))
}
