//! Webhooks on servers that share a store: one of them sends, and another takes over when it is
//! gone. All of them store events, and know the deliveries of all.

use std::time::{Duration, Instant};

use palpate_store::engine::lease::Lease;
use palpate_store::error::StoreError;
use uuid::Uuid;

use super::registry::{Entry, Known};
use super::{Webhooks, stored};
use crate::clock::now_ms;

/// Interval at which a server tries to become the one that sends. Chosen: a fraction of the time
/// for which a server that died still counts as that one.
pub(super) const TAKE_EVERY: Duration = Duration::from_secs(2);

/// The right to send.
#[derive(Debug, Default)]
pub(super) struct Right {
    lease: Option<Lease>,
    tried: Option<Instant>,
}

impl Right {
    /// Whether another server may have it.
    pub(super) fn is_missing(&self) -> bool {
        self.lease.as_ref().is_none_or(Lease::is_lost)
    }
}

impl Webhooks {
    /// Whether this server sends. One that begins to do so takes up what is left over.
    pub(super) async fn sends(&self, right: &mut Right) -> bool {
        if !right.is_missing() {
            return true;
        }
        if right.tried.is_some_and(|tried| tried.elapsed() < TAKE_EVERY) {
            return false;
        }
        (right.lease, right.tried) = (None, Some(Instant::now()));
        match self.store.lease("sending to webhooks").await {
            Ok(lease) => right.lease = lease,
            Err(error) => tracing::warn!("Cannot find out who sends to webhooks: {error}"),
        }
        if right.is_missing() {
            return false;
        }
        if let Err(error) = self.recover().await {
            tracing::error!("Cannot take up the deliveries of webhooks: {error}");
        }
        true
    }

    /// Looks again at a webhook that another server changed.
    pub(crate) async fn heard(&self, id: Uuid) -> Result<(), StoreError> {
        let _changing = self.changing.lock().await;
        let found = self.store.webhooks().find(id)?;
        self.write(|registry| match found {
            Some(webhook) => match registry.0.get_mut(&id) {
                Some(known) => known.webhook = webhook,
                None => drop(registry.0.insert(id, Known::new(webhook))),
            },
            None => drop(registry.0.remove(&id)),
        });
        self.changed.send_replace(());
        Ok(())
    }

    /// Looks again at a delivery that another server changed.
    pub(crate) async fn heard_delivery(&self, id: Uuid, event: Uuid) -> Result<(), StoreError> {
        let _changing = self.changing.lock().await;
        let found = self.store.deliveries().find(id, event)?;
        let running = self.store.running(now_ms());
        self.write(|registry| {
            let Some(known) = registry.0.get_mut(&id) else { return };
            match &found {
                Some(delivery) => known.entries.insert(event, Entry::of(delivery, &running)),
                None => known.entries.remove(&event),
            };
        });
        self.changed.send_replace(());
        Ok(())
    }

    /// Looks again at what was announced of a session.
    pub(crate) fn heard_notice(&self, session: Uuid) -> Result<(), StoreError> {
        match self.store.deliveries().notice(session)? {
            Some(notice) => self.notices.set_announced(notice),
            None => self.notices.forget(session),
        }
        Ok(())
    }

    /// Looks again at everything.
    pub(crate) async fn heard_all(&self) -> Result<(), StoreError> {
        let _changing = self.changing.lock().await;
        let mut found = stored(&self.store, &self.notices)?;
        self.write(|registry| {
            for (id, known) in &mut found.0 {
                if let Some(before) = registry.0.remove(id) {
                    known.in_flight = before.in_flight;
                }
            }
            *registry = found;
        });
        self.changed.send_replace(());
        Ok(())
    }
}
