//! The worker: stores the deliveries of new events, and makes the attempts that are due.
//!
//! At most four attempts to each webhook are in flight, each for at most ten seconds, so that
//! their number is bounded and a slow receiver delays only itself.

use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_store::error::StoreError;
use palpate_store::webhook::{Attempt, Delivery, DeliveryState, EventKind, Webhook};
use tokio::sync::watch;
use tokio::task::JoinSet;
use uuid::Uuid;

use super::backoff::pause;
use super::elsewhere::{Right, TAKE_EVERY};
use super::sender::{Message, Sent};
use super::{GONE, Webhooks, count_end};
use crate::clock::{self, now_ms};

/// Longest wait between two looks at what is due, because the machine's clock may be set. Chosen.
const LOOK_EVERY: Duration = Duration::from_secs(30);
/// Pause after a failure of the store. Chosen.
const STORE_PAUSE: Duration = Duration::from_secs(1);
/// Pause before the next attempt where the outcome of the last could not be stored, ms. Chosen.
const UNSTORED_PAUSE_MS: u64 = 60_000;
/// Time for attempts in flight to end when the server stops. The next start repeats the others.
/// Chosen: well within the patience of a stop.
const STOP_PATIENCE: Duration = Duration::from_secs(3);
/// Attempts kept in the history of a delivery. Chosen: two rounds of all retries.
const ATTEMPTS_MAX: usize = 20;
/// Status of a receiver that wants no more.
const STATUS_GONE: u16 = 410;

impl Webhooks {
    /// Announces events and delivers them until the server stops.
    pub(crate) async fn work(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        let (mut right, is_shared) = (Right::default(), self.store.is_shared());
        let mut sending = JoinSet::new();
        let mut changed = self.changed.subscribe();
        while !*stopping.borrow() {
            changed.borrow_and_update();
            if let Err(error) = self.announce(self.notices.take()).await {
                tracing::error!("Cannot store the events for webhooks: {error}");
                clock::pause(STORE_PAUSE, &mut stopping).await;
            }
            let wait = if self.sends(&mut right).await {
                let now = self.now();
                for (webhook, event) in self.write(|registry| registry.begin(now)) {
                    let webhooks = Arc::clone(&self);
                    sending.spawn(async move { webhooks.attempt(webhook, event).await });
                }
                let rest = self.read(|registry| registry.rest_ms(now));
                rest.map_or(LOOK_EVERY, |rest| Duration::from_millis(rest).min(LOOK_EVERY))
            } else {
                TAKE_EVERY
            };
            // A right may be lost.
            let wait = if is_shared { wait.min(TAKE_EVERY) } else { wait };
            tokio::select! {
                () = self.notices.wake.notified() => {}
                _ = changed.changed() => {}
                Some(_) = sending.join_next(), if !sending.is_empty() => {}
                () = tokio::time::sleep(wait) => {}
                _ = stopping.wait_for(|stopping| *stopping) => {}
            }
        }
        let ended = async { while sending.join_next().await.is_some() {} };
        if tokio::time::timeout(STOP_PATIENCE, ended).await.is_err() {
            tracing::warn!("Attempts to deliver were still in flight after {STOP_PATIENCE:?}");
        }
        sending.shutdown().await;
    }

    /// Stores the events that are still queued, after the last request of a server that stops.
    pub(crate) async fn announce_rest(&self) {
        if let Err(error) = self.announce(self.notices.take()).await {
            tracing::error!("Cannot store the events for webhooks: {error}");
        }
    }

    /// Updates the metrics.
    pub(crate) fn measure(&self) {
        let now = now_ms();
        let (oldest, n_failing) = self.read(|registry| {
            let hooks = registry.0.values().map(|known| &known.webhook);
            let failing = hooks.filter(|it| it.is_enabled && it.failing_since_ms.is_some());
            (registry.oldest_waiting(), failing.count())
        });
        let age_s = oldest.map_or(0.0, |at| now.saturating_sub(at) as f64 / 1000.0);
        metrics::gauge!("palpate_webhook_oldest_waiting_seconds").set(age_s);
        metrics::gauge!("palpate_webhooks_failing").set(n_failing as f64);
    }

    /// Makes one attempt, and stores its outcome.
    async fn attempt(&self, webhook: Uuid, event: Uuid) {
        let outcome = self.try_once(webhook, event).await;
        if let Err(error) = &outcome {
            tracing::error!(webhook.id = %webhook, event.id = %event,
                "Cannot store the attempt to deliver {event} to webhook {webhook}: {error}");
        }
        let now = self.now();
        self.write(|registry| {
            let Some(known) = registry.0.get_mut(&webhook) else { return };
            known.in_flight.remove(&event);
            match (outcome, known.entries.get_mut(&event)) {
                (Err(StoreError::Damaged { .. }), _) => {
                    known.entries.remove(&event);
                }
                (Err(_), Some(entry)) => {
                    entry.put_off(UNSTORED_PAUSE_MS, now);
                }
                (Ok(()), _) | (Err(_), None) => {}
            }
        });
        self.changed.send_replace(());
    }

