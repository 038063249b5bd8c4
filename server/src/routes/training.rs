//! `/v1/catalogues`

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use palpate_schemas::{
    AppearanceReport, Catalogue, CataloguePage, CatalogueVersion, CatalogueVersionPage,
    CurrentVersion, Job, LabelledQuery, ObjectMap, PageQuery, Problem, RecalibrateCatalogue,
    SetCurrent, ShadowVersion, StartTraining, TrainingReport,
};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments, if_match};
use crate::refusal::Refusal;
use crate::routes::documented::{Conflict, Deleted};
use crate::services::catalogues::CatalogueError;
use crate::wire;

/// List the catalogues
///
/// Pages of catalogues in the order of their names, each with its current version.
#[utoipa::path(get, path = "/v1/catalogues", operation_id = "list_catalogues", tag = "training",
    params(LabelledQuery),
    responses((status = 200, description = "A page of catalogues, oldest first",
        body = CataloguePage)))]
pub(crate) async fn list_catalogues(
    State(app): State<App>,
    Params(query): Params<LabelledQuery>,
) -> Result<Json<CataloguePage>, Refusal> {
    Ok(Json(app.apart(move |app| app.catalogues.list(query)).await?))
}

/// Get a catalogue
///
/// Returns the current version and the history of switches.
#[utoipa::path(get, path = "/v1/catalogues/{name}", operation_id = "get_catalogue",
    tag = "training", params(("name" = String, Path, description = "The catalogue's name")),
    responses((status = 200, description = "The catalogue", body = Catalogue)))]
pub(crate) async fn get_catalogue(
    State(app): State<App>,
    Segments(name): Segments,
) -> Result<Json<Catalogue>, Refusal> {
    Ok(Json(wire::training::catalogue(&app.catalogues.find(&name)?)))
}

/// Train a new version
///
/// Returns a job at once; jobs run one at a time. Creates the catalogue if it does not exist.
/// Running sessions keep their version.
#[utoipa::path(post, path = "/v1/catalogues/{name}/trainings", operation_id = "start_training",
    tag = "training", request_body = StartTraining,
    params(("name" = String, Path, description = "The catalogue's name, such as `default`")),
    responses((status = 202, description = "The job that trains it", body = Job)))]
pub(crate) async fn start_training(
    State(app): State<App>,
    Segments(name): Segments,
    JsonBody(request): JsonBody<StartTraining>,
) -> Result<Response, Refusal> {
    Ok(accepted(app.jobs.start(&name, &request).await?))
}

/// Recalibrate a version
///
/// Fits "none of these", the width of the sensor and the stop rule to ended sessions whose true
/// object is known. Returns a job at once. Its version has every part of the one before, and another
/// calibration; `recalibration` in its report compares both on sessions that the calibration does
/// not know. It becomes current if it is better. Running sessions keep their version. To undo
/// it, make the version before current again. 409 if too few sessions tell what they touched.
#[utoipa::path(post, path = "/v1/catalogues/{name}/calibrations",
    operation_id = "recalibrate_catalogue", tag = "training", request_body = RecalibrateCatalogue,
    params(("name" = String, Path, description = "The catalogue's name, such as `default`")),
    responses((status = 202, description = "The job that recalibrates it", body = Job), Conflict))]
pub(crate) async fn recalibrate_catalogue(
    State(app): State<App>,
    Segments(name): Segments,
    JsonBody(request): JsonBody<RecalibrateCatalogue>,
) -> Result<Response, Refusal> {
    Ok(accepted(app.jobs.start_recalibration(&name, request).await?))
}

/// Compare a version with the current one
///
/// Replays ended sessions by the version and by another one, the current one by default, before it
/// becomes current: what each would have answered, after how many touches, in which time, and which
/// sessions would have ended otherwise. Returns a job at once; its `shadow_report` is the result.
/// Nothing else changes.
#[utoipa::path(post, path = "/v1/catalogues/{name}/versions/{version}/shadow",
    operation_id = "shadow_version", tag = "training", request_body = ShadowVersion,
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version to try")),
    responses((status = 202, description = "The job that compares them", body = Job), Conflict))]
pub(crate) async fn shadow_version(
    State(app): State<App>,
    Segments((name, version)): Segments<(String, String)>,
    JsonBody(request): JsonBody<ShadowVersion>,
) -> Result<Response, Refusal> {
    Ok(accepted(app.jobs.start_shadow(&name, &version, request).await?))
}

/// The answer to a request that began a job.
fn accepted(job: Job) -> Response {
    let location = [(header::LOCATION, format!("/v1/jobs/{}", job.id))];
    (StatusCode::ACCEPTED, location, Json(job)).into_response()
}

/// Delete a catalogue
///
/// Also deletes all its versions. 409 while a stored session uses one of them or an unfinished job
/// trains the catalogue.
#[utoipa::path(delete, path = "/v1/catalogues/{name}", operation_id = "delete_catalogue",
    tag = "training", params(("name" = String, Path, description = "The catalogue's name")),
    responses(Deleted, Conflict))]
pub(crate) async fn delete_catalogue(
    State(app): State<App>,
    Segments(name): Segments,
) -> Result<StatusCode, Refusal> {
    app.catalogues.remove(&name).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// List a catalogue's versions
///
/// Pages of versions, the oldest first. A version never changes.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions", operation_id = "list_versions",
    tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"), PageQuery),
    responses((status = 200, description = "A page of versions, oldest first",
        body = CatalogueVersionPage)))]
