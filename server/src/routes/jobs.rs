//! `/v1/jobs`

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use palpate_schemas::{Job, JobPage, PageQuery};

use crate::app::App;
use crate::extract::{Params, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::{Conflict, Deleted};

/// List the jobs
///
/// Pages of jobs, the oldest first: trainings, calibrations, comparisons and merges.
#[utoipa::path(get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs",
    params(PageQuery),
    responses((status = 200, description = "A page of jobs, oldest first", body = JobPage)))]
pub(crate) async fn list_jobs(
    State(app): State<App>,
    Params(query): Params<PageQuery>,
) -> Result<Json<JobPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.jobs.list(&query)).await?))
}

/// Get a job
///
/// State, stage and progress of a job; of an ended one, its result or its error.
#[utoipa::path(get, path = "/v1/jobs/{job}", operation_id = "get_job", tag = "jobs",
    params(("job" = Uuid, Path, description = "The job's id")),
    responses((status = 200, description = "The job", body = Job)))]
pub(crate) async fn get_job(
    State(app): State<App>,
    Segments(job): Segments,
) -> Result<Json<Job>, Refusal> {
    Ok(Json(app.jobs.get(&job)?))
}

/// Delete a job
///
/// Deletes the record of an ended job. The version it created stays. 409 while the job is queued
/// or running.
#[utoipa::path(delete, path = "/v1/jobs/{job}", operation_id = "delete_job", tag = "jobs",
    params(("job" = Uuid, Path, description = "The job's id")),
    responses(Deleted, Conflict))]
pub(crate) async fn delete_job(
    State(app): State<App>,
    Segments(job): Segments,
) -> Result<StatusCode, Refusal> {
    app.jobs.delete(&job).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Cancel a job
///
/// A queued job never starts; a running job stops at its next step, within seconds. 409 if the job
/// has already finished.
#[utoipa::path(post, path = "/v1/jobs/{job}/cancel", operation_id = "cancel_job", tag = "jobs",
    params(("job" = Uuid, Path, description = "The job's id")),
    responses((status = 200, description = "The job", body = Job), Conflict))]
pub(crate) async fn cancel_job(
    State(app): State<App>,
    Segments(job): Segments,
) -> Result<Json<Job>, Refusal> {
    Ok(Json(app.jobs.cancel(&job).await?))
}
