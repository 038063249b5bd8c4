//! `/v1/sensors` and their calibrations.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::Response;
use palpate_schemas::{
    CalibrateSensor, CalibrationQuery, CreateSensor, LabelledQuery, Reading, ReadingCheck, Sensor,
    SensorCalibration, SensorPage,
};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::{Conflict, Deleted};

/// List the sensors
///
/// Pages of sensors: the presets and those that were described.
#[utoipa::path(get, path = "/v1/sensors", operation_id = "list_sensors", tag = "sensors",
    params(LabelledQuery),
    responses((status = 200, description = "A page of sensors, oldest first", body = SensorPage)))]
pub(crate) async fn list_sensors(
    State(app): State<App>,
    Params(query): Params<LabelledQuery>,
) -> Result<Json<SensorPage>, Refusal> {
    Ok(Json(app.apart(move |app| app.sensors.list(query)).await?))
}

/// Create a sensor
///
/// Creates the sensor from a preset or a description. If the description omits the point spread,
/// the force curve or the noise, they are derived from the covering and the range. Every preset
/// exists from the start under its own name. Sensors are immutable because stored readings rely on
/// their geometry: to change one, create another.
#[utoipa::path(post, path = "/v1/sensors", operation_id = "create_sensor", tag = "sensors",
    request_body = CreateSensor,
    responses((status = 201, description = "The new sensor", body = Sensor), Conflict))]
pub(crate) async fn create_sensor(
    State(app): State<App>,
    JsonBody(request): JsonBody<CreateSensor>,
) -> Result<Response, Refusal> {
    let sensor = app.sensors.create(&request).await?;
    Ok(super::created(format!("/v1/sensors/{}", sensor.id), app.sensors.show(&sensor)?))
}

/// Get a sensor
///
/// Geometry and response of a sensor, and the number of its current calibration.
#[utoipa::path(get, path = "/v1/sensors/{sensor}", operation_id = "get_sensor", tag = "sensors",
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 200, description = "The sensor", body = Sensor)))]
pub(crate) async fn get_sensor(
    State(app): State<App>,
    Segments(sensor): Segments,
) -> Result<Json<Sensor>, Refusal> {
    let sensor = app.sensors.get(&sensor)?;
    Ok(Json(app.sensors.show(&sensor)?))
}

/// Delete a sensor
///
/// Also deletes its calibrations and its health. 409 while a stored object or session has a reading of the sensor,
/// or an unfinished job touches with it. Presets cannot be deleted.
#[utoipa::path(delete, path = "/v1/sensors/{sensor}", operation_id = "delete_sensor",
    tag = "sensors",
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses(Deleted, Conflict))]
pub(crate) async fn delete_sensor(
    State(app): State<App>,
    Segments(sensor): Segments,
) -> Result<StatusCode, Refusal> {
    app.sensors.remove(&sensor, &app.pool).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Check a reading
///
/// Reports how the server interprets a reading: the orientation of the image, missing and saturated
/// taxels, and the area of contact. Nothing is stored. The reading's `sensor` must be the sensor in
/// the path.
#[utoipa::path(post, path = "/v1/sensors/{sensor}/check", operation_id = "check_reading",
    tag = "sensors", request_body = Reading,
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 200, description = "The server's interpretation of the reading", body = ReadingCheck)))]
pub(crate) async fn check_reading(
    State(app): State<App>,
    Segments(sensor): Segments,
    JsonBody(reading): JsonBody<Reading>,
) -> Result<Json<ReadingCheck>, Refusal> {
    Ok(Json(app.sensors.check(&sensor, &reading)?))
}

/// Calibrate a sensor
///
/// Fits the response of each taxel to the given indentations, detects dead and cross-wired taxels,
/// and stores the result. The calibration applies to readings received after it, not to earlier
/// ones.
#[utoipa::path(post, path = "/v1/sensors/{sensor}/calibration", operation_id = "calibrate_sensor",
    tag = "sensors", request_body = CalibrateSensor,
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 201, description = "The new calibration", body = SensorCalibration)))]
pub(crate) async fn calibrate_sensor(
    State(app): State<App>,
    Segments(sensor): Segments,
    JsonBody(request): JsonBody<CalibrateSensor>,
) -> Result<Response, Refusal> {
    let sensor = app.sensors.get(&sensor)?;
    let calibration = app.sensors.calibrations().calibrate(&sensor, request, &app.pool).await?;
    let path = format!("/v1/sensors/{}/calibration?number={}", sensor.id, calibration.number);
    Ok(super::created(path, calibration))
}

/// Get a sensor's calibration
///
/// Returns the newest calibration, or the one with the given number. 404 if there is none.
#[utoipa::path(get, path = "/v1/sensors/{sensor}/calibration", operation_id = "get_calibration",
    tag = "sensors",
    params(("sensor" = String, Path, description = "The sensor's id or name"), CalibrationQuery),
    responses((status = 200, description = "The calibration", body = SensorCalibration)))]
pub(crate) async fn get_calibration(
    State(app): State<App>,
    Segments(sensor): Segments,
    Params(query): Params<CalibrationQuery>,
) -> Result<Json<SensorCalibration>, Refusal> {
    let sensor = app.sensors.get(&sensor)?;
    Ok(Json(app.sensors.calibrations().show(&sensor, query)?))
}
