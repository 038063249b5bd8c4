//! The history of deliveries: what was sent and what waits, test messages, and deliveries that are
//! made again.

use std::time::Duration;

use palpate_schemas as wire;
use palpate_store::error::StoreError;
use palpate_store::webhook::{Delivery, DeliveryState, EventKind};
use uuid::Uuid;

use super::announce::pending;
use super::error::WebhookError;
use super::registry::{Entry, Known};
use super::{Webhooks, count_end};
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::wire::webhook::{body, delivery as shown};
use crate::wire::{cursor, page_id, page_length};

/// Time for which a test waits for its outcome. Chosen: an attempt ends after 10 s.
const TEST_PATIENCE: Duration = Duration::from_secs(15);

impl Webhooks {
    /// Sends a test message, and returns the outcome of its only attempt; without one in time it
    /// is still pending.
    pub(crate) async fn test(&self, id: &str) -> Result<wire::WebhookDelivery, WebhookError> {
        let (id, event, now) = (self.id(id)?, Uuid::now_v7(), now_ms());
        let data = wire::WebhookEventData::default();
        let ping = pending(id, event, (EventKind::Ping, None), now, || {
            body(event, EventKind::Ping, now, data)
        });
        let mut changed = self.changed.subscribe();
        {
            let _changing = self.changing.lock().await;
            self.enabled(id)?;
            self.add(vec![ping], None).await?;
        }
        let outcome = async {
            loop {
                let delivery = self.find(id, event)?;
                if delivery.state != DeliveryState::Pending || changed.changed().await.is_err() {
                    return Ok(delivery);
                }
            }
        };
        let delivery: Delivery = match tokio::time::timeout(TEST_PATIENCE, outcome).await {
            Ok(outcome) => outcome.map_err(|cause: Cause| cause)?,
            Err(_) => self.find(id, event)?,
        };
        Ok(shown(&delivery))
    }

    /// A page of a webhook's deliveries, newest event first.
    pub(crate) fn deliveries(
        &self,
        id: &str,
        query: &wire::PageQuery,
    ) -> Result<wire::WebhookDeliveryPage, Cause> {
        let (id, before, limit) = (self.id(id)?, page_id(query)?, page_length(query)?);
        let mut events: Vec<Uuid> = self.read(|registry| {
            let entries = registry.0.get(&id).map(|known| known.entries.keys().rev());
            let older = entries.into_iter().flatten().copied();
            older
                .filter(|event| before.is_none_or(|before| *event < before))
                .take(limit + 1)
                .collect()
        });
        let more = events.len() > limit;
        events.truncate(limit);
        let mut items = Vec::with_capacity(events.len());
        for event in &events {
            // A missing one has left the history in the meantime.
            items.extend(self.store.deliveries().find(id, *event)?.as_ref().map(shown));
        }
        let next = events.last().filter(|_| more).copied();
        Ok(wire::WebhookDeliveryPage { items, next_cursor: cursor(next) })
    }

    pub(crate) fn delivery(&self, id: &str, event: &str) -> Result<wire::WebhookDelivery, Cause> {
        let (id, event) = (self.id(id)?, event_id(event)?);
        Ok(shown(&self.find(id, event)?))
    }

    /// Makes a delivery due again, with all its attempts.
    pub(crate) async fn redeliver(
        &self,
        id: &str,
        event: &str,
    ) -> Result<wire::WebhookDelivery, WebhookError> {
        let (id, event) = (self.id(id)?, event_id(event)?);
        let _changing = self.changing.lock().await;
        self.enabled(id)?;
        let is_in_flight = |known: &Known| known.in_flight.contains(&event);
        if self.read(|registry| registry.0.get(&id).is_some_and(is_in_flight)) {
            return Err(WebhookError::InFlight { event });
        }
        let delivery = Delivery {
            state: DeliveryState::Pending,
            n_failed: 0,
            next_at_ms: Some(now_ms()),
            ..self.find(id, event)?
        };
        self.settle(&delivery).await?;
        Ok(shown(&delivery))
    }

    /// Abandons the deliveries of a webhook that wait.
    pub(super) async fn abandon_waiting(&self, id: Uuid) -> Result<(), StoreError> {
        let waiting: Vec<Uuid> = self.read(|registry| {
            let entries = registry.0.get(&id).map(|known| known.entries.iter());
            let entries = entries.into_iter().flatten();
            entries.filter(|(_, entry)| entry.is_waiting()).map(|(event, _)| *event).collect()
        });
        for event in waiting {
            let Some(delivery) = self.store.deliveries().find(id, event)? else { continue };
            let state = DeliveryState::Abandoned;
            self.settle(&Delivery { state, next_at_ms: None, ..delivery }).await?;
            count_end("abandoned");
        }
        Ok(())
    }

    /// Stores the state of a delivery, then applies it.
    pub(super) async fn settle(&self, delivery: &Delivery) -> Result<(), StoreError> {
        self.store.deliveries().update(delivery).await?;
        let running = self.store.running(now_ms());
        self.write(|registry| {
            if let Some(known) = registry.0.get_mut(&delivery.webhook) {
                known.entries.insert(delivery.event, Entry::of(delivery, &running));
            }
        });
        self.changed.send_replace(());
        Ok(())
    }

    fn find(&self, id: Uuid, event: Uuid) -> Result<Delivery, Cause> {
        let found = self.store.deliveries().find(id, event)?;
        found.ok_or_else(|| Cause::unknown("delivery", event))
    }
}

fn event_id(text: &str) -> Result<Uuid, Cause> {
    Uuid::try_parse(text).map_err(|_| Cause::unknown("delivery", text))
}
