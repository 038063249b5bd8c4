//! Webhooks, deliveries and notices as they are stored.

use uuid::Uuid;

use super::{Attempt, Delivery, DeliveryState, EventKind, Notice, PreviousKey, Webhook};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, code, coded, read, write};

/// Kinds in the order of their stored codes.
const KINDS: [EventKind; 7] = [
    EventKind::Ping,
    EventKind::SessionDecided,
    EventKind::SessionUnknown,
    EventKind::SessionNeedsAttention,
    EventKind::TrainingFinished,
    EventKind::SnapshotMade,
    EventKind::SnapshotFailed,
];

/// States in the order of their stored codes.
const STATES: [DeliveryState; 4] = [
    DeliveryState::Pending,
    DeliveryState::Failed,
    DeliveryState::Delivered,
    DeliveryState::Abandoned,
];

/// Id, URL, description, events.
type WhereV1 = (IdV1, String, String, Vec<u8>);
/// The secret, and the previous one with the time of its end.
type SecretsV1 = (Vec<u8>, Option<(Vec<u8>, u64)>);
/// Whether it is enabled, and why the server disabled it.
type StateV1 = (bool, Option<String>);
/// Times: created, updated, of the earliest event, of the first failure.
type TimesV1 = (u64, u64, u64, Option<u64>);

impl Record for Webhook {
    const KIND: Kind = Kind::Webhook;

    fn to_payload(&self) -> Vec<u8> {
        let events: Vec<u8> = self.events.iter().map(|kind| code(&KINDS, kind)).collect();
        let place = (self.id.as_bytes(), &self.url, &self.description, events);
        let previous = self.previous.as_ref().map(|it| (&it.secret, it.until_ms));
        let state = (self.is_enabled, &self.disabled_because);
        let times = (self.created_at_ms, self.updated_at_ms, self.since_ms, self.failing_since_ms);
        write(&(place, (&self.secret, previous), state, times))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (place, secrets, state, times): (WhereV1, SecretsV1, StateV1, TimesV1) = read(payload)?;
        let (id, url, description, events) = place;
        let (secret, previous) = secrets;
        let (is_enabled, disabled_because) = state;
        let (created_at_ms, updated_at_ms, since_ms, failing_since_ms) = times;
        let events = events.into_iter().map(|kind| coded(&KINDS, "event", kind));
        Ok(Self {
            id: Uuid::from_bytes(id),
            url,
            description,
            events: events.collect::<Result<_, _>>()?,
            secret,
            previous: previous.map(|(secret, until_ms)| PreviousKey { secret, until_ms }),
            is_enabled,
            disabled_because,
            created_at_ms,
            updated_at_ms,
            since_ms,
            failing_since_ms,
        })
    }
}

/// Webhook, event, kind, body, time of creation.
type EventV1 = (IdV1, IdV1, u8, String, u64);
/// State, number of failures, time of the next attempt.
type ProgressV1 = (u8, u32, Option<u64>);
/// Time, duration, status, error.
type AttemptV1 = (u64, u32, Option<u16>, Option<String>);
type DeliveryV1 = (EventV1, ProgressV1, Vec<AttemptV1>);

impl Record for Delivery {
    const KIND: Kind = Kind::Delivery;
    const SCHEMA: u16 = 2;

    fn to_payload(&self) -> Vec<u8> {
        let (webhook, event) = (self.webhook.as_bytes(), self.event.as_bytes());
        let event = (webhook, event, code(&KINDS, &self.kind), &self.body, self.created_at_ms);
        let progress = (code(&STATES, &self.state), self.n_failed, self.next_at_ms);
        let attempts = self.attempts.iter().map(|it| (it.at_ms, it.took_ms, it.status, &it.error));
        let known = (event, progress, attempts.collect::<Vec<_>>());
        write(&(known, self.caused_by.map(Uuid::into_bytes)))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (known, caused_by): (DeliveryV1, Option<IdV1>) = read(payload)?;
        Ok(Self { caused_by: caused_by.map(Uuid::from_bytes), ..delivery(known)? })
    }

    fn from_older(schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        match schema {
            1 => delivery(read(payload)?),
            found => Err(RecordError::Schema { found, known: Self::SCHEMA }),
        }
    }
}

/// A delivery of an unknown key.
fn delivery((event, progress, attempts): DeliveryV1) -> Result<Delivery, RecordError> {
    let (webhook, event, kind, body, created_at_ms) = event;
    let (state, n_failed, next_at_ms) = progress;
    let attempt = |(at_ms, took_ms, status, error)| Attempt { at_ms, took_ms, status, error };
    Ok(Delivery {
        webhook: Uuid::from_bytes(webhook),
        event: Uuid::from_bytes(event),
        kind: coded(&KINDS, "event", kind)?,
        caused_by: None,
        body,
        created_at_ms,
        state: coded(&STATES, "state", state)?,
        n_failed,
        next_at_ms,
        attempts: attempts.into_iter().map(attempt).collect(),
    })
}

impl Record for Notice {
    const KIND: Kind = Kind::Notice;

    fn to_payload(&self) -> Vec<u8> {
        let decided = self.decided.map(|object| object.map(Uuid::into_bytes));
        write(&(self.session.as_bytes(), decided, self.needs_attention))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (session, decided, needs_attention): (IdV1, Option<Option<IdV1>>, bool) =
            read(payload)?;
        let decided = decided.map(|object| object.map(Uuid::from_bytes));
        Ok(Self { session: Uuid::from_bytes(session), decided, needs_attention })
    }
}
