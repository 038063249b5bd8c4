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

use crate::app::App;
use crate::extract::{JsonBody, OptionalBody, Params, ReadingsBody, Segment1, revision};
use crate::openapi::{Conflict, Ended};
use crate::refusal::Refusal;

/// List the sessions
#[utoipa::path(get, path = "/v1/sessions", operation_id = "list_sessions", tag = "sessions",
    params(SessionsQuery),
    responses((status = 200, description = "A page of sessions, oldest first",
        body = SessionPage)))]
pub(crate) async fn list_sessions(
    State(app): State<App>,
    Params(query): Params<SessionsQuery>,
) -> Result<Json<SessionPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.sessions().list(&query)).await?))
}

/// Begin a session
///
/// One object that rests in one frame and is touched, by one robot or several. The session
/// keeps the catalogue's version that it begins with. 409 when there is none yet, 429 when as
/// many are open as may be.
#[utoipa::path(post, path = "/v1/sessions", operation_id = "create_session", tag = "sessions",
    request_body = CreateSession,
    responses((status = 201, description = "The new session", body = Session), Conflict))]
pub(crate) async fn create_session(
    State(app): State<App>,
    JsonBody(request): JsonBody<CreateSession>,
) -> Result<Response, Refusal> {
    let session = app.sessions().create(&request).await?;
    Ok(super::created(format!("/v1/sessions/{}", session.id), session))
}

/// Get a session
#[utoipa::path(get, path = "/v1/sessions/{session}", operation_id = "get_session",
    tag = "sessions", params(("session" = String, Path, description = "The session's id")),
    responses((status = 200, description = "The session", body = Session)))]
pub(crate) async fn get_session(
    State(app): State<App>,
    Segment1(session): Segment1,
) -> Result<Json<Session>, Refusal> {
    Ok(Json(app.sessions().get(&session)?))
}

/// Delete a session with its readings
#[utoipa::path(delete, path = "/v1/sessions/{session}", operation_id = "delete_session",
    tag = "sessions", params(("session" = String, Path, description = "The session's id")),
    responses((status = 204, description = "It is gone")))]
pub(crate) async fn delete_session(
    State(app): State<App>,
    Segment1(session): Segment1,
) -> Result<StatusCode, Refusal> {
    app.sessions().delete(&session).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Close a session
///
/// It takes no more readings; its belief can still be read. Who knows what the object was may
/// say so, also later and of a session that has expired: `truth` then tells how right the belief
/// was, and the metrics count it. Closing again changes nothing else; 409 with another truth.
#[utoipa::path(post, path = "/v1/sessions/{session}/close", operation_id = "close_session",
    tag = "sessions", params(("session" = String, Path, description = "The session's id")),
    request_body(content = CloseSession, description = "What the object was; may be left out"),
    responses((status = 200, description = "The closed session", body = Session), Conflict))]
pub(crate) async fn close_session(
    State(app): State<App>,
    Segment1(session): Segment1,
    OptionalBody(request): OptionalBody<CloseSession>,
) -> Result<Json<Session>, Refusal> {
    Ok(Json(app.sessions().close(&session, &request).await?))
}

/// Keep a session open
///
/// A lease: it does not expire for so long, though nothing comes. Asking again extends it;
/// readings and closing need none. 410 when the session has ended.
#[utoipa::path(post, path = "/v1/sessions/{session}/lease", operation_id = "extend_session",
    tag = "sessions", request_body = ExtendSession,
    params(("session" = String, Path, description = "The session's id")),
    responses((status = 200, description = "The session, with its lease", body = Session),
        Ended))]
pub(crate) async fn extend_session(
    State(app): State<App>,
    Segment1(session): Segment1,
    JsonBody(asked): JsonBody<ExtendSession>,
) -> Result<Json<Session>, Refusal> {
    Ok(Json(app.sessions().extend(&session, asked).await?))
}

/// Add readings
///
/// 1 to 1000 readings in one list, also when it is only one; all are taken or none. Answered
/// when they are durable, with the belief after them. `robot` and `seq` together identify a
/// reading: sent again with the same content it is not counted twice, and when all of a request
/// are known it is answered with the belief of the first time, also after a restart and when the
/// reading was withdrawn since. 409 with other content, or when the session is full; 410 when it
/// has ended.
/// The belief is the same in whatever order readings with ids come: they are folded in the order
/// of their stamps (those without first), then robots, then `seq`.
#[utoipa::path(post, path = "/v1/sessions/{session}/readings", operation_id = "add_readings",
    tag = "sessions", request_body = AddReadings,
    params(("session" = String, Path, description = "The session's id"), ReadingsQuery),
    responses((status = 200, description = "What became of the readings", body = ReadingsAdded),
        Conflict, Ended))]
