//! `/v1/snapshots`

use axum::Extension;
use axum::body::Body;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;

use crate::admission::InMemory;
use crate::app::App;
use crate::client::Client;
use crate::guard::Caller;
use crate::openapi::SnapshotFile;
use crate::refusal::Refusal;
use crate::snapshots::{IN_MEMORY, take};

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
    let held = app.admission().snapshot(client)?;
    let chunks = take(app.store(), caller.until_ended(&app)).await?;
    let content_type = [(header::CONTENT_TYPE, "application/octet-stream")];
    let chunks = ReceiverStream::new(chunks).map(move |chunk| {
        let _held_while_sent = &held;
        chunk
    });
    let body = Body::from_stream(chunks);
    Ok((content_type, Extension(InMemory(IN_MEMORY)), body).into_response())
}
