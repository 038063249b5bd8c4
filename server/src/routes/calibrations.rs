//! `/v1/sensors/{sensor}/calibration`

use axum::Json;
use axum::extract::State;
use axum::response::Response;
use palpate_schemas::{CalibrateSensor, CalibrationQuery, SensorCalibration};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments};
use crate::refusal::Refusal;

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
    let sensor = app.sensors().get(&sensor)?;
    let calibration = app.sensors().calibrations().calibrate(&sensor, request, app.pool()).await?;
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
    let sensor = app.sensors().get(&sensor)?;
    Ok(Json(app.sensors().calibrations().show(&sensor, query)?))
}
