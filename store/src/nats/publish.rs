//! Publishing: one message, or one atomic batch, and what a refusal means.

use std::error::Error;
use std::sync::atomic::Ordering;

use async_nats::HeaderMap;
use async_nats::header::{
    NATS_BATCH_COMMIT, NATS_BATCH_COMMIT_FINAL, NATS_BATCH_ID, NATS_BATCH_SEQUENCE,
    NATS_EXPECTED_LAST_SUBJECT_SEQUENCE, NATS_MESSAGE_TTL, NATS_ROLLUP,
};
use async_nats::jetstream;
use async_nats::jetstream::context::PublishError;
use async_nats::jetstream::stream::{LastRawMessageErrorKind, Stream};
use tokio::sync::Semaphore;
use uuid::Uuid;

use super::plan::Outgoing;
use super::unit;

/// Maximum number of batches on their way; a server takes 50 of a stream at once.
const BATCHES_MAX: usize = 16;
/// Maximum number of single messages on their way.
const SINGLES_MAX: usize = 512;

/// The reason for which nothing was stored, or nobody knows whether.
#[derive(Debug)]
pub(super) enum Refused {
    /// A unit's last message is another one (10071).
    Changed,
    /// The servers are busy with the same unit, or with too much (10164 and others).
    Busy,
    /// No answer: it may have been stored.
    Unknown(String),
    /// The servers have no room.
    NoRoom(String),
}

/// Writes to one stream.
pub(super) struct Publisher {
    pub(super) context: jetstream::Context,
    pub(super) stream: Stream,
    pub(super) name: String,
    /// Largest payload of a message.
    pub(super) payload_max: usize,
    batches: Semaphore,
    singles: Semaphore,
}

impl Publisher {
    pub(super) fn new(
        context: jetstream::Context,
        stream: Stream,
        name: String,
        payload_max: usize,
    ) -> Self {
        let (batches, singles) = (Semaphore::new(BATCHES_MAX), Semaphore::new(SINGLES_MAX));
        Self { context, stream, name, payload_max, batches, singles }
    }

    /// Bytes that the cluster sent on this connection.
    pub(super) fn received_bytes(&self) -> u64 {
        self.context.client().statistics().in_bytes.load(Ordering::Relaxed)
    }

    /// Publishes messages, all or none; returns the sequence of the last one.
    pub(super) async fn publish(&self, outgoing: &[Outgoing]) -> Result<u64, Refused> {
        let places = if outgoing.len() > 1 { &self.batches } else { &self.singles };
        let _place = places.acquire().await.map_err(unknown)?;
        let batch = Uuid::now_v7().to_string();
        for (number, message) in (1..).zip(outgoing) {
            let mut headers = self.headers(message);
            let subject = unit::subject(&self.name, &message.unit);
            let payload = message.payload.clone().into();
            if outgoing.len() > 1 {
                headers.insert(NATS_BATCH_ID, batch.as_str());
                headers.insert(NATS_BATCH_SEQUENCE, number.to_string());
            }
            if number < outgoing.len() {
                let client = self.context.client();
                client.publish_with_headers(subject, headers, payload).await.map_err(unknown)?;
                continue;
            }
            if outgoing.len() > 1 {
                headers.insert(NATS_BATCH_COMMIT, NATS_BATCH_COMMIT_FINAL);
            }
            let sent = self.context.publish_with_headers(subject, headers, payload).await;
            let answer = sent.map_err(refused)?.await.map_err(refused)?;
            return Ok(answer.sequence);
        }
        Ok(0)
    }

    fn headers(&self, message: &Outgoing) -> HeaderMap {
        let mut headers = HeaderMap::new();
        if let Some(expected) = message.expected {
            headers.insert(NATS_EXPECTED_LAST_SUBJECT_SEQUENCE, expected.to_string());
        }
        if message.is_rollup {
            headers.insert(NATS_ROLLUP, "sub");
        }
        if let Some(ttl) = message.ttl {
            headers.insert(NATS_MESSAGE_TTL, ttl);
        }
        headers
    }

    /// Sequence of a unit's last message, by the stream's leader; 0 without any.
    pub(super) async fn last_sequence(&self, unit: &[u8]) -> Result<u64, String> {
        let subject = unit::subject(&self.name, unit);
        match self.stream.get_last_raw_message_by_subject(&subject).await {
            Ok(message) => Ok(message.sequence),
            Err(error) if error.kind() == LastRawMessageErrorKind::NoMessageFound => Ok(0),
            Err(error) => Err(error.to_string()),
        }
    }

    /// Removes the messages of a unit up to the one at `last`.
    pub(super) async fn purge(&self, unit: &[u8], last: u64) -> Result<(), String> {
        let purge = self.stream.purge().filter(unit::subject(&self.name, unit));
        let purged = match last.checked_add(1) {
            Some(end) => purge.sequence(end).await,
            None => purge.await,
        };
        purged.map(drop).map_err(|error| error.to_string())
    }
}

fn unknown(error: impl std::fmt::Display) -> Refused {
    Refused::Unknown(error.to_string())
}

fn refused(error: PublishError) -> Refused {
    let stated = error.source().and_then(|source| source.downcast_ref::<jetstream::Error>());
    match stated.map(|stated| stated.error_code().0) {
        Some(10071) => Refused::Changed,
        // In flight; too many batches in flight; a batch that was interrupted.
        Some(10164 | 10176 | 10210 | 10211) => Refused::Busy,
        // Resources of the account, of the server, of its storage; limits of the stream.
        Some(10002 | 10023 | 10047 | 10077) => Refused::NoRoom(error.to_string()),
        _ => unknown(error),
    }
}
