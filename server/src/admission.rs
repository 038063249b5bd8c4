//! Admission: budgets for the resources that a request occupies, from its first byte to its
//! answer's last.
//!
//! Each of five budgets has a total and a share for each client: bytes of bodies that have
//! arrived and of the values that they become, requests under way, event streams, snapshots, and
//! bytes of unread answers. A request takes its slot when its body is complete: announcing a body
//! costs nothing. A client over a limit is refused, with `Retry-After` where waiting helps.
//! Health checks and metrics are always answered: an overloaded server must not look dead.

use std::sync::{Arc, Mutex, PoisonError};

use palpate_store::engine::EngineError;
use palpate_store::sled::CUTS_MAX;

use crate::budget::{Budget, Holding, Over, ShareFull};
use crate::client::Client;
use crate::config::Config;
use crate::door::Connections;
use crate::refusal::{LoadError, Refusal};

/// The budgets of requests under way.
#[derive(Debug)]
pub(crate) struct Admission {
    requests: Arc<Budget>,
    streams: Arc<Budget>,
    pub(crate) bodies: Arc<Budget>,
    pub(crate) answers: Arc<Budget>,
    snapshots: Arc<Budget>,
    connections: Arc<Connections>,
}

impl Admission {
    pub(crate) fn new(config: &Config) -> Self {
        Self {
            requests: Budget::new(config.requests_max),
            streams: Budget::new(config.streams_max),
            bodies: Budget::new(config.bodies_bytes_max),
            answers: Budget::new(config.answers_bytes_max),
            snapshots: Budget::new(CUTS_MAX),
            connections: Connections::new(config.connections_max),
        }
    }

    /// Reserves an event stream of `n` sessions or jobs for the lifetime of the holding. Every
    /// event is written for every follower, so each of them counts.
    pub(crate) fn stream(&self, client: Option<Client>, n: usize) -> Result<Holding, LoadError> {
        self.streams.take(client, n).map_err(|over| match over {
            Over::Total => LoadError::StreamsFull { open: self.streams.total() },
            Over::Share => share("streams", "streams", &self.streams),
        })
    }

    /// Reserves one snapshot for the lifetime of the holding.
    pub(crate) fn snapshot(&self, client: Option<Client>) -> Result<Holding, Refusal> {
        self.snapshots.take(client, 1).map_err(|over| match over {
            Over::Total => EngineError::CutsUnderWay { max: self.snapshots.total() }.into(),
            Over::Share => share("snapshots", "snapshots", &self.snapshots).into(),
        })
    }

    /// The limits on connections.
    pub(crate) fn connections(&self) -> &Arc<Connections> {
        &self.connections
    }

    /// Bytes of bodies whose requests are not answered.
    pub(crate) fn body_bytes(&self) -> usize {
        self.bodies.used()
    }

    /// Bytes of unread answers.
    pub(crate) fn answer_bytes(&self) -> usize {
        self.answers.used()
    }

    /// Use and total of each budget, by name, for metrics.
    pub(crate) fn occupied(&self) -> [(&'static str, usize, usize); 6] {
        let of = |name, budget: &Budget| (name, budget.used(), budget.total());
        [
            ("requests", self.requests.used(), self.requests.total()),
            of("streams", &self.streams),
            of("bodies", &self.bodies),
            of("answers", &self.answers),
            of("snapshots", &self.snapshots),
            ("connections", self.connections.used(), self.connections.total()),
        ]
    }

    /// Room for one request, for as long as the holding lives.
    pub(crate) fn request(&self, client: Option<Client>) -> Result<Holding, LoadError> {
        self.requests.take(client, 1).map_err(|over| match over {
            Over::Total => LoadError::RequestsFull { under_way: self.requests.total() },
            Over::Share => share("concurrency", "concurrent-requests", &self.requests),
        })
    }
}

/// The memory of a request's body, as it came and as values: an extension of the request.
#[derive(Clone, Debug)]
pub(crate) struct Room {
    bodies: Arc<Budget>,
    held: Arc<Mutex<Holding>>,
}

impl Room {
    /// Room for a body before its first byte.
    pub(crate) fn new(bodies: &Arc<Budget>, client: Option<Client>) -> Result<Self, LoadError> {
        let held = bodies.take(client, 0).map_err(|over| full(bodies, over))?;
        Ok(Self { bodies: Arc::clone(bodies), held: Arc::new(Mutex::new(held)) })
    }

    /// Grows the room to at least `bytes`.
    pub(crate) fn grow_to(&self, bytes: usize) -> Result<(), LoadError> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.grow_to(bytes).map_err(|over| full(&self.bodies, over))
    }
}

fn full(bodies: &Budget, over: Over) -> LoadError {
    match over {
        Over::Total => LoadError::BodiesFull { used: bodies.used(), max: bodies.total() },
        Over::Share => share("bodies", "content-bytes", bodies),
    }
}

/// Maximum memory of an answer that is produced while it is read: an extension of the response.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InMemory(pub(crate) usize);

/// The refusal of a client that holds its share of a budget.
pub(crate) fn share(name: &'static str, unit: &'static str, budget: &Budget) -> LoadError {
    ShareFull { name, unit, used: budget.used(), total: budget.total() }.into()
}
