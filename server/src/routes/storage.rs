//! `/v1/storage`

use axum::Json;
use axum::extract::State;
use palpate_schemas::Storage;

use crate::app::App;
use crate::refusal::Refusal;

/// Show what is stored, and who wrote it
///
/// Bytes that each key holds, the quota, and the things whose removal frees most: sessions,
/// objects, sensors, catalogues, and what a compaction gives back.
#[utoipa::path(get, path = "/v1/storage", operation_id = "get_storage", tag = "admin",
    responses((status = 200, description = "What takes the room", body = Storage)))]
pub(crate) async fn get_storage(State(app): State<App>) -> Result<Json<Storage>, Refusal> {
    Ok(Json(app.apart(|app| app.storage().show()).await?))
}
