//! `/v1/sessions`

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use palpate_schemas::{
    AddReadings, AskNextTouches, Belief, BeliefQuery, CloseSession, CreateSession, ExtendSession,
    Marginals, MarginalsQuery, NextTouches, ReadingsAdded, ReadingsQuery, Session, SessionPage,
    SessionsQuery,
};
use serde::Serialize;

use crate::app::App;
use crate::etag;
use crate::extract::{JsonBody, OptionalBody, Params, ReadingsBody, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::{Conflict, Deleted, Ended};

/// List the sessions
///
/// Lists open and ended sessions, as the parameters ask, in the order of their creation.
#[utoipa::path(get, path = "/v1/sessions", operation_id = "list_sessions", tag = "sessions",
    params(SessionsQuery),
    responses((status = 200, description = "A page of sessions",
        body = SessionPage)))]
pub(crate) async fn list_sessions(
    State(app): State<App>,
    Params(query): Params<SessionsQuery>,
) -> Result<Json<SessionPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.sessions.list(query)).await?))
}

/// Create a session
///
/// A session is one object, touched in one frame by one or more robots. It keeps the catalogue
/// version that is current when it starts. 409 if the catalogue has no version yet, 429 if the
/// maximum number of sessions is open.
#[utoipa::path(post, path = "/v1/sessions", operation_id = "create_session", tag = "sessions",
    request_body = CreateSession,
    responses((status = 201, description = "The new session", body = Session), Conflict))]
pub(crate) async fn create_session(
    State(app): State<App>,
    JsonBody(request): JsonBody<CreateSession>,
) -> Result<Response, Refusal> {
    let session = app.sessions.create(&request).await?;
    Ok(super::created(format!("/v1/sessions/{}", session.id), session))
}

/// Get a session
///
/// Settings, state and number of readings of a session. `GET …/belief` has its answer.
#[utoipa::path(get, path = "/v1/sessions/{session}", operation_id = "get_session",
    tag = "sessions", params(("session" = Uuid, Path, description = "The session's id")),
    responses((status = 200, description = "The session", body = Session)))]
pub(crate) async fn get_session(
    State(app): State<App>,
    Segments(session): Segments,
) -> Result<Json<Session>, Refusal> {
    Ok(Json(app.sessions.get(&session)?))
}

/// Delete a session with its readings
///
/// Removes the session and everything that was stored of it. It cannot be undone.
#[utoipa::path(delete, path = "/v1/sessions/{session}", operation_id = "delete_session",
    tag = "sessions", params(("session" = Uuid, Path, description = "The session's id")),
    responses(Deleted))]
pub(crate) async fn delete_session(
    State(app): State<App>,
    Segments(session): Segments,
) -> Result<StatusCode, Refusal> {
    app.sessions.delete(&session).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Close a session
///
/// Stops the session from accepting readings; its belief can still be read. Optionally pass the
/// true object, even later or after the session has expired: `truth` then reports the probability
/// that the belief gave it, and the metrics count it. Closing again has no other effect. 409 if
/// another truth is already recorded.
#[utoipa::path(post, path = "/v1/sessions/{session}/close", operation_id = "close_session",
    tag = "sessions", params(("session" = Uuid, Path, description = "The session's id")),
    request_body(content = CloseSession, description = "The true object; optional"),
    responses((status = 200, description = "The closed session", body = Session), Conflict))]
pub(crate) async fn close_session(
    State(app): State<App>,
    Segments(session): Segments,
    OptionalBody(request): OptionalBody<CloseSession>,
) -> Result<Json<Session>, Refusal> {
    Ok(Json(app.sessions.close(&session, &request).await?))
}

/// Keep a session open
///
/// Keeps the session open for `seconds` without new readings. Call again to extend. Not needed to
/// add readings or to close. 410 if the session has ended.
#[utoipa::path(post, path = "/v1/sessions/{session}/lease", operation_id = "extend_session",
    tag = "sessions", request_body = ExtendSession,
    params(("session" = Uuid, Path, description = "The session's id")),
    responses((status = 200, description = "The session with its new deadline", body = Session),
        Ended))]
pub(crate) async fn extend_session(
    State(app): State<App>,
    Segments(session): Segments,
    JsonBody(asked): JsonBody<ExtendSession>,
) -> Result<Json<Session>, Refusal> {
    Ok(Json(app.sessions.extend(&session, asked).await?))
}

