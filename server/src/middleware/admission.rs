//! The layer of admission: a request comes in with its whole body when there is room, and its
//! answer is counted until it was read.
//!
//! Health checks and metrics are always answered: an overloaded server must not look dead.

mod arrival;
mod departure;

use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::app::App;
use crate::asker;
use crate::middleware::caller;
use crate::refusal::{LoadError, Refusal};

/// Whether a path belongs to supervisors and is always answered.
pub(crate) fn is_watched(path: &str) -> bool {
    matches!(path, "/livez" | "/readyz" | "/metrics")
}

/// Reads a request's body, admits the request within the budgets, cancels it after its time
/// limit, and counts its answer until it has been read.
pub(crate) async fn admit(State(app): State<App>, request: Request, next: Next) -> Response {
    if is_watched(request.uri().path()) {
        return next.run(request).await;
    }
    let admitted = async {
        let client = caller::client(&request);
        let (mut request, body) = arrival::receive(&app, request, client).await?;
        request.extensions_mut().insert(client);
        let slot = app.admission.request(client)?;
        Ok::<_, Refusal>((request, body, slot, client))
    };
    let (request, body, slot, client) = match admitted.await {
        Ok(admitted) => admitted,
        Err(refusal) => return refusal.into_response(),
    };
    let within = app.config.answer_timeout;
    let answer = tokio::time::timeout(within, asker::ask(client, next.run(request))).await;
    drop((slot, body));
    let answer =
        answer.unwrap_or_else(|_| Refusal::from(LoadError::TooSlow { within }).into_response());
    departure::count(&app.admission.answers, client, answer)
}
