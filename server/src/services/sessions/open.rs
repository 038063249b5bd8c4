//! The open sessions: a limit on their number, with a share for each client, and their expiry.
//!
//! An expiry noted here is never too late, and may be too early: later readings and leases
//! are in the store, which is checked before a session ends.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use uuid::Uuid;

use crate::budget::{Budget, Holding, Over};
use crate::client::Client;

/// The open sessions, oldest first.
pub(super) struct Open {
    sessions: Mutex<BTreeMap<Uuid, Place>>,
    places: Arc<Budget>,
}

/// The slot of an open session.
struct Place {
    /// Earliest expiry (running time, ms); `None` for never.
    expires: Option<u64>,
    _holding: Holding,
}

/// Reason for which there is no slot for a new session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Full {
    /// All slots are taken; one is free again at this running time at the earliest.
    Total { max: usize, soonest_ms: Option<u64> },
    /// The client's share is: of all places this many are taken.
    Share { used: usize, max: usize },
}

impl Open {
    pub(super) fn new(max: usize) -> Self {
        Self { sessions: Mutex::default(), places: Budget::new(max) }
    }

    /// Takes a place for a new session, which counts to the share of the client that opens it.
    /// Programs on the server's own machine that are not asked for a key have no share: all of
    /// them are one address.
    pub(super) fn enter(
        &self,
        id: Uuid,
        expires: Option<u64>,
        client: Option<Client>,
    ) -> Result<(), Full> {
        let is_own =
            |client: &Client| matches!(client, Client::Address(address) if address.is_loopback());
        let client = client.filter(|client| !is_own(client));
        let mut sessions = self.lock();
        let max = self.places.total();
        let taken = self.places.take(client, 1);
        let holding = taken.map_err(|over| match over {
            Over::Total => {
                let soonest_ms = sessions.values().filter_map(|place| place.expires).min();
                Full::Total { max, soonest_ms }
            }
            Over::Share => Full::Share { used: self.places.used(), max },
        })?;
        sessions.insert(id, Place { expires, _holding: holding });
        Ok(())
    }

    /// Registers an open session, regardless of limits. After a restart the address of a
    /// client without a key is unknown: its session counts towards the total alone.
    pub(super) fn note(&self, id: Uuid, expires: Option<u64>, key: Option<Uuid>) {
        let mut sessions = self.lock();
        match sessions.get_mut(&id) {
            Some(place) => place.expires = expires,
            None => {
                let holding = self.places.note(key.map(Client::Key), 1);
                sessions.insert(id, Place { expires, _holding: holding });
            }
        }
    }

    pub(super) fn leave(&self, id: Uuid) {
        self.lock().remove(&id);
    }

    pub(super) fn contains(&self, id: Uuid) -> bool {
        self.lock().contains_key(&id)
    }

    pub(super) fn len(&self) -> usize {
        self.lock().len()
    }

    /// The sessions that may have expired.
    pub(super) fn due(&self, now: u64) -> Vec<Uuid> {
        let is_due = |place: &Place| place.expires.is_some_and(|expires| expires <= now);
        self.lock().iter().filter(|(_, place)| is_due(place)).map(|(id, _)| *id).collect()
    }

    /// Up to `limit` sessions after `after`, and whether there are more.
    pub(super) fn page(&self, after: Option<Uuid>, limit: usize) -> (Vec<Uuid>, bool) {
        let sessions = self.lock();
        let behind = sessions.keys().filter(|id| after.is_none_or(|after| **id > after));
        let mut page: Vec<Uuid> = behind.take(limit.saturating_add(1)).copied().collect();
        let more = page.len() > limit;
        page.truncate(limit);
        (page, more)
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Uuid, Place>> {
        self.sessions.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn id(n: u128) -> Uuid {
        Uuid::from_u128(n)
    }

    #[test]
    fn slots_are_limited_and_released() {
        let open = Open::new(2);
        open.enter(id(1), Some(70), None).unwrap();
        open.enter(id(2), Some(50), None).unwrap();
        assert_eq!(
            open.enter(id(3), None, None),
            Err(Full::Total { max: 2, soonest_ms: Some(50) })
        );
        assert_eq!((open.due(49), open.due(50)), (vec![], vec![id(2)]));
        open.leave(id(2));
        open.enter(id(3), None, None).unwrap();
        assert_eq!(open.due(u64::MAX), [id(1)], "the other never expires");
        open.note(id(4), None, None);
        assert_eq!(open.len(), 3, "what is open stays, whatever the bound");
    }

    #[test]
    fn pages_continue_where_the_last_ended() {
        let open = Open::new(5);
        for n in [3, 1, 2] {
            open.enter(id(n), None, None).unwrap();
        }
        assert_eq!(open.page(None, 2), (vec![id(1), id(2)], true));
        assert_eq!(open.page(Some(id(2)), 2), (vec![id(3)], false));
        assert_eq!(open.page(None, 3), (vec![id(1), id(2), id(3)], false));
    }

    #[test]
    fn a_key_holds_at_most_its_share() {
        let (open, [greedy, other]) = (Open::new(40), [1, 2].map(|key| Some(Client::Key(id(key)))));
        let n = (1..).take_while(|n| open.enter(id(*n), None, greedy).is_ok()).count();
        assert_eq!(n, 30, "three quarters");
        assert_eq!(open.enter(id(99), None, greedy), Err(Full::Share { used: 30, max: 40 }));
        open.enter(id(100), None, other).unwrap();
        // Sessions open before a restart count too.
        let again = Open::new(40);
        (1..=30).for_each(|n| again.note(id(n), Some(5), Some(id(1))));
        again.note(id(1), Some(6), Some(id(1)));
        assert_eq!(again.enter(id(99), None, greedy), Err(Full::Share { used: 30, max: 40 }));
        again.leave(id(1));
        again.enter(id(99), None, greedy).unwrap();
    }

    #[test]
    fn an_address_in_the_network_has_a_share_too() {
        let at = |address: [u8; 4]| Some(Client::at(address.into()));
        let open = Open::new(40);
        let greedy = at([10, 0, 0, 1]);
        let n = (1..).take_while(|n| open.enter(id(*n), None, greedy).is_ok()).count();
        assert_eq!(n, 30, "three quarters");
        open.enter(id(100), None, at([10, 0, 0, 2])).unwrap();
        let own = Open::new(40);
        let n = (1..).take_while(|n| own.enter(id(*n), None, at([127, 0, 0, 1])).is_ok()).count();
        assert_eq!(n, 40, "programs of this machine take all");
    }
}
