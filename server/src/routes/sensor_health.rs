//! `/v1/sensors/{sensor}/health`.

use axum::Json;
use axum::extract::State;
use palpate_schemas::SensorHealth;

use crate::app::App;
use crate::extract::Segments;
use crate::refusal::Refusal;

/// Get a sensor's health
///
/// Whether to commission the sensor again, and why. Presses that met nothing show offsets, drift
/// and noise of taxels; presses beside which neighbours answer show dead and weak ones; sessions
/// that recognised their object with the method `surface` and at least six touches show the error
/// of the tool centre. A session is counted when it has ended, in the background; `n_waiting` tells
/// how many are not counted yet. Days of earlier calibrations do not count.
#[utoipa::path(get, path = "/v1/sensors/{sensor}/health", operation_id = "get_sensor_health",
    tag = "sensors",
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 200, description = "The sensor's health", body = SensorHealth)))]
pub(crate) async fn get_sensor_health(
    State(app): State<App>,
    Segments(sensor): Segments,
) -> Result<Json<SensorHealth>, Refusal> {
    let sensor = app.sensors.get(&sensor)?;
    Ok(Json(app.apart(move |app| app.sensors.health().show(&sensor)).await?))
}
