//! Server-sent event streams: the current state first, then every change.
//!
//! Every event carries the whole state, so a missed event does no harm. A stream ends when nothing
//! more can happen, when the key that opened it stops being valid, and when the server shuts down.

use std::convert::Infallible;
use std::time::Duration;

use axum::extract::{Extension, State};
use axum::http::HeaderMap;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures::stream::{self, BoxStream, StreamExt, select_all};
use palpate_schemas::{EventsQuery, Job, SessionEvent};
use tokio::sync::broadcast::Receiver;
use tokio_stream::wrappers::{BroadcastStream, WatchStream};

use crate::app::App;
use crate::budget::Holding;
use crate::client::Client;
use crate::extract::{Params, Segments};
use crate::middleware::caller::Caller;
use crate::refusal::Refusal;
use crate::services::sessions::is_last;
use crate::wire::session::session_ids;

/// Interval of the comments that keep proxies from closing a quiet stream.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// Follow a job
///
/// Streams server-sent events named `job`, each with the whole job as data. The stream ends when
/// the job finishes.
#[utoipa::path(get, path = "/v1/jobs/{job}/events", operation_id = "job_events", tag = "jobs",
    params(("job" = Uuid, Path, description = "The job's id")),
    responses((status = 200, description = "Server-sent events", body = String,
        content_type = "text/event-stream")))]
pub(crate) async fn job_events(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(client): Extension<Option<Client>>,
    Segments(job): Segments,
) -> Result<Response, Refusal> {
    let place = app.admission.stream(client, 1)?;
    let jobs = WatchStream::new(app.jobs.follow(&job)?);
    let events = until(jobs.boxed(), |job: &Job| job.state.is_final());
    let events = events.map(|job| Event::default().event("job").json_data(&job));
    Ok(sse(&app, caller, place, events.filter_map(async |event| event.ok()).boxed()))
}

/// Follow a session
///
/// Streams server-sent events named `belief`, `closed` and `deleted`, each with a `SessionEvent` as
/// data. The first event is the current belief, unless `Last-Event-ID` names its revision. If the
/// session has ended, `closed` follows and the stream ends.
#[utoipa::path(get, path = "/v1/sessions/{session}/events", operation_id = "session_events",
    tag = "sessions", params(("session" = Uuid, Path, description = "The session's id")),
    responses((status = 200, description = "Server-sent events", body = String,
        content_type = "text/event-stream")))]
pub(crate) async fn session_events(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(client): Extension<Option<Client>>,
    Segments(session): Segments,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let known = headers.get("last-event-id").and_then(|id| id.to_str().ok()?.trim().parse().ok());
    let id = app.sessions.parse(&session)?;
    let place = app.admission.stream(client, 1)?;
    let (now, events) = app.sessions.follow(id, known).await?;
    let events = session_stream(now, events);
    Ok(sse(&app, caller, place, events.filter_map(async |event| session_event(&event)).boxed()))
}

/// Follow several sessions
///
/// Streams the events of up to 100 sessions as one stream, which ends with the last of them. It
/// counts as one stream for each session.
#[utoipa::path(get, path = "/v1/events", operation_id = "events", tag = "sessions",
    params(EventsQuery),
    responses((status = 200, description = "Server-sent events", body = String,
        content_type = "text/event-stream")))]
pub(crate) async fn events(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Extension(client): Extension<Option<Client>>,
    Params(query): Params<EventsQuery>,
) -> Result<Response, Refusal> {
    let ids = session_ids(&query)?;
    let place = app.admission.stream(client, ids.len())?;
    let mut all = Vec::new();
    for id in ids {
        let (now, events) = app.sessions.follow(id, None).await?;
        all.push(session_stream(now, events));
    }
    let events = select_all(all).filter_map(async |event| session_event(&event)).boxed();
    Ok(sse(&app, caller, place, events))
}

/// The current state, then every change, up to the session's end. A subscriber that lags misses
/// events that newer ones replace.
fn session_stream(
    now: Vec<SessionEvent>,
    events: Receiver<SessionEvent>,
) -> BoxStream<'static, SessionEvent> {
    let events = BroadcastStream::new(events).filter_map(async |event| event.ok());
    until(stream::iter(now).chain(events).boxed(), is_last)
}

fn session_event(event: &SessionEvent) -> Option<Event> {
    let named = match event {
        SessionEvent::Belief { belief } => {
            Event::default().event("belief").id(belief.revision.to_string())
        }
        SessionEvent::Closed { .. } => Event::default().event("closed"),
        SessionEvent::Deleted { .. } => Event::default().event("deleted"),
    };
    named.json_data(event).ok()
}

/// The stream up to and including the first item that `is_last` accepts.
fn until<T: Send + 'static>(
    items: BoxStream<'static, T>,
    is_last: impl Fn(&T) -> bool + Send + 'static,
) -> BoxStream<'static, T> {
    let rest = stream::unfold(Some((items, is_last)), async |state| {
        let (mut items, is_last) = state?;
        let item = items.next().await?;
        let rest = if is_last(&item) { None } else { Some((items, is_last)) };
        Some((item, rest))
    });
    rest.boxed()
}

/// The response that carries a stream. It holds its place among streams while it is open.
fn sse(app: &App, caller: Caller, place: Holding, events: BoxStream<'static, Event>) -> Response {
    let ended = caller.until_ended(app);
    let events = events.take_until(Box::pin(ended)).map(move |event| {
        let _held_while_open = &place;
        Ok::<Event, Infallible>(event)
    });
    Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)).into_response()
}