pub(crate) async fn list_versions(
    State(app): State<App>,
    Segments(name): Segments,
    Params(query): Params<PageQuery>,
) -> Result<Json<CatalogueVersionPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.catalogues.versions(&name, &query)).await?))
}

/// Get a version
///
/// What a version was trained from and what it can do; its report has the figures.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}",
    operation_id = "get_version", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number")),
    responses((status = 200, description = "The version", body = CatalogueVersion)))]
pub(crate) async fn get_version(
    State(app): State<App>,
    Segments((name, version)): Segments<(String, String)>,
) -> Result<Json<CatalogueVersion>, Refusal> {
    Ok(Json(app.apart(move |app| app.catalogues.version(&name, &version)).await?))
}

/// Delete a version
///
/// Deletes the parts of its model that no other version shares. The number is not reused. 409 while
/// the version is current, a stored session uses it, or an unfinished job extends or
/// recalibrates it.
#[utoipa::path(delete, path = "/v1/catalogues/{name}/versions/{version}",
    operation_id = "delete_version", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number")),
    responses(Deleted, Conflict))]
pub(crate) async fn delete_version(
    State(app): State<App>,
    Segments((name, version)): Segments<(String, String)>,
) -> Result<StatusCode, Refusal> {
    app.catalogues.remove_version(&name, &version).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Get a version's training report
///
/// Returns its objects, patches, memory, training time and seed.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}/report",
    operation_id = "get_report", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number")),
    responses((status = 200, description = "The report", body = TrainingReport)))]
pub(crate) async fn get_report(
    State(app): State<App>,
    Segments((name, version)): Segments<(String, String)>,
) -> Result<Json<TrainingReport>, Refusal> {
    let found = app.apart(move |app| app.catalogues.version(&name, &version)).await?;
    Ok(Json(found.report))
}

/// Get a version's appearance report
///
/// Returns the confusion matrix of the held-back readings, the pairwise similarity, and the object
/// pairs that touch barely separates. The report never changes. 409 if the version was trained
/// without appearance.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}/report/appearance",
    operation_id = "get_appearance_report", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number")),
    responses((status = 200, description = "The report", body = AppearanceReport), Conflict))]
pub(crate) async fn get_appearance_report(
    State(app): State<App>,
    Segments((name, version)): Segments<(String, String)>,
) -> Result<Json<AppearanceReport>, Refusal> {
    Ok(Json(app.catalogues.appearance_report(&name, &version).await?))
}

/// Get the trained map of an object
///
/// Returns the object's surface, patch by patch, in the object frame. The map never changes.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}/objects/{object}/map",
    operation_id = "get_object_map", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("object" = String, Path, description = "The object's id, or its name when trained"),
        PageQuery),
    responses((status = 200, description = "The map with a page of its patches",
        body = ObjectMap), Conflict))]
pub(crate) async fn get_object_map(
    State(app): State<App>,
    Segments((name, version, object)): Segments<(String, String, String)>,
    Params(query): Params<PageQuery>,
) -> Result<Json<ObjectMap>, Refusal> {
    Ok(Json(app.catalogues.object_map(&name, &version, &object, &query).await?))
}

/// Get the current version
///
/// New sessions use this version. Pass its `ETag` as `If-Match` to switch. 409 if no version is
/// current.
#[utoipa::path(get, path = "/v1/catalogues/{name}/current", operation_id = "get_current",
    tag = "training", params(("name" = String, Path, description = "The catalogue's name")),
    responses((status = 200, description = "The current version", body = CurrentVersion,
        headers(("etag" = String, description = "The revision"))), Conflict))]
pub(crate) async fn get_current(
    State(app): State<App>,
    Segments(name): Segments,
) -> Result<Response, Refusal> {
    current(wire::training::catalogue(&app.catalogues.find(&name)?))
}

/// Set the current version
///
/// Switches new sessions to any version of the catalogue, including an older one. `If-Match`
/// carries the `ETag` of the current version, so that of two concurrent switches only one succeeds.
#[utoipa::path(put, path = "/v1/catalogues/{name}/current", operation_id = "set_current",
    tag = "training", request_body = SetCurrent,
    params(("name" = String, Path, description = "The catalogue's name"),
        ("if-match" = String, Header, description = "The `ETag` of the current version")),
    responses((status = 200, description = "The current version", body = CurrentVersion,
            headers(("etag" = String, description = "The new revision"))),
        (status = 412, description = "The current version has changed meanwhile", body = Problem,
            content_type = "application/problem+json"),
        (status = 428, description = "`If-Match` is missing", body = Problem,
            content_type = "application/problem+json")))]
pub(crate) async fn set_current(
    State(app): State<App>,
    Segments(name): Segments,
    headers: HeaderMap,
    JsonBody(request): JsonBody<SetCurrent>,
) -> Result<Response, Refusal> {
    let revision = if_match(&headers, app.catalogues.find(&name)?.revision)?;
    let catalogue = app.catalogues.switch(&name, request.version, revision).await?;
    current(wire::training::catalogue(&catalogue))
}

fn current(catalogue: Catalogue) -> Result<Response, Refusal> {
    let Some(current) = catalogue.current else {
        return Err(CatalogueError::Untrained { catalogue: catalogue.name }.into());
    };
    let etag = [(header::ETAG, format!("\"{}\"", current.revision))];
    Ok((etag, Json(current)).into_response())
}
