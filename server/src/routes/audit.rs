//! `/v1/audit`

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use palpate_schemas::{AuditPage, AuditQuery};

use crate::app::App;
use crate::services::audit::check_operation;
use crate::extract::Params;
use crate::refusal::Refusal;

/// List who changed what
///
/// Every request that changes something (readings of sessions aside, which their journals
/// have), with its outcome, and requests that were refused for want of a key or a role. Newest
/// first. What changed something, what was refused to holders of keys and what strangers tried
/// are three rings, each of which keeps its newest entries; repetitions of what failed within an
/// hour are counted in one entry.
#[utoipa::path(get, path = "/v1/audit", operation_id = "list_audit", tag = "keys",
    params(AuditQuery),
    responses((status = 200, description = "A page of entries, newest first", body = AuditPage)))]
pub(crate) async fn list_audit(
    State(app): State<App>,
    Params(query): Params<AuditQuery>,
) -> Result<Json<AuditPage>, Refusal> {
    check_operation(&query)?;
    let audit = Arc::clone(app.audit());
    audit.store().await;
    Ok(Json(app.pool().place()?.run_long(move || audit.list(&query)).await??))
}
