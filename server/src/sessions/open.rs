//! Which sessions are open: a bound on how many there are, and who is due to expire.
//!
//! An expiry noted here is never too late, and may be too early: readings and leases that come
//! later are in the store, which is asked before a session goes.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use uuid::Uuid;

/// The open sessions, oldest first, each with the time at which it expires at the earliest
/// (ms since 1970); `None` never does.
pub(super) struct Open {
    expiries: Mutex<BTreeMap<Uuid, Option<u64>>>,
    max: usize,
}

/// All places are taken; the first is free again at the earliest at this time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Full {
    pub(super) max: usize,
    pub(super) soonest_ms: Option<u64>,
}

impl Open {
    pub(super) fn new(max: usize) -> Self {
        Self { expiries: Mutex::new(BTreeMap::new()), max }
    }

    /// Takes a place for a new session.
    pub(super) fn enter(&self, id: Uuid, expires: Option<u64>) -> Result<(), Full> {
        let mut expiries = self.lock();
        if expiries.len() >= self.max {
            let soonest_ms = expiries.values().flatten().min().copied();
            return Err(Full { max: self.max, soonest_ms });
        }
        expiries.insert(id, expires);
        Ok(())
    }

    /// Notes a session that is open already, whatever the bound.
    pub(super) fn note(&self, id: Uuid, expires: Option<u64>) {
        self.lock().insert(id, expires);
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
        let is_due = |expires: &Option<u64>| expires.is_some_and(|expires| expires <= now);
        self.lock().iter().filter(|(_, expires)| is_due(expires)).map(|(id, _)| *id).collect()
    }

    /// Up to `limit` sessions behind `after`, and whether there are more.
    pub(super) fn page(&self, after: Option<Uuid>, limit: usize) -> (Vec<Uuid>, bool) {
        let expiries = self.lock();
        let behind = expiries.keys().filter(|id| after.is_none_or(|after| **id > after));
        let mut page: Vec<Uuid> = behind.take(limit.saturating_add(1)).copied().collect();
        let more = page.len() > limit;
        page.truncate(limit);
        (page, more)
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Uuid, Option<u64>>> {
        self.expiries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn id(n: u128) -> Uuid {
        Uuid::from_u128(n)
    }

    #[test]
    fn places_are_bounded_and_free_again() {
        let open = Open::new(2);
        open.enter(id(1), Some(70)).unwrap();
        open.enter(id(2), Some(50)).unwrap();
        assert_eq!(open.enter(id(3), None), Err(Full { max: 2, soonest_ms: Some(50) }));
        assert_eq!((open.due(49), open.due(50)), (vec![], vec![id(2)]));
        open.leave(id(2));
        open.enter(id(3), None).unwrap();
        assert_eq!(open.due(u64::MAX), [id(1)], "the other never expires");
        open.note(id(4), None);
        assert_eq!(open.len(), 3, "what is open stays, whatever the bound");
    }

    #[test]
    fn pages_go_on_where_the_last_ended() {
        let open = Open::new(5);
        for n in [3, 1, 2] {
            open.enter(id(n), None).unwrap();
        }
        assert_eq!(open.page(None, 2), (vec![id(1), id(2)], true));
        assert_eq!(open.page(Some(id(2)), 2), (vec![id(3)], false));
        assert_eq!(open.page(None, 3), (vec![id(1), id(2), id(3)], false));
    }
}
