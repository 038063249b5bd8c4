//! `/v1/storage`

use axum::Json;
use axum::extract::State;
use palpate_schemas::Storage;

use crate::app::App;
use crate::refusal::Refusal;

/// Get the stored bytes
///
/// Returns the stored bytes of each key, the quota, and the things whose removal frees most:
/// sessions, objects, sensors, catalogues, and the records that a compaction frees.
#[utoipa::path(get, path = "/v1/storage", operation_id = "get_storage", tag = "admin",
    responses((status = 200, description = "The stored bytes", body = Storage)))]
pub(crate) async fn get_storage(State(app): State<App>) -> Result<Json<Storage>, Refusal> {
    Ok(Json(app.apart(|app| app.storage().show()).await?))
}
