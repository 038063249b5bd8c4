//! The layer of the audit log: an entry before every change, its outcome after it.
//!
//! A change runs in a separate task, so that it and its entry are completed even if the caller
//! disconnects.

use std::time::Instant;

use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use palpate_store::audit::AuditEntry;
use tracing::Instrument as _;

use crate::app::App;
use crate::asker;
use crate::cause::Cause;
use crate::refusal::{LoadError, Refusal};
use crate::services::audit::{Attempt, KEEPS_OPEN, alike};

/// Records a change, runs it, and records its outcome. A change that cannot be recorded is
/// not made, nor is one by a key whose changes keep failing.
pub(crate) async fn record(State(app): State<App>, mut request: Request, next: Next) -> Response {
    let Some(attempt) = request.extensions_mut().remove::<Attempt>() else {
        return next.run(request).await;
    };
    let key = attempt.key.as_ref().map(|(id, _, _)| *id);
    let failures = &app.audit.failures;
    if let Some(Err(wait)) = key.map(|key| failures.check(key, Instant::now())) {
        let error = LoadError::FailuresExceeded { bound: failures.bound(wait), wait };
        app.audit.denied(attempt, StatusCode::TOO_MANY_REQUESTS.as_u16()).await;
        return Refusal::from(error).into_response();
    }
    let changing = async move {
        let asked = attempt.clone();
        let entry = match app.audit.begin(attempt).await {
            Ok(entry) => entry,
            Err(error) => return Refusal::from(error).into_response(),
        };
        let response = next.run(request).await;
        let status = response.status();
        if let Some(key) = key.filter(|_| is_of_the_caller(status)) {
            app.audit.failures.failed(key, Instant::now());
        }
        let repeats = is_repeated(asked.operation, status);
        let alike = repeats.then(|| alike(&asked, status.as_u16()));
        app.audit.finish(outcome(entry, &response), alike).await;
        response
    };
    let changed = asker::spawn(changing.in_current_span()).await;
    changed.unwrap_or_else(|_| Refusal::from(Cause::Panicked).into_response())
}

/// Whether a change failed because of its request.
fn is_of_the_caller(status: StatusCode) -> bool {
    status.is_client_error() && status != StatusCode::TOO_MANY_REQUESTS
}

/// Whether repetitions of an outcome are counted in one entry: failures, and repeated leases
/// of sessions.
fn is_repeated(operation: &str, status: StatusCode) -> bool {
    operation == KEEPS_OPEN || status.is_client_error() || status.is_server_error()
}

/// The entry with its outcome; a created resource is recorded by its own path.
fn outcome(entry: AuditEntry, response: &Response) -> AuditEntry {
    let status = response.status();
    let location = response.headers().get(header::LOCATION).filter(|_| status.is_success());
    let made = location.and_then(|at| at.to_str().ok()).map(str::to_owned);
    let resource = made.unwrap_or(entry.resource);
    AuditEntry { status: Some(status.as_u16()), resource, ..entry }
}
