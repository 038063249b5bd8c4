//! `/v1/members`: the servers that divide the objects of catalogues.

use axum::Json;
use axum::extract::State;
use palpate_schemas::Members;

use crate::app::App;
use crate::refusal::Refusal;

/// Get the servers that divide catalogues
///
/// Returns the servers of this cluster that hold the objects of large catalogues
/// (`--divide-copies`), and how many blocks of each version they have in memory, as far as the
/// server that answers has heard within the last seconds.
#[utoipa::path(get, path = "/v1/members", operation_id = "get_members", tag = "admin",
    responses((status = 200, description = "The servers", body = Members)))]
pub(crate) async fn get_members(State(app): State<App>) -> Result<Json<Members>, Refusal> {
    Ok(Json(app.apart(|app| app.catalogues.show_members()).await?))
}
