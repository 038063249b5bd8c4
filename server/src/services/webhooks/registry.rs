//! Webhooks and the states of their deliveries, in memory: which are due, and which are evicted.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use palpate_store::running::Running;
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
    pub(super) share: Share,
    pub(super) state: DeliveryState,
    pub(super) created_at_ms: u64,
    pub(super) next_at_ms: Option<u64>,
    /// The same as a running time: a clock that is set back delays nothing.
    next_ran_ms: Option<u64>,
    /// Time of the last attempt.
    pub(super) tried_at_ms: Option<u64>,
}

/// The deliveries that share a part of a history: those of events of one kind that one key caused.
pub(super) type Share = (EventKind, Option<Uuid>);

/// A moment by the clock (ms since 1970), and its running time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) clock_ms: u64,
    pub(super) ran_ms: u64,
}

impl Entry {
    pub(super) fn of(delivery: &Delivery, running: &Running) -> Self {
        let attempt = delivery.attempts.last();
        let begun = |next: u64| {
            let ended = attempt.map(|it| it.at_ms.saturating_add(u64::from(it.took_ms)));
            ended.unwrap_or(delivery.created_at_ms).min(next)
        };
        let next_ran_ms = delivery.next_at_ms.map(|next| {
            let begun = begun(next);
            running.at(begun).saturating_add(next - begun)
        });
        Self {
            share: (delivery.kind, delivery.caused_by),
            state: delivery.state,
            created_at_ms: delivery.created_at_ms,
            next_at_ms: delivery.next_at_ms,
            next_ran_ms,
            tried_at_ms: attempt.map(|attempt| attempt.at_ms),
        }
    }

    pub(super) fn is_waiting(&self) -> bool {
        matches!(self.state, DeliveryState::Pending | DeliveryState::Failed)
    }

    /// Puts the next attempt off, if one follows.
    pub(super) fn put_off(&mut self, pause_ms: u64, now: Moment) {
        self.next_at_ms = self.next_at_ms.map(|_| now.clock_ms + pause_ms);
        self.next_ran_ms = self.next_ran_ms.map(|_| now.ran_ms + pause_ms);
    }

    /// Time until the next attempt, ms.
    fn rest_ms(&self, now: Moment) -> Option<u64> {
        let by_clock = self.next_at_ms?.saturating_sub(now.clock_ms);
        Some(by_clock.min(self.next_ran_ms?.saturating_sub(now.ran_ms)))
    }
}

impl Known {
    pub(super) fn new(webhook: Webhook) -> Self {
        Self { webhook, entries: BTreeMap::new(), in_flight: BTreeSet::new() }
    }

    /// Whether it receives an event of a time (ms since 1970). A webhook from the future was made
    /// while the clock was ahead.
    pub(super) fn takes(&self, kind: EventKind, at_ms: u64, now_ms: u64) -> bool {
        let since_ms = self.webhook.since_ms;
        self.wants(kind) && (at_ms >= since_ms || since_ms > now_ms)
    }

    /// Whether it receives events of a kind.
    pub(super) fn wants(&self, kind: EventKind) -> bool {
        self.webhook.is_enabled && self.webhook.events.contains(&kind)
    }

    /// Whether an event is older than everything of its share in a full history, which may have
    /// evicted it.
    pub(super) fn may_have_evicted(&self, share: Share, event: Uuid) -> bool {
        let is_full = self.entries.len() >= DELIVERIES_MAX;
        let mut alike = self.entries.iter().filter(|(_, entry)| entry.share == share);
        is_full && alike.next().is_some_and(|(oldest, _)| event < *oldest)
    }

    /// The delivery that a new one evicts. The share that has most gives way, so that no key
    /// displaces events of others, nor one kind of event another: the oldest that does not wait,
    /// else the oldest.
    pub(super) fn next_evicted(&self, new: Share) -> Option<(Uuid, Entry)> {
        if self.entries.len() < DELIVERIES_MAX {
            return None;
        }
        let mut sizes: BTreeMap<Share, usize> = BTreeMap::from([(new, 1)]);
        for entry in self.entries.values() {
            *sizes.entry(entry.share).or_default() += 1;
        }
        let idle = self.entries.iter().filter(|(event, _)| !self.in_flight.contains(event));
        let found = idle.min_by_key(|(event, entry)| {
            (Reverse(sizes[&entry.share]), entry.share != new, entry.is_waiting(), **event)
        });
        found.map(|(event, entry)| (*event, *entry))
    }

    /// The events whose next attempt is due, as many as may begin, oldest first.
    fn due(&self, now: Moment) -> Vec<Uuid> {
        let room = AT_ONCE.saturating_sub(self.in_flight.len());
        let mut due: Vec<(Option<u64>, Uuid)> = self
            .entries
            .iter()
            .filter(|(event, _)| !self.in_flight.contains(event))
            .filter(|(_, entry)| entry.rest_ms(now) == Some(0))
            .map(|(event, entry)| (entry.next_at_ms, *event))
            .collect();
        due.sort_unstable();
        due.into_iter().take(room).map(|(_, event)| event).collect()
    }

    /// Time until the next attempt that could begin, ms.
    fn rest_ms(&self, now: Moment) -> Option<u64> {
        let idle = self.entries.iter().filter(|(event, _)| !self.in_flight.contains(event));
        let has_room = self.in_flight.len() < AT_ONCE;
        idle.filter_map(|(_, entry)| entry.rest_ms(now)).min().filter(|_| has_room)
    }
}

impl Registry {
    /// Marks the deliveries that are due as in flight, and returns them.
    pub(super) fn begin(&mut self, now: Moment) -> Vec<(Uuid, Uuid)> {
        let mut begun = Vec::new();
        for (id, known) in &mut self.0 {
            for event in known.due(now) {
                known.in_flight.insert(event);
                begun.push((*id, event));
            }
        }
        begun
    }

