//! `/v1/sessions/{session}/readings/…`, `…/replay` and `…/explain`

use axum::Json;
use axum::extract::State;
use palpate_schemas::{
    ExplainQuery, Explanation, PageQuery, ReadingRetracted, ReadingsQuery, Replay, ReplayQuery,
    SessionReadingPage,
};

use crate::app::App;
use crate::extract::{Params, Segment1, Segment2, Segment3};
use crate::openapi::{Conflict, Ended};
use crate::refusal::Refusal;

/// List a session's readings
///
/// In the order in which they came, with the numbers by which they can be withdrawn.
#[utoipa::path(get, path = "/v1/sessions/{session}/readings",
    operation_id = "list_session_readings", tag = "sessions",
    params(("session" = String, Path, description = "The session's id"), PageQuery),
    responses((status = 200, description = "A page of readings", body = SessionReadingPage)))]
pub(crate) async fn list_session_readings(
    State(app): State<App>,
    Segment1(session): Segment1,
    Params(query): Params<PageQuery>,
) -> Result<Json<SessionReadingPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.sessions().readings(&session, &query)).await?))
}

/// Withdraw a reading
///
/// It stays listed and counts no more: the belief is as if it had never come, what it said of
/// motions included. Sent again it stays withdrawn. Withdrawing it again changes nothing and
/// answers as the first time. 410 when the session has ended.
#[utoipa::path(delete, path = "/v1/sessions/{session}/readings/{number}",
    operation_id = "retract_reading", tag = "sessions",
    params(("session" = String, Path, description = "The session's id"),
        ("number" = String, Path, description = "The reading's number within the session"),
        ReadingsQuery),
    responses((status = 200, description = "What became of the reading",
        body = ReadingRetracted), Conflict, Ended))]
pub(crate) async fn retract_reading(
    State(app): State<App>,
    Segment2(session, number): Segment2,
    Params(query): Params<ReadingsQuery>,
) -> Result<Json<ReadingRetracted>, Refusal> {
    let detail = query.belief.unwrap_or_default();
    Ok(Json(app.sessions().retract(&session, &number, detail).await?))
}

/// Withdraw a reading by its robot's number
///
/// As by its number within the session.
#[utoipa::path(delete, path = "/v1/sessions/{session}/readings/{robot}/{seq}",
    operation_id = "retract_robot_reading", tag = "sessions",
    params(("session" = String, Path, description = "The session's id"),
        ("robot" = String, Path, description = "The robot that took it"),
        ("seq" = String, Path, description = "The robot's number of it"),
        ReadingsQuery),
    responses((status = 200, description = "What became of the reading",
        body = ReadingRetracted), Conflict, Ended))]
pub(crate) async fn retract_robot_reading(
    State(app): State<App>,
    Segment3(session, robot, seq): Segment3,
    Params(query): Params<ReadingsQuery>,
) -> Result<Json<ReadingRetracted>, Refusal> {
    let detail = query.belief.unwrap_or_default();
    Ok(Json(app.sessions().retract_of_robot(&session, &robot, &seq, detail).await?))
}

/// Replay a session
///
/// What came with each revision and what was believed then, and the belief of revision `upto`
/// in full. Late readings are folded where they belong from the revision on that brought them.
/// When `next_after` is not null, ask again with it for the steps that are missing.
#[utoipa::path(get, path = "/v1/sessions/{session}/replay", operation_id = "replay_session",
    tag = "sessions",
    params(("session" = String, Path, description = "The session's id"), ReplayQuery),
    responses((status = 200, description = "The steps and the belief", body = Replay)))]
pub(crate) async fn replay_session(
    State(app): State<App>,
    Segment1(session): Segment1,
    Params(query): Params<ReplayQuery>,
) -> Result<Json<Replay>, Refusal> {
    Ok(Json(app.sessions().replay(&session, query).await?))
}

/// Explain a session's belief
///
/// Compares the belief with what it would be without each of its readings: what each contributes
/// in bits, and which disagree with the rest. With `surface` a reading disagrees when the others
/// expect it, on the object where they have it, 256 times less than a touch anywhere or worse;
/// with the other methods when the odds of what all others say are at least 16 times as large
/// without it. 409 when the belief rests on more than 200 readings.
#[utoipa::path(get, path = "/v1/sessions/{session}/explain", operation_id = "explain_session",
    tag = "sessions",
    params(("session" = String, Path, description = "The session's id"), ExplainQuery),
    responses((status = 200, description = "What each reading contributed", body = Explanation),
        Conflict))]
pub(crate) async fn explain_session(
    State(app): State<App>,
    Segment1(session): Segment1,
    Params(query): Params<ExplainQuery>,
) -> Result<Json<Explanation>, Refusal> {
    Ok(Json(app.sessions().explain(&session, query).await?))
}