    async fn try_once(&self, id: Uuid, event: Uuid) -> Result<(), StoreError> {
        let webhook = self.read(|registry| registry.0.get(&id).map(|known| known.webhook.clone()));
        let delivery = self.store.deliveries().find(id, event)?;
        let (Some(webhook), Some(delivery)) = (webhook, delivery) else {
            self.write(|registry| {
                registry.0.get_mut(&id).map(|known| known.entries.remove(&event))
            });
            return Ok(());
        };
        let (at_ms, begun) = (now_ms(), Instant::now());
        let sent = self.sender.send(message(&webhook, &delivery, at_ms)).await;
        let took_ms = u32::try_from(begun.elapsed().as_millis()).unwrap_or(u32::MAX);
        let attempt = Attempt { at_ms, took_ms, status: sent.status, error: sent.error.clone() };
        let _changing = self.changing.lock().await;
        // Both may have changed, or be gone.
        let Some(now) = self.store.deliveries().find(id, event)? else { return Ok(()) };
        let is_enabled =
            self.read(|registry| registry.0.get(&id).map(|known| known.webhook.is_enabled));
        let Some(is_enabled) = is_enabled else { return Ok(()) };
        let after = self.after(now, attempt, &sent, is_enabled);
        self.record(&after, &sent).await
    }

    /// A delivery after an attempt.
    fn after(&self, before: Delivery, attempt: Attempt, sent: &Sent, is_enabled: bool) -> Delivery {
        let mut after = before;
        let ended_at_ms = attempt.at_ms + u64::from(attempt.took_ms);
        after.attempts.push(attempt);
        let surplus = after.attempts.len().saturating_sub(ATTEMPTS_MAX);
        after.attempts.drain(..surplus);
        if sent.error.is_none() {
            (after.state, after.next_at_ms) = (DeliveryState::Delivered, None);
            return after;
        }
        after.n_failed += 1;
        let goes_on =
            is_enabled && after.kind != EventKind::Ping && sent.status != Some(STATUS_GONE);
        let pause = pause(&self.pauses, after.n_failed, after.event, sent.asked_pause);
        match pause.filter(|_| goes_on) {
            Some(pause) => {
                after.state = DeliveryState::Failed;
                after.next_at_ms = Some(ended_at_ms + pause.as_millis() as u64);
            }
            None => (after.state, after.next_at_ms) = (DeliveryState::Abandoned, None),
        }
        after
    }

    /// Stores what an attempt says about a webhook, then the delivery after it.
    async fn record(&self, after: &Delivery, sent: &Sent) -> Result<(), StoreError> {
        let id = after.webhook;
        let failing =
            self.read(|registry| registry.0.get(&id).map(|it| it.webhook.failing_since_ms));
        let Some(failing_since_ms) = failing else { return Ok(()) };
        let failed_at_ms = after.attempts.last().map(|attempt| attempt.at_ms);
        match (&sent.error, failing_since_ms) {
            (None, Some(_)) => {
                self.change(id, |webhook| webhook.failing_since_ms = None).await?;
            }
            (Some(_), None) => {
                self.change(id, |webhook| webhook.failing_since_ms = failed_at_ms).await?;
            }
            (None, None) | (Some(_), Some(_)) => {}
        }
        let is_gone = sent.status == Some(STATUS_GONE);
        if is_gone {
            tracing::warn!(webhook.id = %id, "Disabled webhook {id}: {GONE}");
            let disable = |webhook: &mut Webhook| {
                (webhook.is_enabled, webhook.disabled_because) = (false, Some(GONE.to_owned()));
            };
            self.change(id, disable).await?;
        }
        self.settle(after).await?;
        count_attempt(after, sent);
        if is_gone { self.abandon_waiting(id).await } else { Ok(()) }
    }
}

fn count_attempt(after: &Delivery, sent: &Sent) {
    let (id, event) = (after.webhook, after.event);
    let outcome = if sent.error.is_none() { "delivered" } else { "failed" };
    metrics::counter!("palpate_webhook_attempts_total", "outcome" => outcome).increment(1);
    match (after.state, &sent.error) {
        (DeliveryState::Delivered, _) => count_end("delivered"),
        (DeliveryState::Abandoned, reason) => {
            let reason = reason.as_deref().unwrap_or_default();
            tracing::warn!(webhook.id = %id, event.id = %event,
                "Gave up delivering {event} to webhook {id}: {reason}");
            count_end("abandoned");
        }
        (DeliveryState::Pending | DeliveryState::Failed, _) => {}
    }
}

fn message<'a>(webhook: &'a Webhook, delivery: &Delivery, now_ms: u64) -> Message<'a> {
    let previous = webhook.previous.as_ref().filter(|previous| previous.until_ms > now_ms);
    let secrets = [&webhook.secret].into_iter().chain(previous.map(|previous| &previous.secret));
    Message {
        url: &webhook.url,
        secrets: secrets.map(Vec::as_slice).collect(),
        id: delivery.event.to_string(),
        now_ms,
        body: delivery.body.clone(),
    }
}
