//! `/v1/sessions/{session}/readings/…`, `…/replay` and `…/explain`

use axum::Json;
use axum::extract::State;
use palpate_schemas::{
    ExplainQuery, Explanation, PageQuery, ReadingRetracted, ReadingsQuery, Replay, ReplayQuery,
    SessionReadingPage,
};

use crate::app::App;
use crate::extract::{Params, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::{Conflict, Ended};

/// List a session's readings
///
/// Lists readings in the order of arrival, with the `number` by which each can be retracted.
#[utoipa::path(get, path = "/v1/sessions/{session}/readings",
    operation_id = "list_session_readings", tag = "sessions",
    params(("session" = Uuid, Path, description = "The session's id"), PageQuery),
    responses((status = 200, description = "A page of readings", body = SessionReadingPage)))]
pub(crate) async fn list_session_readings(
    State(app): State<App>,
    Segments(session): Segments,
    Params(query): Params<PageQuery>,
) -> Result<Json<SessionReadingPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.sessions.readings(&session, &query)).await?))
}

/// Retract a reading
///
/// Keeps the reading in the list but removes it from the belief, as if it had never arrived,
/// including any motion it announced. Sending the reading again does not restore it. Retracting it
/// again changes nothing and returns the first answer. 410 if the session has ended.
#[utoipa::path(delete, path = "/v1/sessions/{session}/readings/{number}",
    operation_id = "retract_reading", tag = "sessions",
    params(("session" = Uuid, Path, description = "The session's id"),
        ("number" = u32, Path, description = "The reading's number within the session"),
        ReadingsQuery),
    responses((status = 200, description = "The result of the retraction",
        body = ReadingRetracted), Conflict, Ended))]
pub(crate) async fn retract_reading(
    State(app): State<App>,
    Segments((session, number)): Segments<(String, String)>,
    Params(query): Params<ReadingsQuery>,
) -> Result<Json<ReadingRetracted>, Refusal> {
    let detail = query.belief.unwrap_or_default();
    Ok(Json(app.sessions.retract(&session, &number, detail).await?))
}

/// Retract a reading by robot and `seq`
///
/// Does the same as retracting by the number within the session.
#[utoipa::path(delete, path = "/v1/sessions/{session}/readings/{robot}/{seq}",
    operation_id = "retract_robot_reading", tag = "sessions",
    params(("session" = Uuid, Path, description = "The session's id"),
        ("robot" = String, Path, description = "The robot that took it"),
        ("seq" = u64, Path, description = "The reading's `seq`"),
        ReadingsQuery),
    responses((status = 200, description = "The result of the retraction",
        body = ReadingRetracted), Conflict, Ended))]
pub(crate) async fn retract_robot_reading(
    State(app): State<App>,
    Segments((session, robot, seq)): Segments<(String, String, String)>,
    Params(query): Params<ReadingsQuery>,
) -> Result<Json<ReadingRetracted>, Refusal> {
    let detail = query.belief.unwrap_or_default();
    Ok(Json(app.sessions.retract_of_robot(&session, &robot, &seq, detail).await?))
}

/// Replay a session
///
/// Returns what each revision added and the answer it led to, and the full belief after the last
/// of them. A late reading is folded in at its place from the revision that brought it. If
/// `next_after` is not null, call again with it to get the remaining steps.
#[utoipa::path(get, path = "/v1/sessions/{session}/replay", operation_id = "replay_session",
    tag = "sessions",
    params(("session" = Uuid, Path, description = "The session's id"), ReplayQuery),
    responses((status = 200, description = "The steps and the belief", body = Replay)))]
pub(crate) async fn replay_session(
    State(app): State<App>,
    Segments(session): Segments,
    Params(query): Params<ReplayQuery>,
) -> Result<Json<Replay>, Refusal> {
    Ok(Json(app.sessions.replay(&session, query).await?))
}

/// Explain a session's belief
///
/// Compares the belief with what it would be without each reading. For each reading it returns the
/// contribution in bits and whether the reading disagrees with the rest.
///
/// With `surface`, a reading disagrees if the other readings make it at least 256 times less likely
/// than a touch at a random place. With the other methods, it disagrees if removing it raises the
/// odds of the others' answer at least 16-fold. 409 if the belief rests on more than 200 readings.
#[utoipa::path(get, path = "/v1/sessions/{session}/explain", operation_id = "explain_session",
    tag = "sessions",
    params(("session" = Uuid, Path, description = "The session's id"), ExplainQuery),
    responses((status = 200, description = "The contribution of each reading", body = Explanation),
        Conflict))]
pub(crate) async fn explain_session(
    State(app): State<App>,
    Segments(session): Segments,
    Params(query): Params<ExplainQuery>,
) -> Result<Json<Explanation>, Refusal> {
    Ok(Json(app.sessions.explain(&session, query).await?))
}
