//! The ids of all sessions in memory, so that a list can begin with the newest.
//!
//! The store only goes forwards. An id takes about 30 bytes: a million sessions 30 MB.

use std::collections::BTreeSet;
use std::ops::Bound;
use std::sync::{Mutex, MutexGuard, PoisonError};

use palpate_schemas::SessionOrder;
use uuid::Uuid;

/// The ids of all sessions, in the order of their creation.
#[derive(Default)]
pub(super) struct Ids(Mutex<BTreeSet<Uuid>>);

/// Part of the ids: those between two bounds, in an order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub(super) order: SessionOrder,
    pub(super) low: Bound<Uuid>,
    pub(super) high: Bound<Uuid>,
}

impl Range {
    /// The part behind an id, in the range's order.
    pub(super) fn behind(self, id: Uuid) -> Self {
        match self.order {
            SessionOrder::Oldest => Self { low: Bound::Excluded(id), ..self },
            SessionOrder::Newest => Self { high: Bound::Excluded(id), ..self },
        }
    }

    /// Whether nothing lies between the bounds. `BTreeSet::range` panics on such bounds.
    fn is_empty(self) -> bool {
        let (Bound::Included(low) | Bound::Excluded(low)) = self.low else { return false };
        let (Bound::Included(high) | Bound::Excluded(high)) = self.high else { return false };
        let both = matches!((self.low, self.high), (Bound::Included(_), Bound::Included(_)));
        low > high || (low == high && !both)
    }
}

impl Ids {
    pub(super) fn add(&self, id: Uuid) {
        self.lock().insert(id);
    }

    pub(super) fn remove(&self, id: Uuid) {
        self.lock().remove(&id);
    }

    /// Up to `limit` ids of a range, in its order.
    pub(super) fn page(&self, range: Range, limit: usize) -> Vec<Uuid> {
        if range.is_empty() {
            return Vec::new();
        }
        let ids = self.lock();
        let found = ids.range((range.low, range.high)).copied();
        match range.order {
            SessionOrder::Oldest => found.take(limit).collect(),
            SessionOrder::Newest => found.rev().take(limit).collect(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeSet<Uuid>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_go_on_behind_the_last_id_in_either_order() {
        let (ids, [a, b, c]) = (Ids::default(), [1, 2, 3].map(Uuid::from_u128));
        [c, a, b].into_iter().for_each(|id| ids.add(id));
        let all = |order| Range { order, low: Bound::Unbounded, high: Bound::Unbounded };
        let newest = all(SessionOrder::Newest);
        assert_eq!(ids.page(all(SessionOrder::Oldest), 2), [a, b]);
        assert_eq!(ids.page(newest, 2), [c, b]);
        assert_eq!(ids.page(newest.behind(b), 2), [a]);
        assert!(ids.page(newest.behind(a), 2).is_empty());
        let none = Range { low: Bound::Included(b), high: Bound::Excluded(b), ..newest };
        assert!(ids.page(none, 2).is_empty());
        ids.remove(b);
        assert_eq!(ids.page(newest, 9), [c, a]);
    }
}
