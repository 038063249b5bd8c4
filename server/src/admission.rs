//! Who gets in: how many requests are under way at once, and how long one may take.
//!
//! What is over a bound is told to come back; nothing waits without end. Health checks and
//! metrics always get in, for an overloaded server must not look dead.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::app::App;
use crate::config::Config;
use crate::refusal::Refusal;

/// The bounds on what is under way.
#[derive(Debug)]
pub(crate) struct Admission {
    requests: Arc<Semaphore>,
    streams: Arc<Semaphore>,
    requests_max: usize,
    streams_max: usize,
}

impl Admission {
    pub(crate) fn new(config: &Config) -> Self {
        Self {
            requests: Arc::new(Semaphore::new(config.requests_max)),
            streams: Arc::new(Semaphore::new(config.streams_max)),
            requests_max: config.requests_max,
            streams_max: config.streams_max,
        }
    }

    /// Room for one event stream, for as long as the permit is held.
    pub(crate) fn stream(&self) -> Result<OwnedSemaphorePermit, Refusal> {
        let permit = Arc::clone(&self.streams).try_acquire_owned();
        permit.map_err(|_| Refusal::StreamsFull { open: self.streams_max })
    }

    fn request(&self) -> Result<OwnedSemaphorePermit, Refusal> {
        let permit = Arc::clone(&self.requests).try_acquire_owned();
        permit.map_err(|_| Refusal::RequestsFull { under_way: self.requests_max })
    }
}

/// Lets a request in if there is room, and ends it when it takes too long.
pub(crate) async fn admit(State(app): State<App>, request: Request, next: Next) -> Response {
    if matches!(request.uri().path(), "/livez" | "/readyz" | "/metrics") {
        return next.run(request).await;
    }
    let permit = match app.admission().request() {
        Ok(permit) => permit,
        Err(refusal) => return refusal.into_response(),
    };
    let within = app.config().answer_timeout;
    let answer = tokio::time::timeout(within, next.run(request)).await;
    drop(permit);
    answer.unwrap_or_else(|_| Refusal::TooSlow { within }.into_response())
}
