//! `/v1/catalogues/{name}/versions/{version}/objects/{object}`: interest points and contact maps, and
//! merging contact maps.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use palpate_schemas::{
    CatalogueVersion, InterestMap, MergeMaps, OccupancyMap, PlyQuery, SliceQuery,
};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::{Conflict, MapFile};

/// Cache policy of answers that never change: one year.
const IMMUTABLE: &str = "private, max-age=31536000, immutable";

/// Get where a touch tells most about an object
///
/// Returns at most 500 places of the object's surface, each with the expected information of a touch
/// there on the object's identity, in bits. The object is compared with all others of the version,
/// or with the 31 that its touches resemble most, each in the poses in which it looks most like the
/// object, and all equally probable. It is computed on the first request and then kept for a while; equal
/// versions give equal answers. 409 if the version was trained without surfaces.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}/objects/{object}/interest",
    operation_id = "get_interest", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("object" = String, Path, description = "The object's id, or its name when trained")),
    responses((status = 200, description = "The places", body = InterestMap), Conflict))]
pub(crate) async fn get_interest(
    State(app): State<App>,
    Segments((name, version, object)): Segments<(String, String, String)>,
) -> Result<Json<InterestMap>, Refusal> {
    Ok(Json(app.catalogues.interest(&name, &version, &object).await?))
}

/// Get an object's contact map
///
/// Returns the cells around the object that generate contact, as learnt with `geometric`, in the
/// object frame. `slice` adds the log-odds of one layer of cells. The map never changes. 409 if the
/// version was trained without geometry.
#[utoipa::path(get, path = "/v1/catalogues/{name}/versions/{version}/objects/{object}/occupancy",
    operation_id = "get_occupancy", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("object" = String, Path, description = "The object's id, or its name when trained"),
        SliceQuery),
    responses((status = 200, description = "The map", body = OccupancyMap,
            headers(("etag" = String, description = "The version's tag"))),
        Conflict))]
pub(crate) async fn get_occupancy(
    State(app): State<App>,
    Segments((name, version, object)): Segments<(String, String, String)>,
    Params(query): Params<SliceQuery>,
) -> Result<Response, Refusal> {
    let mapped = app.catalogues.mapped(&name, &version, &object).await?;
    let map = mapped.occupancy(query.slice)?;
    Ok(immutable(mapped.tag(), Json(map)))
}

/// Get an object's contact map as an image
///
/// Renders one layer of cells as a heat map, at least one pixel per cell, with y up. Without
/// `slice` it shows the middle layer.
#[utoipa::path(get,
    path = "/v1/catalogues/{name}/versions/{version}/objects/{object}/occupancy.png",
    operation_id = "get_occupancy_png", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("object" = String, Path, description = "The object's id, or its name when trained"),
        SliceQuery),
    responses((status = 200, description = "The image", body = MapFile, content_type = "image/png",
            headers(("etag" = String, description = "The version's tag"))),
        Conflict))]
pub(crate) async fn get_occupancy_png(
    State(app): State<App>,
    Segments((name, version, object)): Segments<(String, String, String)>,
    Params(query): Params<SliceQuery>,
) -> Result<Response, Refusal> {
    let mapped = app.catalogues.mapped(&name, &version, &object).await?;
    let tag = mapped.tag();
    let png = mapped.png(&app.pool, query.slice).await?;
    Ok(immutable(tag, ([(header::CONTENT_TYPE, "image/png")], png)))
}

/// Get an object's contact map as a PLY file
///
/// Exports the likely occupied cells as `points`, or the surface around them as a `mesh`, in the
/// object frame and in metres.
#[utoipa::path(get,
    path = "/v1/catalogues/{name}/versions/{version}/objects/{object}/occupancy.ply",
    operation_id = "get_occupancy_ply", tag = "training",
    params(("name" = String, Path, description = "The catalogue's name"),
        ("version" = u32, Path, description = "The version's number"),
        ("object" = String, Path, description = "The object's id, or its name when trained"),
        PlyQuery),
    responses((status = 200, description = "The file", body = MapFile, content_type = "model/ply",
            headers(("etag" = String, description = "The version's tag"))),
        Conflict))]
pub(crate) async fn get_occupancy_ply(
    State(app): State<App>,
    Segments((name, version, object)): Segments<(String, String, String)>,
    Params(query): Params<PlyQuery>,
) -> Result<Response, Refusal> {
    let mapped = app.catalogues.mapped(&name, &version, &object).await?;
    let tag = mapped.tag();
    let ply = mapped.ply(&app.pool, query.form.unwrap_or_default()).await?;
    Ok(immutable(tag, ([(header::CONTENT_TYPE, "model/ply")], ply)))
}

/// Merge the contact maps of two versions
///
/// Creates a new version of this catalogue: a copy of the base version in which the evidence of
/// another version's contact maps is added to the maps of the same objects. The other version may
/// come from another robot. Readings that trained both versions count twice. Everything else
/// (vocabulary, pair maps, pressures) comes from the base version.
#[utoipa::path(post, path = "/v1/catalogues/{name}/merges", operation_id = "merge_maps",
    tag = "training", request_body = MergeMaps,
    params(("name" = String, Path, description = "The catalogue's name")),
    responses((status = 201, description = "The new version", body = CatalogueVersion),
        Conflict))]
pub(crate) async fn merge_maps(
    State(app): State<App>,
    Segments(name): Segments,
    JsonBody(request): JsonBody<MergeMaps>,
) -> Result<Response, Refusal> {
    let merged = app.catalogues.merge(&name, &request).await?;
    Ok(super::created(format!("/v1/catalogues/{name}/versions/{}", merged.version), merged))
}

/// An answer that never changes.
fn immutable(tag: String, content: impl IntoResponse) -> Response {
    let lasting = [(header::ETAG, tag), (header::CACHE_CONTROL, IMMUTABLE.to_owned())];
    (lasting, content).into_response()
}