pub(crate) async fn add_readings(
    State(app): State<App>,
    Segment1(session): Segment1,
    Params(query): Params<ReadingsQuery>,
    ReadingsBody(request): ReadingsBody<AddReadings>,
) -> Result<Json<ReadingsAdded>, Refusal> {
    let detail = query.belief.unwrap_or_default();
    Ok(Json(app.sessions().add(&session, &request, detail).await?))
}

/// Get a session's belief
///
/// With `If-None-Match` and the `ETag` of a belief that is still the newest, 304. With `at`
/// the belief of an earlier revision, computed anew from the stored readings; it never changes,
/// and its `ETag` is the one that it had then.
#[utoipa::path(get, path = "/v1/sessions/{session}/belief", operation_id = "get_belief",
    tag = "sessions",
    params(("session" = String, Path, description = "The session's id"), BeliefQuery),
    responses((status = 200, description = "The belief", body = Belief,
            headers(("etag" = String, description = "The revision"))),
        (status = 304, description = "The belief is still the one of `If-None-Match`")))]
pub(crate) async fn get_belief(
    State(app): State<App>,
    Segment1(session): Segment1,
    Params(query): Params<BeliefQuery>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let known = revision(&headers, &header::IF_NONE_MATCH);
    let Some(belief) = app.sessions().belief(&session, query, known).await? else {
        return Ok(StatusCode::NOT_MODIFIED.into_response());
    };
    let etag = [(header::ETAG, format!("\"{}\"", belief.revision))];
    Ok((etag, Json(belief)).into_response())
}

/// Get how probable each coordinate of the pose is
///
/// For plotting, in sessions with the methods `geometric…`: given that the object is the one
/// named (or the likeliest), the probabilities of bins along x, y and the turn in the prior's
/// plane, or along the session's axes. With `If-None-Match` and the `ETag` of a belief that is
/// still the newest, 304. 409 when there are none.
#[utoipa::path(get, path = "/v1/sessions/{session}/marginals", operation_id = "get_marginals",
    tag = "sessions",
    params(("session" = String, Path, description = "The session's id"), MarginalsQuery),
    responses((status = 200, description = "The marginals", body = Marginals,
            headers(("etag" = String, description = "The revision"))),
        (status = 304, description = "The belief is still the one of `If-None-Match`"),
        Conflict))]
pub(crate) async fn get_marginals(
    State(app): State<App>,
    Segment1(session): Segment1,
    Params(query): Params<MarginalsQuery>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let known = revision(&headers, &header::IF_NONE_MATCH);
    let Some(marginals) = app.sessions().marginals(&session, query, known).await? else {
        return Ok(StatusCode::NOT_MODIFIED.into_response());
    };
    let etag = [(header::ETAG, format!("\"{}\"", marginals.revision))];
    Ok((etag, Json(marginals)).into_response())
}

/// Ask where to touch next
///
/// In sessions with the method `surface`: ranks the `candidates`, or approaches of the service's
/// own, by what their outcomes are expected to say about which object it is, times the
/// probability of a contact, and per `cost` when there is one. What was evaluated by
/// `deadline_ms` is ranked; equal questions that are evaluated completely get equal answers.
/// Nothing is stored. 409 with other methods, and before the first touch without a `workspace`;
/// 410 when the session has ended.
#[utoipa::path(post, path = "/v1/sessions/{session}/next-touches",
    operation_id = "ask_next_touches", tag = "sessions", request_body = AskNextTouches,
    params(("session" = String, Path, description = "The session's id")),
    responses((status = 200, description = "Approaches, best first", body = NextTouches),
        Conflict, Ended))]
pub(crate) async fn ask_next_touches(
    State(app): State<App>,
    Segment1(session): Segment1,
    JsonBody(request): JsonBody<AskNextTouches>,
) -> Result<Json<NextTouches>, Refusal> {
    Ok(Json(app.sessions().next_touches(&session, &request).await?))
}
