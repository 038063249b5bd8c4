//! `/v1/objects`

use axum::Json;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use palpate_schemas::{
    AddTrainingReadings, CreateObject, LabelledQuery, MeshQuery, MeshReport, ObjectInfo,
    ObjectPage, PageQuery, StoredReadingPage, TrainingReadingsAdded, UpdateObject,
};

use crate::app::App;
use crate::extract::{JsonBody, MeshBody, Params, ReadingsBody, Segments};
use crate::refusal::Refusal;
use crate::routes::blocks;
use crate::routes::documented::{Conflict, Deleted, MeshFile};

/// List the objects
///
/// Pages of objects, by default all of them; `labels` selects.
#[utoipa::path(get, path = "/v1/objects", operation_id = "list_objects", tag = "objects",
    params(LabelledQuery),
    responses((status = 200, description = "A page of objects, oldest first", body = ObjectPage)))]
pub(crate) async fn list_objects(
    State(app): State<App>,
    Params(query): Params<LabelledQuery>,
) -> Result<Json<ObjectPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.objects.list(query)).await?))
}

/// Create an object
///
/// Creates an object without data. Store its mesh or its training readings next.
#[utoipa::path(post, path = "/v1/objects", operation_id = "create_object", tag = "objects",
    request_body = CreateObject,
    responses((status = 201, description = "The new object", body = ObjectInfo), Conflict))]
pub(crate) async fn create_object(
    State(app): State<App>,
    JsonBody(request): JsonBody<CreateObject>,
) -> Result<Response, Refusal> {
    let object = app.objects.create(request).await?;
    Ok(super::created(format!("/v1/objects/{}", object.id), app.objects.show(&object)?))
}

/// Get an object
///
/// Name, description, labels and what the object has to be trained from.
#[utoipa::path(get, path = "/v1/objects/{object}", operation_id = "get_object", tag = "objects",
    params(("object" = String, Path, description = "The object's id or name")),
    responses((status = 200, description = "The object", body = ObjectInfo)))]
pub(crate) async fn get_object(
    State(app): State<App>,
    Segments(object): Segments,
) -> Result<Json<ObjectInfo>, Refusal> {
    let object = app.objects.find(&object)?;
    Ok(Json(app.objects.show(&object)?))
}

/// Rename or describe an object
///
/// Changes the given fields. Trained versions keep the name with which they were trained.
#[utoipa::path(patch, path = "/v1/objects/{object}", operation_id = "update_object",
    tag = "objects", request_body = UpdateObject,
    params(("object" = String, Path, description = "The object's id or name")),
    responses((status = 200, description = "The updated object", body = ObjectInfo), Conflict))]
pub(crate) async fn update_object(
    State(app): State<App>,
    Segments(object): Segments,
    JsonBody(request): JsonBody<UpdateObject>,
) -> Result<Json<ObjectInfo>, Refusal> {
    let object = app.objects.update(&object, request).await?;
    Ok(Json(app.objects.show(&object)?))
}

/// Delete an object
///
/// Also deletes its mesh and training readings. Versions trained with the object still recognise
/// it. 409 while an unfinished job needs the object.
#[utoipa::path(delete, path = "/v1/objects/{object}", operation_id = "delete_object",
    tag = "objects",
    params(("object" = String, Path, description = "The object's id or name")),
    responses(Deleted, Conflict))]
pub(crate) async fn delete_object(
    State(app): State<App>,
    Segments(object): Segments,
) -> Result<StatusCode, Refusal> {
    app.objects.delete(&object).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Get an object's mesh
///
/// Returns the uploaded file with the content type of its format.
#[utoipa::path(get, path = "/v1/objects/{object}/mesh", operation_id = "get_mesh", tag = "objects",
    params(("object" = String, Path, description = "The object's id or name")),
    responses((status = 200, description = "The file in its original format",
        content((MeshFile = "model/stl"), (MeshFile = "model/obj"), (MeshFile = "model/ply"),
            (MeshFile = "model/off"), (MeshFile = "model/gltf-binary"), (MeshFile = "model/3mf")))))]
