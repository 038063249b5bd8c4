//! The layer of rates: a client that has used its share of requests waits.

use std::time::Duration;

use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::app::App;
use crate::middleware::admission::is_watched;
use crate::middleware::caller;
use crate::refusal::{LoadError, Refusal};

/// Admits a request within its client's share, and reports the rest.
pub(crate) async fn share(State(app): State<App>, request: Request, next: Next) -> Response {
    let Some(rates) = app.rates.as_ref().filter(|_| !is_watched(request.uri().path())) else {
        return next.run(request).await;
    };
    let Some(client) = caller::client(&request) else { return next.run(request).await };
    match rates.take(client) {
        Ok(left) => {
            let mut response = next.run(request).await;
            if !response.headers().contains_key("ratelimit") {
                let bound = rates.bound(left, Duration::from_secs(1));
                response.headers_mut().extend(bound.headers());
            }
            response
        }
        Err(wait) => {
            let bound = rates.bound(0, wait);
            Refusal::from(LoadError::RateExceeded { bound, wait }).into_response()
        }
    }
}
