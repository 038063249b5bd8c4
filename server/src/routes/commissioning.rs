//! `/v1/sensors/{sensor}/commissionings`, passports, and the reference bodies.

use axum::Json;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use palpate_schemas::{
    CalibrationQuery, CommissionSensor, Commissioning, ReferenceBodies, SensorPassport,
};

use crate::app::App;
use crate::extract::{JsonBody, Params, Segments};
use crate::refusal::Refusal;
use crate::routes::documented::MeshFile;
use crate::services::commissionings::Commissionings;

/// Commission a sensor
///
/// Finds from 8 to 100 touches of one known object what holds for the sensor on its robot: units,
/// order of images and quaternions, direction of poses, tool centre, response and edge of the
/// covering, single taxels. The touches come as the driver sends them. With `apply` the result
/// becomes the sensor's passport, which corrects readings received after it; the newest calibration
/// of the taxels stays and applies first, and `calibration` is the number of the passport.
#[utoipa::path(post, path = "/v1/sensors/{sensor}/commissionings",
    operation_id = "commission_sensor", tag = "sensors", request_body = CommissionSensor,
    params(("sensor" = String, Path, description = "The sensor's id or name")),
    responses((status = 200, description = "The findings", body = Commissioning)))]
pub(crate) async fn commission_sensor(
    State(app): State<App>,
    Segments(sensor): Segments,
    JsonBody(request): JsonBody<CommissionSensor>,
) -> Result<Json<Commissioning>, Refusal> {
    let sensor = app.sensors.get(&sensor)?;
    Ok(Json(app.commissionings.commission(&sensor, request).await?))
}

/// Get a sensor's passport
///
/// Returns the passport of the newest calibration, or of the one with the given number. 404 if it
/// has none.
#[utoipa::path(get, path = "/v1/sensors/{sensor}/passport", operation_id = "get_passport",
    tag = "sensors",
    params(("sensor" = String, Path, description = "The sensor's id or name"), CalibrationQuery),
    responses((status = 200, description = "The passport", body = SensorPassport)))]
pub(crate) async fn get_passport(
    State(app): State<App>,
    Segments(sensor): Segments,
    Params(query): Params<CalibrationQuery>,
) -> Result<Json<SensorPassport>, Refusal> {
    let sensor = app.sensors.get(&sensor)?;
    Ok(Json(app.sensors.calibrations().passport(&sensor, query)?))
}

/// List the reference bodies
///
/// Bodies to print and to touch, if no object of a catalogue is at hand.
#[utoipa::path(get, path = "/v1/reference-bodies", operation_id = "list_reference_bodies",
    tag = "sensors",
    responses((status = 200, description = "The bodies", body = ReferenceBodies)))]
pub(crate) async fn list_reference_bodies(
    State(app): State<App>,
) -> Result<Json<ReferenceBodies>, Refusal> {
    Ok(Json(app.apart(|_| Ok::<_, Refusal>(Commissionings::bodies())).await?))
}

/// Get a reference body's mesh
///
/// A binary STL in millimetres, ready to print.
#[utoipa::path(get, path = "/v1/reference-bodies/{body}/mesh", operation_id = "get_reference_mesh",
    tag = "sensors",
    params(("body" = String, Path, description = "`ridge`, `sphere`, `cube` or `wedge`")),
    responses((status = 200, description = "The file",
        content((MeshFile = "model/stl")))))]
pub(crate) async fn get_reference_mesh(
    State(app): State<App>,
    Segments(body): Segments,
) -> Result<Response, Refusal> {
    let file = app.apart(move |_| Commissionings::body_file(&body)).await?;
    Ok(([(CONTENT_TYPE, "model/stl")], file).into_response())
}
