//! Webhooks, the deliveries of events to them, and what was announced of each session.
//!
//! A secret signs bodies, so it is stored as it is. The deliveries of an event are stored in one
//! commit with the note that it was announced: after a crash it is announced neither twice nor
//! never. The server bounds the number of webhooks and of their deliveries, and changes them one
//! after another.

mod stored;

use std::sync::Arc;

use uuid::Uuid;

use crate::engine::{Commit, Engine, Expected};
use crate::error::{StoreError, conflict, unconditional};
use crate::key::{self, Space};
use crate::pieces::{self, Limit};
use crate::record;
use crate::table::Entity;

/// Length of a delivery's key: space, webhook, event.
const DELIVERY_KEY_BYTES: usize = 33;
/// Length of a notice's key: space, session.
const NOTICE_KEY_BYTES: usize = 17;
/// Number of deliveries per read: at most some megabytes.
const DELIVERIES_PER_SCAN: usize = 64;
/// Attempts of an update under concurrent changes. Chosen.
const UPDATE_ATTEMPTS: usize = 64;
/// Number of notices in one commit of a removal.
const NOTICES_PER_COMMIT: usize = 1000;

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EventKind {
    /// A test message.
    Ping,
    /// A session's stop rule was reached by an object.
    SessionDecided,
    /// A session's stop rule was reached by "none of these".
    SessionUnknown,
    /// A session began to need attention.
    SessionNeedsAttention,
    /// A training or recalibration ended.
    TrainingFinished,
    /// A snapshot was sent completely.
    SnapshotMade,
    /// A snapshot broke off.
    SnapshotFailed,
}

/// A receiver of events.
#[derive(Clone, PartialEq, Eq)]
pub struct Webhook {
    /// Its id.
    pub id: Uuid,
    /// URL to which events are posted.
    pub url: String,
    /// Description for people.
    pub description: String,
    /// The events that it receives.
    pub events: Vec<EventKind>,
    /// The key of its signatures.
    pub secret: Vec<u8>,
    /// The secret before the last rotation, while it signs as well.
    pub previous: Option<PreviousKey>,
    /// Whether events are sent.
    pub is_enabled: bool,
    /// Why the server disabled it.
    pub disabled_because: Option<String>,
    /// Time of creation.
    pub created_at_ms: u64,
    /// Time of the last change by a client.
    pub updated_at_ms: u64,
    /// Earliest time of its events: that of creation, or of being enabled again.
    pub since_ms: u64,
    /// Time of the first failure after the last success.
    pub failing_since_ms: Option<u64>,
}

impl std::fmt::Debug for Webhook {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Secrets must not appear in a log, and URLs may hold some.
        formatter.debug_struct("Webhook").field("id", &self.id).finish_non_exhaustive()
    }
}

/// A secret that a rotation replaced.
#[derive(Clone, PartialEq, Eq)]
pub struct PreviousKey {
    /// The secret.
    pub secret: Vec<u8>,
    /// Time from which it no longer signs.
    pub until_ms: u64,
}

impl Entity for Webhook {
    const SPACE: Space = Space::Webhook;
    const WHAT: &'static str = "webhook";

    fn id(&self) -> Uuid {
        self.id
    }
}

/// State of a delivery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeliveryState {
    /// Not attempted yet.
    Pending,
    /// The last attempt failed, and another one follows.
    Failed,
    /// The receiver accepted it.
    Delivered,
    /// No attempt follows.
    Abandoned,
}

/// An event for a webhook, and the attempts to deliver it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Delivery {
    /// The webhook.
    pub webhook: Uuid,
    /// Id of the event, equal for all webhooks.
    pub event: Uuid,
    /// Kind of the event.
    pub kind: EventKind,
    /// The API key that caused the event, where that is known.
    pub caused_by: Option<Uuid>,
    /// The body as it is sent.
    pub body: String,
    /// Time of creation.
    pub created_at_ms: u64,
    /// State of the delivery.
    pub state: DeliveryState,
    /// Number of failed attempts since the delivery was last asked for.
    pub n_failed: u32,
    /// Time of the next attempt, if any.
    pub next_at_ms: Option<u64>,
    /// The newest attempts, oldest first.
    pub attempts: Vec<Attempt>,
}

/// One attempt of a delivery.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attempt {
    /// Time of its start.
    pub at_ms: u64,
    /// Time until the answer or the failure, in milliseconds.
    pub took_ms: u32,
    /// HTTP status of the answer.
    pub status: Option<u16>,
    /// Why it failed; `None` after a success.
    pub error: Option<String>,
}

/// What was announced of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Notice {
    /// The session.
    pub session: Uuid,
    /// The last decision: an object, or inside `None` for "none of these".
    pub decided: Option<Option<Uuid>>,
    /// Whether the session needs attention.
    pub needs_attention: bool,
}

/// Deliveries and notices.
#[derive(Clone)]
pub struct Deliveries {
    engine: Arc<dyn Engine>,
}

impl Deliveries {
    pub(crate) fn new(engine: Arc<dyn Engine>) -> Self {
        Self { engine }
    }

