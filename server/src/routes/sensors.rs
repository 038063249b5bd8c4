//! `/v1/sensors`

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::Response;
use palpate_schemas::{CreateSensor, PageQuery, Reading, ReadingCheck, Sensor, SensorPage};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segment1};
use crate::routes::documented::Conflict;
use crate::refusal::Refusal;

/// List the sensors
#[utoipa::path(get, path = "/v1/sensors", operation_id = "list_sensors", tag = "sensors",
    params(PageQuery),
    responses((status = 200, description = "A page of sensors, oldest first", body = SensorPage)))]
pub(crate) async fn list_sensors(
    State(app): State<App>,
    Params(query): Params<PageQuery>,
) -> Result<Json<SensorPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.sensors().list(&query)).await?))
}

/// Add a sensor
///
/// From a preset or a description; what its data sheet does not say of the point spread, the
/// force curve and the noise is filled in from the covering and the range. Every preset is there from the start under its own
/// name. A sensor does not change: readings rely on its geometry; add another one instead.
#[utoipa::path(post, path = "/v1/sensors", operation_id = "create_sensor", tag = "sensors",
    request_body = CreateSensor,
    responses((status = 201, description = "The new sensor", body = Sensor), Conflict))]
pub(crate) async fn create_sensor(
    State(app): State<App>,
    JsonBody(request): JsonBody<CreateSensor>,
) -> Result<Response, Refusal> {
    let sensor = app.sensors().create(&request).await?;
    Ok(super::created(format!("/v1/sensors/{}", sensor.id), app.sensors().show(&sensor)?))
}

/// Get a sensor
#[utoipa::path(get, path = "/v1/sensors/{sensor}", operation_id = "get_sensor", tag = "sensors",
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 200, description = "The sensor", body = Sensor)))]
pub(crate) async fn get_sensor(
    State(app): State<App>,
    Segment1(sensor): Segment1,
) -> Result<Json<Sensor>, Refusal> {
    let sensor = app.sensors().get(&sensor)?;
    Ok(Json(app.sensors().show(&sensor)?))
}

/// Delete a sensor
///
/// Its calibrations go too. 409 while something needs it: an object or a session that is kept
/// has a reading of it, or an unfinished job touches with it. Presets stay.
#[utoipa::path(delete, path = "/v1/sensors/{sensor}", operation_id = "delete_sensor",
    tag = "sensors",
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 204, description = "It is gone"), Conflict))]
pub(crate) async fn delete_sensor(
    State(app): State<App>,
    Segment1(sensor): Segment1,
) -> Result<StatusCode, Refusal> {
    app.sensors().remove(&sensor, app.pool()).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Try a reading out
///
/// Says how the server understands a reading: which way the image is turned, what is missing
/// or saturated, where it touches. Nothing is stored. The reading's own `sensor` must be the
/// one of the path.
#[utoipa::path(post, path = "/v1/sensors/{sensor}/check", operation_id = "check_reading",
    tag = "sensors", request_body = Reading,
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 200, description = "How the reading is understood", body = ReadingCheck)))]
pub(crate) async fn check_reading(
    State(app): State<App>,
    Segment1(sensor): Segment1,
    JsonBody(reading): JsonBody<Reading>,
) -> Result<Json<ReadingCheck>, Refusal> {
    Ok(Json(app.sensors().check(&sensor, &reading)?))
}
