//! Limits on connections: a total, in which those of strangers give way to newer ones.
//!
//! A connection is a stranger's until a request on it was admitted that not everybody may send
//! (`guard`). Strangers take what is free. When nothing is, the oldest connection of the client
//! with the most of them is closed for the next one, so neither one address nor many can close the
//! door: at least [`STRANGERS_SHARE`] of the total is never taken by others. The connections of
//! admitted clients are kept, within each client's share; one beyond it stays a stranger's.

use std::collections::{BTreeMap, HashMap};
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use crate::budget::{Budget, Holding};
use crate::client::Client;

/// Part of the total that admitted clients cannot take. Chosen: an eighth of the usual 4,096 are
/// 512 newcomers, each with milliseconds for its first request.
const STRANGERS_SHARE: usize = 8;

/// File descriptors reserved for the database, the log and the runtime, and for connections that
/// are being closed. Chosen: an idle server has about 20.
const OTHER_FILES: u64 = 40;

/// The connections of a server.
#[derive(Debug)]
pub(crate) struct Connections {
    total: usize,
    /// Those of admitted clients.
    admitted: Arc<Budget>,
    strangers: Mutex<Strangers>,
}

/// Connections by address, the oldest first.
#[derive(Debug, Default)]
struct Strangers {
    by_client: HashMap<Client, BTreeMap<u64, Arc<Notify>>>,
    n: usize,
    next: u64,
}

/// The place of one connection, given back on drop.
#[derive(Debug)]
pub(crate) struct Place {
    connections: Arc<Connections>,
    address: Client,
    number: u64,
    evicted: Arc<Notify>,
    admitted: Mutex<Option<Holding>>,
}

impl Connections {
    /// At most `total` connections, and no more than the system has file descriptors for.
    pub(crate) fn new(total: usize) -> Arc<Self> {
        let files = files_max().saturating_sub(OTHER_FILES);
        let total = total.min(usize::try_from(files).unwrap_or(usize::MAX)).max(2);
        let admitted = Budget::new(total - total.div_ceil(STRANGERS_SHARE));
        Arc::new(Self { total, admitted, strangers: Mutex::default() })
    }

    /// A place for a connection from an address.
    pub(crate) fn place(self: &Arc<Self>, address: IpAddr) -> Arc<Place> {
        let (address, evicted) = (Client::at(address), Arc::new(Notify::new()));
        let mut strangers = self.strangers();
        while strangers.n + self.admitted.used() >= self.total && strangers.evict() {
            metrics::counter!("palpate_connections_displaced_total").increment(1);
        }
        let number = strangers.next;
        strangers.next += 1;
        strangers.n += 1;
        strangers.by_client.entry(address).or_default().insert(number, Arc::clone(&evicted));
        drop(strangers);
        let (connections, admitted) = (Arc::clone(self), Mutex::default());
        Arc::new(Place { connections, address, number, evicted, admitted })
    }

    /// Number of connections.
    pub(crate) fn used(&self) -> usize {
        self.admitted.used() + self.strangers().n
    }

    /// Maximum number of connections.
    pub(crate) fn total(&self) -> usize {
        self.total
    }

    fn strangers(&self) -> MutexGuard<'_, Strangers> {
        self.strangers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Strangers {
    /// Closes the oldest connection of the client with the most; `false` when there is none.
    fn evict(&mut self) -> bool {
        let first = |places: &BTreeMap<u64, _>| places.first_key_value().map_or(0, |(n, _)| *n);
        let most = self
            .by_client
            .iter()
            .max_by_key(|(_, places)| (places.len(), std::cmp::Reverse(first(places))));
        let Some((client, oldest)) = most.map(|(client, places)| (*client, first(places))) else {
            return false;
        };
        let evicted = self.remove(client, oldest);
        evicted.inspect(|evicted| evicted.notify_one()).is_some()
    }

    fn remove(&mut self, client: Client, number: u64) -> Option<Arc<Notify>> {
        let places = self.by_client.get_mut(&client)?;
        let removed = places.remove(&number)?;
        if places.is_empty() {
            self.by_client.remove(&client);
        }
        self.n -= 1;
        Some(removed)
    }
}

impl Place {
    /// Keeps the connection for a client that was admitted, if its share has room.
    pub(crate) fn admit(&self, client: Client) {
        let mut admitted = self.admitted.lock().unwrap_or_else(PoisonError::into_inner);
        if admitted.is_some() {
            return;
        }
        let mut strangers = self.connections.strangers();
        if let Ok(holding) = self.connections.admitted.take(Some(client), 1)
            && strangers.remove(self.address, self.number).is_some()
        {
            *admitted = Some(holding);
        }
    }

