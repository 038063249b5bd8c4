//! Incoming bodies: counted as they arrive, complete before the request is handled.

use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::Request;
use axum::http::header;
use futures::StreamExt;

use crate::admission::Room;
use crate::app::App;
use crate::client::Client;
use crate::refusal::{Refusal, RequestError, SMALLER_MESH};

/// Multiple of its limit up to which a too long body is read and discarded, so that the
/// robot, still sending, gets to read the answer.
const DRAIN_FACTOR: usize = 4;

/// Time limits of a body.
#[derive(Clone, Copy)]
struct Time {
    /// For the whole body.
    whole: Duration,
    /// Between two pieces.
    pause: Duration,
}

/// The request with its complete body. The memory reserved for it is an extension of it, too.
pub(super) async fn receive(
    app: &App,
    request: Request,
    client: Option<Client>,
) -> Result<(Request, Room), Refusal> {
    let room = Room::new(&app.admission.bodies, client)?;
    let config = &app.config;
    let is_json = content_type_is_structured(&request);
    let max = if is_json { config.json_bytes_max } else { config.mesh_bytes_max };
    let advice = if is_json { "" } else { SMALLER_MESH };
    let time = Time { whole: config.body_timeout, pause: config.patience.body };
    let (mut parts, body) = request.into_parts();
    let reading = read(body, max, &room, time.pause);
    let within = time.whole;
    let bytes = tokio::time::timeout(within, reading).await;
    let bytes = bytes.map_err(|_| RequestError::BodyTooSlow { within })??;
    parts.extensions.insert(room.clone());
    let bytes = bytes.ok_or(RequestError::BodyTooLarge { max, advice })?;
    Ok((Request::from_parts(parts, Body::from(bytes)), room))
}

/// Whether a body is JSON or MessagePack, which have their own limit.
fn content_type_is_structured(request: &Request) -> bool {
    let value = request.headers().get(header::CONTENT_TYPE);
    let value = value.and_then(|value| value.to_str().ok()).unwrap_or_default();
    value.contains("json") || value.contains("msgpack")
}

/// The body, or nothing if it is longer than `max`.
async fn read(
    body: Body,
    max: usize,
    room: &Room,
    pause: Duration,
) -> Result<Option<Bytes>, Refusal> {
    let mut stream = body.into_data_stream();
    let mut bytes = Vec::new();
    let mut length = 0usize;
    loop {
        let next = tokio::time::timeout(pause, stream.next()).await;
        let Some(chunk) = next.map_err(|_| RequestError::BodyTooSlow { within: pause })? else {
            break;
        };
        let chunk =
            chunk.map_err(|error| RequestError::Unreadable { reason: error.to_string() })?;
        length += chunk.len();
        if length <= max {
            room.grow_to(length)?;
            bytes.extend_from_slice(&chunk);
        } else if length > DRAIN_FACTOR.saturating_mul(max) {
            break;
        }
    }
    Ok((length <= max).then(|| bytes.into()))
}
