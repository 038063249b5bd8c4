//! Events: each queued notice becomes deliveries, stored in one commit with the mark that it was
//! announced.
//!
//! An event's id is a hash of what happened. Announcing an event again after a crash therefore
//! yields the same id, and the second copy is dropped.

use std::collections::BTreeSet;

use palpate_schemas as wire;
use palpate_store::error::StoreError;
use palpate_store::webhook::{Delivery, DeliveryState, EventKind, Notice};
use uuid::{Builder, Uuid};

use super::registry::{Entry, Known, Share};
use super::{Webhooks, count_end};
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::notices::{Alarm, Decision, Waiting};
use crate::wire::life::opened_by;
use crate::wire::webhook::{body, finished_job};

/// Maximum length of an event's body, bytes. Longer ones are not sent.
const BODY_BYTES_MAX: usize = 64 << 10;
/// A start announces again the trainings that ended within this time before it. Chosen: covers
/// those that ended shortly before a crash.
const JOBS_BEFORE_MS: u64 = 3_600_000;

/// An event before its deliveries are made.
struct Event {
    id: Uuid,
    kind: EventKind,
    at_ms: u64,
    /// The key that caused it, where that is known.
    caused_by: Option<Uuid>,
    data: wire::WebhookEventData,
}

/// Id of an event: its time, and a hash of what happened.
fn event_id(kind: EventKind, at_ms: u64, subject: Uuid, what: &str) -> Uuid {
    let mut hasher = blake3::Hasher::new();
    hasher.update(subject.as_bytes()).update(format!("{kind:?} {at_ms} {what}").as_bytes());
    let [a, b, c, d, e, f, g, h, i, j, ..] = *hasher.finalize().as_bytes();
    Builder::from_unix_timestamp_millis(at_ms, &[a, b, c, d, e, f, g, h, i, j]).into_uuid()
}

/// A delivery that is due.
pub(super) fn pending(
    webhook: Uuid,
    event: Uuid,
    (kind, caused_by): Share,
    now_ms: u64,
    body: impl FnOnce() -> String,
) -> Delivery {
    Delivery {
        webhook,
        event,
        kind,
        caused_by,
        body: body(),
        created_at_ms: now_ms,
        state: DeliveryState::Pending,
        n_failed: 0,
        next_at_ms: Some(now_ms),
        attempts: Vec::new(),
    }
}

impl Webhooks {
    /// Announces trainings whose end a crash may have left unannounced, and removes deliveries to
    /// deleted webhooks.
    pub(super) async fn recover(&self) -> Result<(), Cause> {
        let mut orphans = BTreeSet::new();
        self.store.deliveries().each(|delivery| {
            orphans.insert(delivery.webhook);
        })?;
        for webhook in orphans {
            // Another server may just have made it.
            if self.store.webhooks().find(webhook)?.is_some() {
                continue;
            }
            self.store.deliveries().remove_all(webhook).await?;
        }
        let (now, running) = (now_ms(), self.store.running(now_ms()));
        // A clock that jumped makes no training old.
        let is_recent = |at_ms: u64| {
            let ran_ms = running.at(at_ms);
            let is_by_clock = at_ms >= now.saturating_sub(JOBS_BEFORE_MS);
            is_by_clock || (ran_ms > 0 && running.now_ms() - ran_ms <= JOBS_BEFORE_MS)
        };
        for job in self.store.jobs().list_whole(None, usize::MAX - 1)?.items {
            let finished = finished_job(&job).filter(|(at_ms, _)| is_recent(*at_ms));
            if let Some((at_ms, job)) = finished {
                self.announce_job(at_ms, &job, true).await?;
            }
        }
        Ok(())
    }

    /// Stores the deliveries of all queued notices; puts back those that cannot be stored.
    pub(super) async fn announce(&self, mut waiting: Waiting) -> Result<(), Cause> {
        let announced = self.announce_all(&mut waiting).await;
        if announced.is_err() {
            self.notices.put_back(waiting);
        }
        announced
    }

