//! Webhooks and the states of their deliveries, in memory: which are due, and which are evicted.

use std::collections::{BTreeMap, BTreeSet};

use palpate_store::webhook::{Delivery, DeliveryState, EventKind, Webhook};
use uuid::Uuid;

/// Deliveries kept per webhook, waiting ones included. Chosen: bounds the disk of 32 webhooks.
pub(super) const DELIVERIES_MAX: usize = 200;
/// Attempts in flight per webhook, so that a slow receiver delays only itself. Chosen.
const AT_ONCE: usize = 4;

/// All webhooks.
#[derive(Default)]
pub(super) struct Registry(pub(super) BTreeMap<Uuid, Known>);

/// A webhook and its deliveries.
pub(super) struct Known {
    pub(super) webhook: Webhook,
    /// By event.
    pub(super) entries: BTreeMap<Uuid, Entry>,
    pub(super) in_flight: BTreeSet<Uuid>,
}

/// What is known of a delivery without reading it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) state: DeliveryState,
    pub(super) created_at_ms: u64,
    pub(super) next_at_ms: Option<u64>,
    /// Time of the last attempt.
    pub(super) tried_at_ms: Option<u64>,
}

impl Entry {
    pub(super) fn of(delivery: &Delivery) -> Self {
        Self {
            state: delivery.state,
            created_at_ms: delivery.created_at_ms,
            next_at_ms: delivery.next_at_ms,
            tried_at_ms: delivery.attempts.last().map(|attempt| attempt.at_ms),
        }
    }

    pub(super) fn is_waiting(&self) -> bool {
        matches!(self.state, DeliveryState::Pending | DeliveryState::Failed)
    }
}

impl Known {
    pub(super) fn new(webhook: Webhook) -> Self {
        Self { webhook, entries: BTreeMap::new(), in_flight: BTreeSet::new() }
    }

    /// Whether it receives an event of a time (ms since 1970).
    pub(super) fn takes(&self, kind: EventKind, at_ms: u64) -> bool {
        self.wants(kind) && at_ms >= self.webhook.since_ms
    }

    /// Whether it receives events of a kind.
    pub(super) fn wants(&self, kind: EventKind) -> bool {
        self.webhook.is_enabled && self.webhook.events.contains(&kind)
    }

    /// Whether an event is older than everything in a full history, which may have evicted it.
    pub(super) fn may_have_evicted(&self, event: Uuid) -> bool {
        let is_full = self.entries.len() >= DELIVERIES_MAX;
        let oldest = self.entries.keys().next().filter(|_| is_full);
        oldest.is_some_and(|oldest| event < *oldest)
    }

    /// The delivery that a new one evicts: the oldest that does not wait, else the oldest.
    pub(super) fn next_evicted(&self) -> Option<(Uuid, Entry)> {
        if self.entries.len() < DELIVERIES_MAX {
            return None;
        }
        let idle = self.entries.iter().filter(|(event, _)| !self.in_flight.contains(event));
        let found = idle.min_by_key(|(event, entry)| (entry.is_waiting(), **event));
        found.map(|(event, entry)| (*event, *entry))
    }

    /// The events whose next attempt is due, as many as may begin, oldest first.
    fn due(&self, now: u64) -> Vec<Uuid> {
        let room = AT_ONCE.saturating_sub(self.in_flight.len());
        let mut due: Vec<(u64, Uuid)> = self
            .entries
            .iter()
            .filter(|(event, _)| !self.in_flight.contains(event))
            .filter_map(|(event, entry)| Some((entry.next_at_ms?, *event)))
            .filter(|(at, _)| *at <= now)
            .collect();
        due.sort_unstable();
        due.into_iter().take(room).map(|(_, event)| event).collect()
    }

    /// Time of the next attempt that could begin.
    fn next_at(&self) -> Option<u64> {
        let idle = self.entries.iter().filter(|(event, _)| !self.in_flight.contains(event));
        let has_room = self.in_flight.len() < AT_ONCE;
        idle.filter_map(|(_, entry)| entry.next_at_ms).min().filter(|_| has_room)
    }
}

impl Registry {
    /// Marks the deliveries that are due as in flight, and returns them.
    pub(super) fn begin(&mut self, now: u64) -> Vec<(Uuid, Uuid)> {
        let mut begun = Vec::new();
        for (id, known) in &mut self.0 {
            for event in known.due(now) {
                known.in_flight.insert(event);
                begun.push((*id, event));
            }
        }
        begun
    }

    /// Time of the next attempt of all (ms since 1970).
    pub(super) fn next_at(&self) -> Option<u64> {
        self.0.values().filter_map(Known::next_at).min()
    }

    /// Creation of the oldest delivery that waits (ms since 1970).
    pub(super) fn oldest_waiting(&self) -> Option<u64> {
        let entries = self.0.values().flat_map(|known| known.entries.values());
        entries.filter(|entry| entry.is_waiting()).map(|entry| entry.created_at_ms).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(entries: impl IntoIterator<Item = (u128, DeliveryState, Option<u64>)>) -> Known {
        let webhook = Webhook {
            id: Uuid::from_u128(1),
            url: String::new(),
            description: String::new(),
            events: vec![EventKind::SessionDecided],
            secret: Vec::new(),
            previous: None,
            is_enabled: true,
            disabled_because: None,
            created_at_ms: 0,
            updated_at_ms: 0,
            since_ms: 50,
            failing_since_ms: None,
        };
        let entry = |(event, state, next_at_ms): (u128, _, _)| {
            let created_at_ms = event as u64;
            let entry = Entry { state, created_at_ms, next_at_ms, tried_at_ms: None };
            (Uuid::from_u128(event), entry)
        };
        Known { entries: entries.into_iter().map(entry).collect(), ..Known::new(webhook) }
    }

    #[test]
    fn at_most_four_attempts_to_a_webhook_are_under_way() {
        let all = (1..=6).map(|event| (event, DeliveryState::Pending, Some(100 - event as u64)));
        let mut registry = Registry::default();
        registry.0.insert(Uuid::from_u128(1), known(all));
        assert_eq!(registry.begin(93), []);
        assert_eq!(registry.next_at(), Some(94));
        let begun: Vec<u128> =
            registry.begin(200).iter().map(|(_, event)| event.as_u128()).collect();
        assert_eq!(begun, [6, 5, 4, 3]);
        assert_eq!((registry.begin(200), registry.next_at()), (vec![], None));
        assert_eq!(registry.oldest_waiting(), Some(1));
    }

    #[test]
    fn finished_deliveries_give_way_before_waiting_ones() {
        let state = |event| match event {
            1 => DeliveryState::Failed,
            _ => DeliveryState::Delivered,
        };
        let all = (1..=DELIVERIES_MAX as u128).map(|event| (event, state(event), None));
        let mut full = known(all);
        assert_eq!(full.next_evicted().unwrap().0, Uuid::from_u128(2));
        assert!(full.may_have_evicted(Uuid::from_u128(0)));
        assert!(!full.may_have_evicted(Uuid::from_u128(1000)));
        full.entries.remove(&Uuid::from_u128(9));
        assert!(full.next_evicted().is_none() && !full.may_have_evicted(Uuid::from_u128(0)));
    }

    #[test]
    fn only_events_since_a_webhook_began_are_for_it() {
        let it = known([]);
        assert!(it.takes(EventKind::SessionDecided, 50));
        assert!(!it.takes(EventKind::SessionDecided, 49));
        assert!(!it.takes(EventKind::SnapshotMade, 50));
    }
}
