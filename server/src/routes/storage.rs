//! `/v1/storage`, `/v1/compactions` and `/v1/snapshots`: the stored data as a whole.

use axum::body::Body;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use palpate_schemas::{Compacted, Storage};
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;

use crate::admission::InMemory;
use crate::app::App;
use crate::cause::Cause;
use crate::client::Client;
use crate::middleware::caller::Caller;
use crate::refusal::Refusal;
use crate::routes::documented::SnapshotFile;
use crate::services::snapshots::{IN_MEMORY, take};

/// Get the stored bytes
///
/// Returns the stored bytes of each key, the quota, and the things whose removal frees most:
/// sessions, objects, sensors, catalogues, and the records that a compaction frees.
#[utoipa::path(get, path = "/v1/storage", operation_id = "get_storage", tag = "admin",
    responses((status = 200, description = "The stored bytes", body = Storage)))]
pub(crate) async fn get_storage(State(app): State<App>) -> Result<Json<Storage>, Refusal> {
    Ok(Json(app.apart(|app| app.storage.show()).await?))
}

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
    let store = app.store.clone();
    let compacting = tokio::task::spawn_blocking(move || store.compact());
    let done = compacting.await.map_err(|_| Cause::Panicked)??;
    Ok(Json(Compacted {
        before_bytes: done.before_bytes,
        after_bytes: done.after_bytes,
        live_bytes: done.live_bytes,
    }))
}

/// Take a snapshot
///
/// Streams everything stored and acknowledged so far as one consistent file; writes continue
/// meanwhile. At most four snapshots run at once. One key never holds all four (429); 503 when all
/// four are taken. A download ends when its key stops being valid. A truncated file lacks its end
/// marker, and `palpate snapshot verify` and `restore` refuse it.
#[utoipa::path(post, path = "/v1/snapshots", operation_id = "take_snapshot", tag = "admin",
    responses((status = 200, description = "The snapshot", body = SnapshotFile,
        content_type = "application/octet-stream")))]
pub(crate) async fn take_snapshot(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(client): Extension<Option<Client>>,
) -> Result<Response, Refusal> {
    let held = app.admission.snapshot(client)?;
    let chunks = take(&app.store, app.webhooks.notices(), caller.until_ended(&app)).await?;
    let content_type = [(header::CONTENT_TYPE, "application/octet-stream")];
    let chunks = ReceiverStream::new(chunks).map(move |chunk| {
        let _held_while_sent = &held;
        chunk
    });
    let body = Body::from_stream(chunks);
    Ok((content_type, Extension(InMemory(IN_MEMORY)), body).into_response())
}