    /// Announces one notice after another, and takes each off the queue.
    async fn announce_all(&self, waiting: &mut Waiting) -> Result<(), Cause> {
        while let Some((session, decision)) = waiting.decisions.first_key_value() {
            self.announce_decision(*session, decision).await?;
            waiting.decisions.pop_first();
        }
        while let Some((session, alarm)) = waiting.alarms.first_key_value() {
            self.announce_alarm(*session, alarm).await?;
            waiting.alarms.pop_first();
        }
        while let Some((_, (at_ms, job))) = waiting.jobs.first_key_value() {
            self.announce_job(*at_ms, job, false).await?;
            waiting.jobs.pop_first();
        }
        while let Some((at_ms, snapshot)) = waiting.snapshots.last() {
            self.announce_snapshot(*at_ms, snapshot).await?;
            waiting.snapshots.pop();
        }
        self.store.essential().deliveries().forget(&waiting.gone).await?;
        waiting.gone.drain(..).for_each(|session| self.notices.forget(session));
        Ok(())
    }

    async fn announce_decision(&self, session: Uuid, decision: &Decision) -> Result<(), Cause> {
        let Decision { at_ms, object, belief } = decision;
        let kind = match object {
            Some(_) => EventKind::SessionDecided,
            None => EventKind::SessionUnknown,
        };
        let notice = Notice { decided: Some(*object), ..self.notices.announced(session) };
        let what = belief.revision.to_string();
        let data = |shown| {
            let (session, belief) = (Some(shown), Some(belief.clone()));
            wire::WebhookEventData { session, belief, ..wire::WebhookEventData::default() }
        };
        self.announce_session(kind, (*at_ms, &what), notice, data).await
    }

    async fn announce_alarm(&self, session: Uuid, alarm: &Alarm) -> Result<(), Cause> {
        let Alarm { since_ms, attention } = alarm;
        let kind = EventKind::SessionNeedsAttention;
        let needs_attention = attention.is_needed;
        let notice = Notice { needs_attention, ..self.notices.announced(session) };
        if !needs_attention {
            let _changing = self.changing.lock().await;
            if self.read(|registry| registry.0.values().any(|known| known.wants(kind))) {
                self.store.deliveries().add(&[], &[], Some(&notice)).await?;
            }
            self.notices.set_announced(notice);
            return Ok(());
        }
        let data = |shown| {
            let (session, attention) = (Some(shown), Some(attention.clone()));
            wire::WebhookEventData { session, attention, ..wire::WebhookEventData::default() }
        };
        self.announce_session(kind, (*since_ms, ""), notice, data).await
    }

    /// Announces an event of a session. Stores nothing if no webhook wants such events.
    async fn announce_session(
        &self,
        kind: EventKind,
        (at_ms, what): (u64, &str),
        notice: Notice,
        data: impl FnOnce(wire::Session) -> wire::WebhookEventData,
    ) -> Result<(), Cause> {
        let session = notice.session;
        let _changing = self.changing.lock().await;
        if !self.read(|registry| registry.0.values().any(|known| known.wants(kind))) {
            self.notices.set_announced(notice);
            return Ok(());
        }
        let shown = match self.sessions.get(&session.to_string()) {
            Ok(shown) => shown,
            // It was deleted meanwhile.
            Err(Cause::NotFound { .. }) => return Ok(()),
            Err(error) => return Err(error),
        };
        let id = event_id(kind, at_ms, session, what);
        let caused_by = self.store.sessions().find(session)?.as_ref().and_then(opened_by);
        let event = Event { id, kind, at_ms, caused_by, data: data(shown) };
        let deliveries = self.deliveries_of(event, false);
        self.add(deliveries, Some(&notice)).await?;
        self.notices.set_announced(notice);
        Ok(())
    }

    async fn announce_job(
        &self,
        at_ms: u64,
        job: &wire::WebhookJob,
        is_repeated: bool,
    ) -> Result<(), Cause> {
        let kind = EventKind::TrainingFinished;
        let id = event_id(kind, at_ms, job.id, "");
        let caused_by = self.store.job_writer(job.id).map_err(StoreError::from)?;
        let caused_by = caused_by.filter(|key| !key.is_nil());
        let job = Some(job.clone());
        let data = wire::WebhookEventData { job, ..wire::WebhookEventData::default() };
        let _changing = self.changing.lock().await;
        let deliveries =
            self.deliveries_of(Event { id, kind, at_ms, caused_by, data }, is_repeated);
        Ok(self.add(deliveries, None).await?)
    }

