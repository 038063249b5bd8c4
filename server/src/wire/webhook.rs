//! Conversion of webhooks, their deliveries and what events are about.

use palpate_schemas as wire;
use palpate_store::entity::{Job, JobState};
use palpate_store::webhook::{Attempt, Delivery, DeliveryState, EventKind, Webhook};
use uuid::Uuid;

use super::recalibration::JobRequest;
use super::training::state as job_state;
use super::{Invalid, time};

/// Maximum length of the reason of a failed training in an event, characters.
const REASON_CHARS_MAX: usize = 2000;

/// What is known of a webhook beside its record.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WebhookStatus {
    pub(crate) n_waiting: u32,
    pub(crate) last_delivered_at_ms: Option<u64>,
    pub(crate) now_ms: u64,
}

/// A webhook as the wire has it.
pub(crate) fn webhook(webhook: &Webhook, status: WebhookStatus) -> wire::Webhook {
    let until = webhook.previous.as_ref().map(|previous| previous.until_ms);
    wire::Webhook {
        id: webhook.id,
        url: webhook.url.clone(),
        events: webhook.events.iter().map(|kind| event_type(*kind)).collect(),
        description: webhook.description.clone(),
        enabled: webhook.is_enabled,
        disabled_reason: webhook.disabled_because.clone(),
        failing_since: webhook.failing_since_ms.map(time),
        last_delivered_at: status.last_delivered_at_ms.map(time),
        n_waiting: status.n_waiting,
        rotating_until: until.filter(|until| *until > status.now_ms).map(time),
        created_at: time(webhook.created_at_ms),
        updated_at: time(webhook.updated_at_ms),
    }
}

/// A delivery as the wire has it.
pub(crate) fn delivery(delivery: &Delivery) -> wire::WebhookDelivery {
    wire::WebhookDelivery {
        id: delivery.event,
        kind: event_type(delivery.kind),
        state: match delivery.state {
            DeliveryState::Pending => wire::WebhookDeliveryState::Pending,
            DeliveryState::Failed => wire::WebhookDeliveryState::Failed,
            DeliveryState::Delivered => wire::WebhookDeliveryState::Delivered,
            DeliveryState::Abandoned => wire::WebhookDeliveryState::Abandoned,
        },
        created_at: time(delivery.created_at_ms),
        next_attempt_at: delivery.next_at_ms.map(time),
        attempts: delivery.attempts.iter().map(attempt).collect(),
        body: delivery.body.clone(),
    }
}

fn attempt(attempt: &Attempt) -> wire::WebhookAttempt {
    wire::WebhookAttempt {
        at: time(attempt.at_ms),
        duration_ms: attempt.took_ms,
        status: attempt.status,
        error: attempt.error.clone(),
    }
}

/// The body of an event, as it is signed and sent.
pub(crate) fn body(id: Uuid, kind: EventKind, at_ms: u64, data: wire::WebhookEventData) -> String {
    let event = wire::WebhookEvent { id, kind: event_type(kind), created_at: time(at_ms), data };
    serde_json::to_string(&event).expect("an event consists of finite numbers and texts")
}

/// The checked kinds of events of a webhook, sorted.
pub(crate) fn kinds(events: &[wire::WebhookEventType]) -> Result<Vec<EventKind>, Invalid> {
    if events.is_empty() {
        return Err(Invalid::field("/events", "none came, expected at least one type of event"));
    }
    for (place, event) in events.iter().enumerate() {
        let wrong = |detail: &str| Invalid::field(format!("/events/{place}"), detail);
        if *event == wire::WebhookEventType::Ping {
            return Err(wrong("came ping, which is sent on request to any webhook"));
        }
        if events[..place].contains(event) {
            return Err(wrong(&format!("came {} a second time", event.name())));
        }
    }
    let mut kinds: Vec<EventKind> = events.iter().map(|event| kind(*event)).collect();
    kinds.sort_unstable();
    Ok(kinds)
}

/// An ended training or recalibration, and when it ended; `None` for other jobs.
pub(crate) fn finished_job(job: &Job) -> Option<(u64, wire::WebhookJob)> {
    let is_comparison = matches!(serde_json::from_str(&job.request), Ok(JobRequest::Shadow { .. }));
    let is_told = matches!(job.state, JobState::Succeeded | JobState::Failed) && !is_comparison;
    let at_ms = job.finished_at_ms.filter(|_| is_told)?;
    let failed = job.error.as_ref().filter(|_| job.state == JobState::Failed);
    let told = wire::WebhookJob {
        id: job.id,
        catalogue: job.catalogue.clone(),
        state: job_state(job.state),
        version: job.version,
        reason: failed.map(|reason| reason.chars().take(REASON_CHARS_MAX).collect()),
        finished_at: Some(time(at_ms)),
    };
    Some((at_ms, told))
}

fn event_type(kind: EventKind) -> wire::WebhookEventType {
    match kind {
        EventKind::Ping => wire::WebhookEventType::Ping,
        EventKind::SessionDecided => wire::WebhookEventType::SessionDecided,
        EventKind::SessionUnknown => wire::WebhookEventType::SessionUnknown,
        EventKind::SessionNeedsAttention => wire::WebhookEventType::SessionNeedsAttention,
        EventKind::TrainingFinished => wire::WebhookEventType::TrainingFinished,
        EventKind::SnapshotMade => wire::WebhookEventType::SnapshotMade,
        EventKind::SnapshotFailed => wire::WebhookEventType::SnapshotFailed,
    }
}

fn kind(event: wire::WebhookEventType) -> EventKind {
    match event {
        wire::WebhookEventType::Ping => EventKind::Ping,
        wire::WebhookEventType::SessionDecided => EventKind::SessionDecided,
        wire::WebhookEventType::SessionUnknown => EventKind::SessionUnknown,
        wire::WebhookEventType::SessionNeedsAttention => EventKind::SessionNeedsAttention,
        wire::WebhookEventType::TrainingFinished => EventKind::TrainingFinished,
        wire::WebhookEventType::SnapshotMade => EventKind::SnapshotMade,
        wire::WebhookEventType::SnapshotFailed => EventKind::SnapshotFailed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_of_event_has_its_kind_and_none_comes_twice() {
        for event in wire::WebhookEventType::ALL {
            assert_eq!(event_type(kind(event)), event);
            let name = serde_json::to_value(event).unwrap();
            assert_eq!(name.as_str(), Some(event.name()));
        }
        let all = wire::WebhookEventType::ALL;
        assert_eq!(kinds(&all).unwrap().len(), all.len());
        let pointer = |events: &[_]| kinds(events).unwrap_err().0[0].pointer.clone();
        assert_eq!(pointer(&[]), "/events");
        assert_eq!(pointer(&[all[0], all[1], all[0]]), "/events/2");
        assert_eq!(pointer(&[wire::WebhookEventType::Ping]), "/events/0");
    }
}
