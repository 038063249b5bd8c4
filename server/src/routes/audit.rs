//! `/v1/audit`

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use palpate_schemas::{AuditPage, AuditQuery};

use crate::app::App;
use crate::extract::Params;
use crate::refusal::Refusal;
use crate::services::audit::check_operation;

/// List the audit log
///
/// Lists every request that changed something, with its outcome, and every request refused for lack
/// of a key or a role, newest first. Readings posted to sessions are not listed; the session's
/// journal records them.
///
/// The log has three rings: changes, requests refused to key holders, and requests refused to
/// callers without a key. Each ring keeps its newest entries and never displaces entries of
/// another. Failed requests repeated within an hour share one entry with a count.
#[utoipa::path(get, path = "/v1/audit", operation_id = "list_audit", tag = "keys",
    params(AuditQuery),
    responses((status = 200, description = "A page of entries, newest first", body = AuditPage)))]
pub(crate) async fn list_audit(
    State(app): State<App>,
    Params(query): Params<AuditQuery>,
) -> Result<Json<AuditPage>, Refusal> {
    check_operation(&query)?;
    let audit = Arc::clone(&app.audit);
    audit.store().await;
    Ok(Json(app.pool.place()?.run_long(move || audit.list(&query)).await??))
}
