//! Who gets in: how many requests are under way at once, and how long one may take.
//!
//! What is over a bound is told to come back; nothing waits without end. Health checks and
//! metrics always get in, for an overloaded server must not look dead.

use std::sync::{Arc, Mutex, PoisonError};

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
    /// A permit is a block of a body.
    bodies: Arc<Semaphore>,
    requests_max: usize,
    streams_max: usize,
    body_blocks_max: usize,
}

/// Bytes of a block of a body.
const BODY_BLOCK: usize = 1024;

/// The room that a request's body has, until the request is answered: what is made of a body
/// needs memory as well.
#[derive(Clone, Debug)]
pub(crate) struct BodyRoom(Arc<Mutex<Held>>);

#[derive(Debug)]
struct Held {
    room: Arc<Semaphore>,
    permit: Option<OwnedSemaphorePermit>,
    blocks_max: usize,
}

impl BodyRoom {
    /// Makes the room as large as a body of `bytes`.
    pub(crate) fn hold(&self, bytes: usize) -> Result<(), Refusal> {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let has = held.permit.as_ref().map_or(0, OwnedSemaphorePermit::num_permits);
        let more = bytes.div_ceil(BODY_BLOCK).saturating_sub(has);
        let full = |held: &Held| {
            let used = held.blocks_max.saturating_sub(held.room.available_permits());
            Refusal::BodiesFull { used: used * BODY_BLOCK, max: held.blocks_max * BODY_BLOCK }
        };
        let Ok(wanted) = u32::try_from(more) else { return Err(full(&held)) };
        let taken = Arc::clone(&held.room).try_acquire_many_owned(wanted);
        let taken = taken.map_err(|_| full(&held))?;
        match &mut held.permit {
            Some(permit) => permit.merge(taken),
            none => *none = Some(taken),
        }
        Ok(())
    }
}

impl Admission {
    pub(crate) fn new(config: &Config) -> Self {
        let body_blocks_max = config.bodies_bytes_max / BODY_BLOCK;
        Self {
            requests: Arc::new(Semaphore::new(config.requests_max)),
            streams: Arc::new(Semaphore::new(config.streams_max)),
            bodies: Arc::new(Semaphore::new(body_blocks_max)),
            requests_max: config.requests_max,
            streams_max: config.streams_max,
            body_blocks_max,
        }
    }

    /// Room for one event stream, for as long as the permit is held.
    pub(crate) fn stream(&self) -> Result<OwnedSemaphorePermit, Refusal> {
        let permit = Arc::clone(&self.streams).try_acquire_owned();
        permit.map_err(|_| Refusal::StreamsFull { open: self.streams_max })
    }

    /// Bytes of the bodies under way.
    pub(crate) fn body_bytes(&self) -> usize {
        self.body_blocks_max.saturating_sub(self.bodies.available_permits()) * BODY_BLOCK
    }

    fn body_room(&self) -> BodyRoom {
        let (room, blocks_max) = (Arc::clone(&self.bodies), self.body_blocks_max);
        BodyRoom(Arc::new(Mutex::new(Held { room, permit: None, blocks_max })))
    }

    fn request(&self) -> Result<OwnedSemaphorePermit, Refusal> {
        let permit = Arc::clone(&self.requests).try_acquire_owned();
        permit.map_err(|_| Refusal::RequestsFull { under_way: self.requests_max })
    }
}

/// Whether a path is what supervisors look at: it is always answered.
pub(crate) fn is_watched(path: &str) -> bool {
    matches!(path, "/livez" | "/readyz" | "/metrics")
}

/// Lets a request in if there is room, and ends it when it takes too long.
pub(crate) async fn admit(State(app): State<App>, mut request: Request, next: Next) -> Response {
    if is_watched(request.uri().path()) {
        return next.run(request).await;
    }
    let permit = match app.admission().request() {
        Ok(permit) => permit,
        Err(refusal) => return refusal.into_response(),
    };
    let room = app.admission().body_room();
    request.extensions_mut().insert(room.clone());
    let within = app.config().answer_timeout;
    let answer = tokio::time::timeout(within, next.run(request)).await;
    drop((permit, room));
    answer.unwrap_or_else(|_| Refusal::TooSlow { within }.into_response())
}
