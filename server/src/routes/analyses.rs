//! `/v1/analyses`: computations on the request alone. Nothing is stored.

use axum::Json;
use axum::extract::State;
use palpate_schemas::{AnalyseCoverings, CoveringAnalysis};

use crate::app::App;
use crate::extract::JsonBody;
use crate::refusal::Refusal;
use crate::wire;

/// Compare coverings
///
/// Computes, for each covering, the spatial resolution, the depth range and whether the covering
/// avoids aliasing. Recommends the sharpest covering that does.
#[utoipa::path(post, path = "/v1/analyses/covering", operation_id = "analyse_coverings",
    tag = "analyses", request_body = AnalyseCoverings,
    responses((status = 200, description = "The comparison", body = CoveringAnalysis)))]
pub(crate) async fn analyse_coverings(
    State(app): State<App>,
    JsonBody(request): JsonBody<AnalyseCoverings>,
) -> Result<Json<CoveringAnalysis>, Refusal> {
    let question = wire::analysis::question(&request)?;
    let place = app.pool.place()?;
    Ok(Json(place.run_long(move || wire::analysis::analysis(&question)).await?))
}