    /// Resolves when a newer connection needs this place.
    pub(crate) async fn evicted(&self) {
        self.evicted.notified().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.connections.strangers().remove(self.address, self.number);
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
    use futures::FutureExt as _;
    use uuid::Uuid;

    use super::*;

    const KEY: Client = Client::Key(Uuid::from_u128(1));

    fn is_open(place: &Arc<Place>) -> bool {
        place.evicted().now_or_never().is_none()
    }

    /// `n` connections from addresses in turn; those that were closed for newer ones are dropped.
    fn fill(connections: &Arc<Connections>, addresses: &[IpAddr], n: usize) -> Vec<Arc<Place>> {
        let addresses = addresses.iter().cycle().take(n);
        let mut open: Vec<_> = addresses.map(|address| connections.place(*address)).collect();
        open.retain(is_open);
        open
    }

    /// Checks that a robot gets a place and keeps it while strangers at some addresses come.
    #[track_caller]
    fn check(addresses: &[IpAddr]) {
        let connections = Connections::new(64);
        let _before = fill(&connections, addresses, 2 * 64);
        assert_eq!(connections.used(), 64);
        let robot = connections.place([192_u8, 168, 0, 9].into());
        // Time for its first request, in which others come.
        let _meanwhile = fill(&connections, addresses, 64 / STRANGERS_SHARE - 1);
        assert!(is_open(&robot), "{addresses:?}");
        robot.admit(KEY);
        let _after = fill(&connections, addresses, 10 * 64);
        assert!(is_open(&robot), "{addresses:?}");
        assert_eq!(connections.used(), 64);
    }

    #[test]
    fn strangers_at_any_number_of_addresses_give_way() {
        let v4 = |n: u32| IpAddr::from((0x0a00_0000 + n).to_be_bytes());
        let v6 = |n: u16, host: u16| IpAddr::from([0x2001, 0xdb8, 7, n, 0, 0, 0, host]);
        for n in [1, 7, 64, 500] {
            check(&(0..n).map(v4).collect::<Vec<_>>());
            check(&(0..n as u16).map(|n| v6(n, 1)).collect::<Vec<_>>());
            // Many addresses of one network are one client.
            check(&(0..n as u16).map(|host| v6(0, host)).collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_client_with_the_most_gives_way_first() {
        let connections = Connections::new(16);
        let network = |host: u16| IpAddr::from([0x2001, 0xdb8, 0, 0, 0, 0, 0, host]);
        let first = connections.place([10_u8, 0, 0, 1].into());
        let many: Vec<_> = (0..15).map(|host| connections.place(network(host))).collect();
        let _newer = connections.place([10_u8, 0, 0, 2].into());
        assert!(is_open(&first), "older, but alone in its network");
        let open: Vec<bool> = many.iter().map(is_open).collect();
        assert_eq!(open.iter().position(|open| !open), Some(0), "the oldest");
        assert_eq!(open.iter().filter(|open| !**open).count(), 1);
    }

    #[test]
    fn admitted_clients_leave_room_for_strangers() {
        let connections = Connections::new(64);
        let mut held = Vec::new();
        for n in 0..200 {
            let place = connections.place([10_u8, 0, 0, 1].into());
            place.admit(Client::Key(Uuid::from_u128(n)));
            held.push(place);
        }
        let strangers = fill(&connections, &[[10_u8, 0, 0, 2].into()], 20);
        let kept = 64 - 64 / STRANGERS_SHARE;
        assert!(held[..kept].iter().all(is_open));
        assert!(held[kept..].iter().filter(|place| is_open(place)).count() < 8);
        assert_eq!(connections.used(), 64);
        drop((held, strangers));
        assert_eq!(connections.used(), 0);
    }
}
