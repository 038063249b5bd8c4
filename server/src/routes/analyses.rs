//! `/v1/analyses`: computed from the request alone, nothing is stored.

use axum::Json;
use axum::extract::State;
use palpate_schemas::{AnalyseCoverings, CoveringAnalysis};

use crate::app::App;
use crate::extract::JsonBody;
use crate::refusal::Refusal;
use crate::wire;

/// Compare coverings
///
/// How finely places can be told apart under each covering, how deep it feels, and whether it
/// avoids aliasing; recommends the sharpest one that does.
#[utoipa::path(post, path = "/v1/analyses/covering", operation_id = "analyse_coverings",
    tag = "analyses", request_body = AnalyseCoverings,
    responses((status = 200, description = "How they compare", body = CoveringAnalysis)))]
pub(crate) async fn analyse_coverings(
    State(app): State<App>,
    JsonBody(request): JsonBody<AnalyseCoverings>,
) -> Result<Json<CoveringAnalysis>, Refusal> {
    let question = wire::analysis::question(&request)?;
    let place = app.pool().place()?;
    Ok(Json(place.run_long(move || wire::analysis::analysis(&question)).await?))
}
