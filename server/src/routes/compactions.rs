//! `/v1/compactions`

use axum::Json;
use axum::extract::State;
use palpate_schemas::Compacted;

use crate::app::App;
use crate::refusal::Refusal;

/// Compact the stored data
///
/// Gives the room back that removed and replaced records still take on the disk, while requests
/// go on, and answers when it is done. It happens by itself too, when the stored bytes exceed
/// 1.5 times the live bytes by `--store-slack-mb`. 503 when its copy would not fit on the disk.
/// An answer of 503 because of time does not end a compaction.
#[utoipa::path(post, path = "/v1/compactions", operation_id = "compact", tag = "admin",
    responses((status = 200, description = "It is done", body = Compacted)))]
pub(crate) async fn compact(State(app): State<App>) -> Result<Json<Compacted>, Refusal> {
    let store = app.store().clone();
    let compacting = tokio::task::spawn_blocking(move || store.compact());
    let done = compacting.await.map_err(|_| Refusal::Panicked)??;
    Ok(Json(Compacted {
        before_bytes: done.before_bytes,
        after_bytes: done.after_bytes,
        live_bytes: done.live_bytes,
    }))
}
