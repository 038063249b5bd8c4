//! Health, metrics and version of the server.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use palpate_schemas::{Liveness, Readiness, Version};

use crate::app::App;
use crate::middleware::telemetry;
use crate::refusal::Refusal;

/// Check that the process answers
///
/// The process answers. It says nothing of the stored data or of load: `/readyz` does.
#[utoipa::path(get, path = "/livez", operation_id = "livez", tag = "site",
    responses((status = 200, description = "The process answers", body = Liveness)))]
pub(crate) async fn livez() -> Json<Liveness> {
    Json(Liveness { alive: true })
}

/// Check that the server is ready
///
/// 503 tells a load balancer to route elsewhere; the problem names the failed checks. On a server
/// with keys, only callers with a valid key (any role) see the figures in `detail`.
#[utoipa::path(get, path = "/readyz", operation_id = "readyz", tag = "site",
    responses((status = 200, description = "All checks passed", body = Readiness)))]
pub(crate) async fn readyz(
    State(app): State<App>,
    headers: HeaderMap,
) -> Result<Json<Readiness>, Refusal> {
    let mut readiness = app.readiness();
    if !app.keys.admits(&headers) {
        let shown = |passed| if passed { "passed" } else { "failed" };
        readiness.checks.iter_mut().for_each(|check| check.detail = shown(check.passed).to_owned());
    }
    if readiness.ready { Ok(Json(readiness)) } else { Err(Refusal::NotReady(readiness)) }
}

/// Get metrics for Prometheus
///
/// Figures of this process in the text format of Prometheus. They begin anew at every start.
#[utoipa::path(get, path = "/metrics", operation_id = "metrics", tag = "site",
    responses((status = 200, description = "Metrics in the Prometheus text format",
        body = String, content_type = "text/plain")))]
pub(crate) async fn metrics(State(app): State<App>) -> Response {
    app.measure();
    let content_type = [(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")];
    let text = telemetry::metrics_handle().render() + &app.storage.figures();
    (content_type, text).into_response()
}

/// Get the server's version
///
/// Name and version of the program, and the version of the API.
#[utoipa::path(get, path = "/version", operation_id = "version", tag = "site",
    responses((status = 200, description = "The version", body = Version)))]
pub(crate) async fn version() -> Json<Version> {
    Json(Version {
        name: "palpate".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        api: "v1".to_owned(),
    })
}