pub(crate) async fn get_mesh(
    State(app): State<App>,
    Segments(object): Segments,
) -> Result<Response, Refusal> {
    let (format, file) = app.objects.mesh(&object).await?;
    Ok(blocks::answer(format.media_type(), file, &app.pool))
}

/// Get a small picture of an object
///
/// A picture of 256 × 256 pixels of the object's mesh on a transparent ground, made when the mesh
/// was uploaded. Its text `size_m` states the mesh's extent along x, y and z in metres. 404 if the
/// object has no mesh.
#[utoipa::path(get, path = "/v1/objects/{object}/thumbnail.png", operation_id = "get_thumbnail",
    tag = "objects",
    params(("object" = String, Path, description = "The object's id or name")),
    responses((status = 200, description = "The picture", body = MeshFile,
            content_type = "image/png",
            headers(("etag" = String, description = "The mesh's tag")))))]
pub(crate) async fn get_thumbnail(
    State(app): State<App>,
    Segments(object): Segments,
) -> Result<Response, Refusal> {
    let (tag, png) = app.objects.thumbnail(&object).await?;
    Ok(([(header::ETAG, tag)], [(header::CONTENT_TYPE, "image/png")], png).into_response())
}

/// Upload an object's mesh
///
/// The body is the raw file, at most 67 MB and two million triangles. All its solids, groups and
/// objects are one body. `unit` is mandatory for STL, OBJ, PLY and OFF, which do not record it; CAD
/// programs usually write millimetres, robotics tools metres. The content type names the format
/// (`model/stl`, `model/obj`, `model/ply`, `model/off`, `model/gltf-binary`, `model/3mf`); with
/// `application/octet-stream`, `format` does. A GLB's buffers must be inside the file, without
/// compression. The upload replaces the previous mesh. Versions trained from that mesh do not
/// change.
#[utoipa::path(put, path = "/v1/objects/{object}/mesh", operation_id = "put_mesh", tag = "objects",
    params(("object" = String, Path, description = "The object's id or name"), MeshQuery),
    request_body(content = MeshFile, content_type = "application/octet-stream",
        description = "The mesh file"),
    responses((status = 200, description = "The server's interpretation of the mesh", body = MeshReport)))]
pub(crate) async fn put_mesh(
    State(app): State<App>,
    Segments(object): Segments,
    Params(query): Params<MeshQuery>,
    MeshBody { content_type, bytes }: MeshBody,
) -> Result<Json<MeshReport>, Refusal> {
    Ok(Json(app.objects.put_mesh(&object, query, &content_type, bytes).await?))
}

/// List an object's training readings
///
/// Pages of the readings from which the object is trained, in the order of their storage.
#[utoipa::path(get, path = "/v1/objects/{object}/readings", operation_id = "list_object_readings",
    tag = "objects",
    params(("object" = String, Path, description = "The object's id or name"), PageQuery),
    responses((status = 200, description = "A page of readings in the order of arrival",
        body = StoredReadingPage)))]
pub(crate) async fn list_object_readings(
    State(app): State<App>,
    Segments(object): Segments,
    Params(query): Params<PageQuery>,
) -> Result<Json<StoredReadingPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.objects.readings(&object, &query, &app.keys)).await?))
}

/// Add training readings of an object
///
/// Stores 1 to 1000 readings taken of the object at rest, with poses in one frame fixed to it. The
/// request is stored whole or not at all. An object that has readings is trained from them, not
/// from its mesh.
#[utoipa::path(post, path = "/v1/objects/{object}/readings", operation_id = "add_object_readings",
    tag = "objects", request_body = AddTrainingReadings,
    params(("object" = String, Path, description = "The object's id or name")),
    responses((status = 200, description = "The number of readings stored", body = TrainingReadingsAdded),
        Conflict))]
pub(crate) async fn add_object_readings(
    State(app): State<App>,
    Segments(object): Segments,
    ReadingsBody(request): ReadingsBody<AddTrainingReadings>,
) -> Result<Json<TrainingReadingsAdded>, Refusal> {
    Ok(Json(app.objects.add_readings(&object, &request).await?))
}