    async fn announce_snapshot(
        &self,
        at_ms: u64,
        snapshot: &wire::WebhookSnapshot,
    ) -> Result<(), Cause> {
        let kind = match snapshot.reason {
            None => EventKind::SnapshotMade,
            Some(_) => EventKind::SnapshotFailed,
        };
        let snapshot = Some(snapshot.clone());
        let data = wire::WebhookEventData { snapshot, ..wire::WebhookEventData::default() };
        let _changing = self.changing.lock().await;
        let id = Uuid::now_v7();
        let deliveries =
            self.deliveries_of(Event { id, kind, at_ms, caused_by: None, data }, false);
        Ok(self.add(deliveries, None).await?)
    }

    /// Makes the deliveries of an event to the webhooks that take it and do not have it yet. A
    /// repeated event skips webhooks whose history may have evicted it.
    fn deliveries_of(&self, event: Event, is_repeated: bool) -> Vec<Delivery> {
        let (now, Event { id, kind, at_ms, caused_by, data }) = (now_ms(), event);
        let share = (kind, caused_by);
        let is_new = |known: &&Known| {
            let is_known = known.entries.contains_key(&id);
            let was_known = is_repeated && known.may_have_evicted(share, id);
            known.takes(kind, at_ms, now) && !is_known && !was_known
        };
        let takers: Vec<Uuid> = self.read(|registry| {
            registry.0.values().filter(is_new).map(|known| known.webhook.id).collect()
        });
        if takers.is_empty() {
            return Vec::new();
        }
        let body = body(id, kind, at_ms, data);
        if body.len() > BODY_BYTES_MAX {
            let n_bytes = body.len();
            tracing::error!(event.id = %id,
                "Event {id} is not sent: it has {n_bytes} bytes, at most {BODY_BYTES_MAX} are");
            count_end("too_large");
            return Vec::new();
        }
        takers.iter().map(|hook| pending(*hook, id, share, now, || body.clone())).collect()
    }

    /// Stores new deliveries, at most one of each webhook, with a notice. Webhooks must not change
    /// meanwhile.
    pub(super) async fn add(
        &self,
        new: Vec<Delivery>,
        notice: Option<&Notice>,
    ) -> Result<(), StoreError> {
        let evicted: Vec<(Uuid, Uuid, Entry)> = self.read(|registry| {
            let of = |delivery: &Delivery| {
                let share = (delivery.kind, delivery.caused_by);
                let (event, entry) = registry.0.get(&delivery.webhook)?.next_evicted(share)?;
                Some((delivery.webhook, event, entry))
            };
            new.iter().filter_map(of).collect()
        });
        if new.is_empty() && notice.is_none() {
            return Ok(());
        }
        let removed: Vec<_> = evicted.iter().map(|(hook, event, _)| (*hook, *event)).collect();
        let added = self.store.deliveries().add(&new, &removed, notice).await?;
        let running = self.store.running(now_ms());
        self.write(|registry| {
            for (hook, event, _) in &evicted {
                registry.0.get_mut(hook).and_then(|known| known.entries.remove(event));
            }
            for delivery in added {
                if let Some(known) = registry.0.get_mut(&delivery.webhook) {
                    known.entries.insert(delivery.event, Entry::of(delivery, &running));
                }
            }
        });
        for (hook, event, entry) in &evicted {
            if entry.is_waiting() {
                tracing::warn!(webhook.id = %hook, event.id = %event,
                    "Event {event} left the history of webhook {hook} undelivered: newer ones of its \
                     kind and key came");
                count_end("displaced");
            }
        }
        self.changed.send_replace(());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_has_one_id_however_often_it_is_told() {
        let (kind, session) = (EventKind::SessionDecided, Uuid::from_u128(1));
        let id = event_id(kind, 1_700_000_000_000, session, "5");
        assert_eq!(id, event_id(kind, 1_700_000_000_000, session, "5"));
        let others = [
            event_id(kind, 1_700_000_000_000, session, "6"),
            event_id(kind, 1_700_000_000_000, Uuid::from_u128(2), "5"),
            event_id(EventKind::SessionUnknown, 1_700_000_000_000, session, "5"),
        ];
        assert!(others.iter().all(|other| *other != id));
        assert!(id < event_id(kind, 1_700_000_000_001, session, "5"), "ids ascend with time");
        assert_eq!(id.get_version_num(), 7);
    }
}