/// Add readings
///
/// Takes a list of 1 to 1000 readings, stores it whole or not at all, and returns the belief once
/// the readings are durable.
///
/// `robot` and `seq` together identify a reading. A repeated reading with the same content is not
/// counted again. A request made only of known readings returns the belief of the first time, even
/// after a restart or a retraction. 409 if the content differs or the session is full, 410 if it
/// has ended.
///
/// The belief does not depend on the order of arrival: readings with ids are folded in by stamp
/// (readings without a stamp first), then robot, then `seq`.
#[utoipa::path(post, path = "/v1/sessions/{session}/readings", operation_id = "add_readings",
    tag = "sessions", request_body = AddReadings,
    params(("session" = Uuid, Path, description = "The session's id"), ReadingsQuery),
    responses((status = 200, description = "The belief after the readings", body = ReadingsAdded),
        Conflict, Ended))]
pub(crate) async fn add_readings(
    State(app): State<App>,
    Segments(session): Segments,
    Params(query): Params<ReadingsQuery>,
    ReadingsBody(request): ReadingsBody<AddReadings>,
) -> Result<Json<ReadingsAdded>, Refusal> {
    let detail = query.belief.unwrap_or_default();
    Ok(Json(app.sessions.add(&session, &request, detail).await?))
}

/// Get a session's belief
///
/// Returns 304 if `If-None-Match` carries the `ETag` of the newest belief. `at` returns the belief
/// of an earlier revision, recomputed from the stored readings; it never changes and has the `ETag`
/// it had then.
#[utoipa::path(get, path = "/v1/sessions/{session}/belief", operation_id = "get_belief",
    tag = "sessions",
    params(("session" = Uuid, Path, description = "The session's id"), BeliefQuery),
    responses((status = 200, description = "The belief", body = Belief,
            headers(("etag" = String, description = "The revision")))))]
pub(crate) async fn get_belief(
    State(app): State<App>,
    Segments(session): Segments,
    Params(query): Params<BeliefQuery>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    Ok(conditional(app.sessions.belief(&session, query, &etag::known(&headers)).await?))
}

/// Get the marginals of a session's pose
///
/// For plots, with the methods `geometric…`: given that the object is the named one (default: the
/// likeliest), the probabilities of bins along x, y and the rotation in the prior's plane, or along
/// the session's axes. Returns 304 if `If-None-Match` carries the `ETag` of the newest belief. 409
/// if the session has no marginals.
#[utoipa::path(get, path = "/v1/sessions/{session}/marginals", operation_id = "get_marginals",
    tag = "sessions",
    params(("session" = Uuid, Path, description = "The session's id"), MarginalsQuery),
    responses((status = 200, description = "The marginals", body = Marginals,
            headers(("etag" = String, description = "The revision"))),
        Conflict))]
pub(crate) async fn get_marginals(
    State(app): State<App>,
    Segments(session): Segments,
    Params(query): Params<MarginalsQuery>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    Ok(conditional(app.sessions.marginals(&session, query, &etag::known(&headers)).await?))
}

/// An answer with its revision as `ETag`, or 304 if the client has it.
fn conditional<T: Serialize>((revision, answer): (u64, Option<T>)) -> Response {
    let etag = [(header::ETAG, format!("\"{revision}\""))];
    match answer {
        Some(answer) => (etag, Json(answer)).into_response(),
        None => (StatusCode::NOT_MODIFIED, etag).into_response(),
    }
}

/// Rank the next touches
///
/// With the method `surface`: ranks `candidates`, or approaches that the service generates. The
/// score is the expected information about the object's identity times the probability of contact,
/// divided by `cost` where given. Only approaches evaluated before `deadline_ms` are ranked;
/// identical questions that are evaluated completely get identical answers. Nothing is stored.
///
/// 409 with other methods, and before the first touch without a `workspace`; 410 if the session has
/// ended.
#[utoipa::path(post, path = "/v1/sessions/{session}/next-touches",
    operation_id = "ask_next_touches", tag = "sessions", request_body = AskNextTouches,
    params(("session" = Uuid, Path, description = "The session's id")),
    responses((status = 200, description = "Approaches, best first", body = NextTouches),
        Conflict, Ended))]
pub(crate) async fn ask_next_touches(
    State(app): State<App>,
    Segments(session): Segments,
    JsonBody(request): JsonBody<AskNextTouches>,
) -> Result<Json<NextTouches>, Refusal> {
    Ok(Json(app.sessions.next_touches(&session, &request).await?))
}