    /// Time until the next attempt of all, ms.
    pub(super) fn rest_ms(&self, now: Moment) -> Option<u64> {
        self.0.values().filter_map(|known| known.rest_ms(now)).min()
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

    fn at(ms: u64) -> Moment {
        Moment { clock_ms: ms, ran_ms: ms }
    }

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
            let entry = Entry {
                share: (EventKind::SessionDecided, None),
                state,
                created_at_ms: event as u64,
                next_at_ms,
                next_ran_ms: next_at_ms,
                tried_at_ms: None,
            };
            (Uuid::from_u128(event), entry)
        };
        Known { entries: entries.into_iter().map(entry).collect(), ..Known::new(webhook) }
    }

    #[test]
    fn at_most_four_attempts_to_a_webhook_are_under_way() {
        let all = (1..=6).map(|event| (event, DeliveryState::Pending, Some(100 - event as u64)));
        let mut registry = Registry::default();
        registry.0.insert(Uuid::from_u128(1), known(all));
        assert_eq!(registry.begin(at(93)), []);
        assert_eq!(registry.rest_ms(at(93)), Some(1));
        let begun: Vec<u128> =
            registry.begin(at(200)).iter().map(|(_, event)| event.as_u128()).collect();
        assert_eq!(begun, [6, 5, 4, 3]);
        assert_eq!((registry.begin(at(200)), registry.rest_ms(at(200))), (vec![], None));
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
        let share = (EventKind::SessionDecided, None);
        assert_eq!(full.next_evicted(share).unwrap().0, Uuid::from_u128(2));
        assert!(full.may_have_evicted(share, Uuid::from_u128(0)));
        assert!(!full.may_have_evicted(share, Uuid::from_u128(1000)));
        let other = (EventKind::TrainingFinished, None);
        assert!(!full.may_have_evicted(other, Uuid::from_u128(0)));
        full.entries.remove(&Uuid::from_u128(9));
        assert!(full.next_evicted(share).is_none());
        assert!(!full.may_have_evicted(share, Uuid::from_u128(0)));
    }

    /// Adds a delivery that waits, as `add` does.
    fn push(known: &mut Known, event: u128, share: Share) {
        if let Some((evicted, _)) = known.next_evicted(share) {
            known.entries.remove(&evicted);
        }
        let state = DeliveryState::Pending;
        let (next_at_ms, next_ran_ms) = (Some(0), Some(0));
        let entry =
            Entry { share, state, created_at_ms: 0, next_at_ms, next_ran_ms, tried_at_ms: None };
        known.entries.insert(Uuid::from_u128(event), entry);
    }

    /// Every pair of a kind and a key floods a webhook that waits for one event of every other.
    #[test]
    fn no_key_and_no_kind_displaces_events_of_another() {
        let kinds = [
            EventKind::Ping,
            EventKind::SessionDecided,
            EventKind::SessionUnknown,
            EventKind::SessionNeedsAttention,
            EventKind::TrainingFinished,
            EventKind::SnapshotMade,
            EventKind::SnapshotFailed,
        ];
        let keys = [None, Some(Uuid::from_u128(7)), Some(Uuid::from_u128(8))];
        let shares: Vec<Share> =
            kinds.iter().flat_map(|kind| keys.map(|key| (*kind, key))).collect();
        for flood in &shares {
            let mut it = known([]);
            for (event, share) in (1..).zip(&shares) {
                push(&mut it, event, *share);
            }
            (1000..3000).for_each(|event| push(&mut it, event, *flood));
            assert_eq!(it.entries.len(), DELIVERIES_MAX);
            for (event, share) in (1..).zip(&shares).filter(|(_, share)| *share != flood) {
                assert!(it.entries.contains_key(&Uuid::from_u128(event)), "{share:?} by {flood:?}");
            }
        }
    }

    /// A key floods a webhook that has an older event of another key.
    #[test]
    fn events_that_a_key_displaced_itself_stay_away() {
        let [mine, others] =
            [7, 8].map(|key| (EventKind::TrainingFinished, Some(Uuid::from_u128(key))));
        let mut it = known([]);
        push(&mut it, 1, others);
        (2..500).for_each(|event| push(&mut it, event, mine));
        let gone: Vec<u128> =
            (2..500).filter(|event| !it.entries.contains_key(&Uuid::from_u128(*event))).collect();
        assert_eq!(gone.len(), 299);
        let stays_away = |event: &u128| it.may_have_evicted(mine, Uuid::from_u128(*event));
        assert!(gone.iter().all(stays_away), "{gone:?}");
        assert!(!stays_away(&500));
    }

    #[test]
    fn a_clock_that_is_set_back_delays_no_attempt() {
        let mut registry = Registry::default();
        let pending = (1, DeliveryState::Failed, Some(1_000_000));
        registry.0.insert(Uuid::from_u128(1), known([pending]));
        let back = |ran_ms| Moment { clock_ms: 5, ran_ms };
        assert_eq!(registry.rest_ms(back(999_000)), Some(1000));
        assert_eq!(registry.begin(back(1_000_000)).len(), 1);
    }

    #[test]
    fn only_events_since_a_webhook_began_are_for_it() {
        let it = known([]);
        assert!(it.takes(EventKind::SessionDecided, 50, 60));
        assert!(!it.takes(EventKind::SessionDecided, 49, 60));
        assert!(!it.takes(EventKind::SnapshotMade, 50, 60));
        assert!(it.takes(EventKind::SessionDecided, 40, 40), "it was made while a clock was ahead");
    }
}
