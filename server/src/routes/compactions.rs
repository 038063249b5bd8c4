//! `/v1/compactions`

use axum::Json;
use axum::extract::State;
use palpate_schemas::Compacted;

use crate::app::App;
use crate::cause::Cause;
use crate::refusal::Refusal;

/// Compact the stored data
///
/// Frees the disk space held by removed and replaced records. Other requests are served meanwhile,
/// and the answer comes when compaction is done. The server also compacts by itself when the stored
/// bytes exceed 1.5 times the live bytes by `--store-slack-mb`.
///
/// 503 if the compacted copy would not fit on the disk. A 503 because of a timeout does not stop
/// the compaction.
#[utoipa::path(post, path = "/v1/compactions", operation_id = "compact", tag = "admin",
    responses((status = 200, description = "Sizes before and after", body = Compacted)))]
pub(crate) async fn compact(State(app): State<App>) -> Result<Json<Compacted>, Refusal> {
    let store = app.store().clone();
    let compacting = tokio::task::spawn_blocking(move || store.compact());
    let done = compacting.await.map_err(|_| Cause::Panicked)??;
    Ok(Json(Compacted {
        before_bytes: done.before_bytes,
        after_bytes: done.after_bytes,
        live_bytes: done.live_bytes,
    }))
}
