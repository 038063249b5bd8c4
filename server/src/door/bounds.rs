//! Limits on connections: a total, a share per address, and a reserve for health checks.

use std::collections::VecDeque;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::oneshot;

use crate::budget::{Budget, Holding};
use crate::client::Client;

/// Number of connections in the reserve. Chosen: a handful of supervisors connect at once,
/// each for milliseconds.
const RESERVE: usize = 8;

/// File descriptors reserved for the database, the log and the runtime. Chosen: an idle
/// server has about 20.
const OTHER_FILES: u64 = 32;

/// The connections of a server.
#[derive(Debug)]
pub(crate) struct Connections {
    budget: Arc<Budget>,
    /// Connections in the reserve, the oldest first; sending or dropping evicts one.
    reserve: Mutex<VecDeque<oneshot::Sender<()>>>,
}

/// The slot of one connection.
#[derive(Debug)]
pub(crate) enum Place {
    /// Within the limits.
    Usual(#[expect(dead_code, reason = "held until the connection ends")] Holding),
    /// In the reserve, until it is resolved.
    Reserve(oneshot::Receiver<()>),
}

impl Connections {
    /// At most `total` connections, and no more than the system has file descriptors for.
    pub(crate) fn new(total: usize) -> Arc<Self> {
        let files = files_max().saturating_sub(OTHER_FILES + RESERVE as u64);
        let total = total.min(usize::try_from(files).unwrap_or(usize::MAX)).max(1);
        Arc::new(Self { budget: Budget::new(total), reserve: Mutex::default() })
    }

    /// A slot for a connection from an address.
    pub(crate) fn place(&self, address: IpAddr) -> Place {
        if let Ok(holding) = self.budget.take(Some(Client::at(address)), 1) {
            return Place::Usual(holding);
        }
        metrics::counter!("palpate_connections_refused_total").increment(1);
        let (evict, evicted) = oneshot::channel();
        let mut reserve = self.reserve.lock().unwrap_or_else(PoisonError::into_inner);
        reserve.retain(|place| !place.is_closed());
        while reserve.len() >= RESERVE {
            reserve.pop_front();
        }
        reserve.push_back(evict);
        Place::Reserve(evicted)
    }

    /// Number of connections outside the reserve.
    pub(crate) fn used(&self) -> usize {
        self.budget.used()
    }

    /// Maximum number of connections.
    pub(crate) fn total(&self) -> usize {
        self.budget.total()
    }
}

impl Place {
    pub(crate) fn is_reserve(&self) -> bool {
        matches!(self, Self::Reserve(_))
    }

    /// Resolves when a newer connection needs this slot of the reserve.
    pub(crate) async fn evicted(&mut self) {
        match self {
            Self::Usual(_) => std::future::pending().await,
            Self::Reserve(evicted) => {
                let _ = evicted.await;
            }
        }
    }
}

/// Maximum number of open files of this process, raised to the system's limit.
fn files_max() -> u64 {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let mut limit = getrlimit(Resource::Nofile);
    if limit.current != limit.maximum {
        let raised = rustix::process::Rlimit { current: limit.maximum, ..limit };
        if setrlimit(Resource::Nofile, raised).is_ok() {
            limit.current = limit.maximum;
        }
    }
    limit.current.unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_connections_over_the_limit_use_the_reserve() {
        let connections = Connections::new(4);
        let address = |n: u8| IpAddr::from([10, 0, 0, n]);
        let usual: Vec<Place> = (0..4).map(|n| connections.place(address(n))).collect();
        assert!(usual.iter().all(|place| !place.is_reserve()));
        let mut reserve: Vec<Place> =
            (0..=RESERVE).map(|_| connections.place(address(9))).collect();
        assert!(reserve.iter().all(Place::is_reserve));
        let is_evicted = |place: &mut Place| match place {
            Place::Reserve(evicted) => {
                evicted.try_recv() == Err(oneshot::error::TryRecvError::Closed)
            }
            Place::Usual(_) => false,
        };
        let evicted: Vec<bool> = reserve.iter_mut().map(is_evicted).collect();
        assert_eq!(evicted.iter().filter(|evicted| **evicted).count(), 1);
        assert!(evicted[0], "the oldest");
        drop(usual);
        assert_eq!(connections.used(), 0);
        assert!(!connections.place(address(9)).is_reserve());
    }
}