    /// Stores new deliveries, removes evicted ones, and stores a notice: all or
    /// nothing, durable when it returns. Leaves out those that another server has stored by now;
    /// returns the others.
    ///
    /// # Errors
    /// [`StoreError::Changed`] only under endless concurrent changes; [`StoreError::Damaged`] and
    /// the engine's.
    pub async fn add<'new>(
        &self,
        new: &'new [Delivery],
        evicted: &[(Uuid, Uuid)],
        notice: Option<&Notice>,
    ) -> Result<Vec<&'new Delivery>, StoreError> {
        for _ in 0..UPDATE_ATTEMPTS {
            let (mut commit, mut added) = (Commit::new(), Vec::new());
            for (webhook, event) in evicted {
                let head = key::nested(Space::Delivery, *webhook, *event);
                if let Some(before) = pieces::read(&*self.engine, Space::Delivery, &head)? {
                    commit = pieces::remove(commit, &head, &before);
                }
            }
            for delivery in new {
                let head = head_of(delivery);
                if self.engine.get(&head)?.is_none() {
                    commit = commit.expect(head.clone(), Expected::Absent);
                    commit = pieces::put(commit, &head, &record::encode(delivery), None);
                    added.push(delivery);
                }
            }
            if let Some(notice) = notice {
                let head = key::id(Space::Notice, notice.session);
                commit = commit.put(head, record::encode(notice));
            }
            match self.engine.commit(commit).await.map_err(conflict) {
                Ok(()) => return Ok(added),
                Err(Ok(_)) => {}
                Err(Err(error)) => return Err(error.into()),
            }
        }
        let id = new.first().map_or(Uuid::nil(), |delivery| delivery.event);
        Err(StoreError::Changed { what: "delivery", id })
    }

    /// Stores the new state of a delivery; `false`, and no change, if it was removed.
    ///
    /// # Errors
    /// [`StoreError::Changed`] only under endless concurrent changes; [`StoreError::Damaged`] and
    /// the engine's.
    pub async fn update(&self, delivery: &Delivery) -> Result<bool, StoreError> {
        let head = head_of(delivery);
        for _ in 0..UPDATE_ATTEMPTS {
            let before = pieces::read(&*self.engine, Space::Delivery, &head)?;
            let Some(before) = before else { return Ok(false) };
            let expected = Expected::Value(pieces::first(&before));
            let commit = Commit::new().expect(head.clone(), expected);
            let commit = pieces::put(commit, &head, &record::encode(delivery), Some(&before));
            match self.engine.commit(commit).await.map_err(conflict) {
                Ok(()) => return Ok(true),
                Err(Ok(_)) => {}
                Err(Err(error)) => return Err(error.into()),
            }
        }
        Err(StoreError::Changed { what: "delivery", id: delivery.event })
    }

    /// A delivery.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn find(&self, webhook: Uuid, event: Uuid) -> Result<Option<Delivery>, StoreError> {
        let head = key::nested(Space::Delivery, webhook, event);
        let found = pieces::read(&*self.engine, Space::Delivery, &head)?;
        found.map(|bytes| decoded(&bytes)).transpose()
    }

    /// Shows all deliveries to `look`, by webhook and event. Damaged ones are left out, and logged.
    /// Blocks.
    ///
    /// # Errors
    /// The engine's.
    pub fn each(&self, mut look: impl FnMut(Delivery)) -> Result<(), StoreError> {
        let (prefix, limit) = (key::space(Space::Delivery), Limit::records(DELIVERIES_PER_SCAN));
        let mut after = None;
        loop {
            let records = pieces::scan(
                &*self.engine,
                Space::Delivery,
                &prefix,
                DELIVERY_KEY_BYTES,
                after,
                limit,
            )?;
            let Some((last, _)) = records.last() else { return Ok(()) };
            after = Some(last.clone());
            for (_, bytes) in &records {
                match decoded(bytes) {
                    Ok(delivery) => look(delivery),
                    Err(error) => tracing::error!("Left a delivery of a webhook out: {error}"),
                }
            }
        }
    }

    /// Removes the deliveries to a webhook; durable when it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn remove_all(&self, webhook: Uuid) -> Result<(), StoreError> {
        Ok(pieces::remove_all(&*self.engine, &key::id(Space::Delivery, webhook)).await?)
    }

    /// What was announced of a session.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn notice(&self, session: Uuid) -> Result<Option<Notice>, StoreError> {
        let found = self.engine.get(&key::id(Space::Notice, session))?;
        let notice = found.map(|bytes| record::decode(&bytes)).transpose();
        notice.map_err(StoreError::damaged(Space::Notice))
    }

    /// All notices. Damaged ones are left out, and logged. Blocks.
    ///
    /// # Errors
    /// The engine's.
    pub fn notices(&self) -> Result<Vec<Notice>, StoreError> {
        let (prefix, limit) = (key::space(Space::Notice), Limit::records(usize::MAX));
        let records =
            pieces::scan(&*self.engine, Space::Notice, &prefix, NOTICE_KEY_BYTES, None, limit)?;
        let mut found = Vec::with_capacity(records.len());
        for (_, bytes) in &records {
            match record::decode(bytes) {
                Ok(notice) => found.push(notice),
                Err(error) => tracing::error!("Left a notice of a session out: {error}"),
            }
        }
        Ok(found)
    }

    /// Removes the notices of sessions; durable when it returns.
    ///
    /// # Errors
    /// The engine's.
    pub async fn forget(&self, sessions: &[Uuid]) -> Result<(), StoreError> {
        for sessions in sessions.chunks(NOTICES_PER_COMMIT) {
            let remove =
                |commit: Commit, session: &Uuid| commit.remove(key::id(Space::Notice, *session));
            let commit = sessions.iter().fold(Commit::new(), remove);
            self.engine.commit(commit).await.map_err(unconditional)?;
        }
        Ok(())
    }
}

fn head_of(delivery: &Delivery) -> Vec<u8> {
    key::nested(Space::Delivery, delivery.webhook, delivery.event)
}

fn decoded(bytes: &[u8]) -> Result<Delivery, StoreError> {
    record::decode(bytes).map_err(StoreError::damaged(Space::Delivery))
}
