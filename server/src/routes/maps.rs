//! `/v1/catalogues/{name}/versions/{version}/objects/{object}/occupancy` and merges of maps.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use palpate_schemas::{CatalogueVersion, MergeMaps, OccupancyMap, PlyQuery, SliceQuery};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segment1, Segment3};
use crate::routes::documented::{Conflict, MapFile};
use crate::refusal::Refusal;

/// What never changes may be kept for a year.
const IMMUTABLE: &str = "private, max-age=31536000, immutable";

/// Get an object's map of contact
///
/// Which cells around the object generate contact, as learnt with `geometry`; in the object
/// frame. With `slice` the log-odds of that layer of cells. It never changes. 409 when the
/// version was trained without geometry.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}/objects/{object}/occupancy",
    operation_id = "get_occupancy", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("object" = String, Path, description = "The object's id, or its name when trained"),
        SliceQuery),
    responses((status = 200, description = "The map", body = OccupancyMap,
            headers(("etag" = String, description = "The version's tag"))),
        (status = 304, description = "It is the one of `If-None-Match`"), Conflict))]
pub(crate) async fn get_occupancy(
    State(app): State<App>,
    Segment3(name, version, object): Segment3,
    Params(query): Params<SliceQuery>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let mapped = app.catalogues().mapped(&name, &version, &object).await?;
    let map = mapped.occupancy(query.slice)?;
    Ok(immutable(&headers, &mapped.tag(), Json(map)))
}

/// Get an object's map of contact as an image
///
/// A heat map of one layer of cells, one or more pixels a cell, y up; the layer in the middle
/// when `slice` names none.
#[utoipa::path(get,
    path = "/v1/catalogues/{name}/versions/{version}/objects/{object}/occupancy.png",
    operation_id = "get_occupancy_png", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("object" = String, Path, description = "The object's id, or its name when trained"),
        SliceQuery),
    responses((status = 200, description = "The image", body = MapFile, content_type = "image/png",
            headers(("etag" = String, description = "The version's tag"))),
        (status = 304, description = "It is the one of `If-None-Match`"), Conflict))]
pub(crate) async fn get_occupancy_png(
    State(app): State<App>,
    Segment3(name, version, object): Segment3,
    Params(query): Params<SliceQuery>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let mapped = app.catalogues().mapped(&name, &version, &object).await?;
    let tag = mapped.tag();
    let png = mapped.png(app.pool(), query.slice).await?;
    Ok(immutable(&headers, &tag, ([(header::CONTENT_TYPE, "image/png")], png)))
}

/// Get an object's map of contact as a PLY file
///
/// The cells that are likely occupied as `points`, or the surface around them as a `mesh`; in
/// the object frame, in metres.
#[utoipa::path(get,
    path = "/v1/catalogues/{name}/versions/{version}/objects/{object}/occupancy.ply",
    operation_id = "get_occupancy_ply", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("object" = String, Path, description = "The object's id, or its name when trained"),
        PlyQuery),
    responses((status = 200, description = "The file", body = MapFile, content_type = "model/ply",
            headers(("etag" = String, description = "The version's tag"))),
        (status = 304, description = "It is the one of `If-None-Match`"), Conflict))]
pub(crate) async fn get_occupancy_ply(
    State(app): State<App>,
    Segment3(name, version, object): Segment3,
    Params(query): Params<PlyQuery>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let mapped = app.catalogues().mapped(&name, &version, &object).await?;
    let tag = mapped.tag();
    let ply = mapped.ply(app.pool(), query.form.unwrap_or_default()).await?;
    Ok(immutable(&headers, &tag, ([(header::CONTENT_TYPE, "model/ply")], ply)))
}

/// Merge the maps of contact of two versions
///
/// Makes a new version of this catalogue: the one that is added to, with the evidence of
/// another version's maps of contact (of another robot, for instance) added to those of the
/// same objects. Readings that both were trained from count twice. Everything else, such as
/// vocabulary, pair maps and pressures, is that of the version added to.
#[utoipa::path(post, path = "/v1/catalogues/{name}/merges", operation_id = "merge_maps",
    tag = "training", request_body = MergeMaps,
    params(("name" = String, Path, description = "The catalogue's name")),
    responses((status = 201, description = "The new version", body = CatalogueVersion),
        Conflict))]
pub(crate) async fn merge_maps(
    State(app): State<App>,
    Segment1(name): Segment1,
    JsonBody(request): JsonBody<MergeMaps>,
) -> Result<Response, Refusal> {
    let merged = app.catalogues().merge(&name, &request).await?;
    Ok(super::created(format!("/v1/catalogues/{name}/versions/{}", merged.version), merged))
}

/// An answer that never changes, or 304 when it is known.
fn immutable(headers: &HeaderMap, tag: &str, content: impl IntoResponse) -> Response {
    let known = headers.get(header::IF_NONE_MATCH).and_then(|value| value.to_str().ok());
    let is_known = known.is_some_and(|known| {
        known.split(',').any(|one| one.trim().trim_start_matches("W/") == tag)
    });
    let lasting = [(header::ETAG, tag.to_owned()), (header::CACHE_CONTROL, IMMUTABLE.to_owned())];
    if is_known {
        return (StatusCode::NOT_MODIFIED, lasting).into_response();
    }
    (lasting, content).into_response()
}
