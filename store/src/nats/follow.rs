//! The follower: applies the stream's messages to the index, those of a commit together.
//!
//! Messages that later ones replaced are missing, and so a commit may come without its
//! beginning or end. What follows it is then held back until the stream has nothing more, so
//! that readers see no state between two commits.

use std::sync::Arc;
use std::time::{Duration, Instant};

use async_nats::Client;
use async_nats::connection::State;
use async_nats::jetstream::consumer::DeliverPolicy;
use async_nats::jetstream::consumer::push::{Ordered, OrderedConfig};
use async_nats::jetstream::message::Message as Received;
use async_nats::jetstream::stream::Stream;
use futures::StreamExt;

use super::index::TOMBSTONE_KEPT;
use super::message::{Message, decode};
use super::shared::{Delivered, Shared};
use crate::engine::EngineError;

const FOLLOWING: &str = "following the stream";
/// Time after which the missing messages of a commit count as replaced by later ones. Chosen: a
/// batch is delivered within milliseconds.
const REST_COMES_WITHIN: Duration = Duration::from_secs(1);
/// Interval at which a quiet stream is tidied. Chosen: far below the time that tombstones are kept.
const LOOK_EVERY: Duration = Duration::from_secs(60);
/// Time in which a new consumer is not given up. Chosen: far more than its first message takes.
const FRESH: Duration = Duration::from_secs(2);
/// Pause after a consumer could not be made. Chosen: an election takes seconds.
const PAUSE: Duration = Duration::from_millis(500);
/// Maximum number of messages held back.
const HELD_BACK_MAX: usize = 10_000;

/// Messages of commits that are not complete yet.
#[derive(Debug, Default)]
struct Gathering {
    messages: Vec<Delivered>,
    /// Whether the beginning of a commit is missing, or the end of an earlier one.
    has_gap: bool,
}

impl Gathering {
    /// Adds a message; whether all may be applied now. `pending`: number of messages behind it.
    fn add(&mut self, delivered: Delivered, pending: u64) -> bool {
        let Message { commit, part, n_parts, .. } = &delivered.message;
        let follows = match self.messages.last() {
            Some(Delivered { message: last, sequence, .. }) if last.part + 1 < last.n_parts => {
                last.commit == *commit
                    && last.part + 1 == *part
                    && sequence + 1 == delivered.sequence
            }
            _ => *part == 0,
        };
        self.has_gap |= !follows;
        let is_end = part + 1 == *n_parts;
        self.messages.push(delivered);
        let is_whole = is_end && !self.has_gap;
        is_whole || (is_end && pending == 0) || self.messages.len() >= HELD_BACK_MAX
    }

    fn take(&mut self) -> Vec<Delivered> {
        self.has_gap = false;
        std::mem::take(&mut self.messages)
    }
}

/// Follows the stream until the store fails or is closed.
pub(super) async fn follow(stream: Stream, client: Client, shared: Arc<Shared>) {
    let mut gathering = Gathering::default();
    let mut contact = Instant::now();
    let mut received = 0;
    loop {
        let mut messages = match consume(&stream, client.new_inbox(), received + 1).await {
            Ok(messages) => messages,
            Err(error) => {
                tracing::warn!("Cannot follow the store's stream, trying again: {error}");
                tokio::time::sleep(PAUSE).await;
                if contact.elapsed() > TOMBSTONE_KEPT / 2 {
                    return shared.fail(too_late());
                }
                continue;
            }
        };
        let begun = Instant::now();
        let mut quiet_since = begun;
        loop {
            let is_waiting = !gathering.messages.is_empty() && !gathering.has_gap;
            let patience = if is_waiting { REST_COMES_WITHIN } else { LOOK_EVERY };
            let left = patience.saturating_sub(quiet_since.elapsed());
            let next = tokio::select! {
                next = tokio::time::timeout(left, messages.next()) => next,
                // Its server may be gone, which heartbeats would tell much later.
                () = shared.is_stalled.notified() => {
                    // The word may be about the consumer before: one that was just made would never
                    // come to deliver.
                    if begun.elapsed() > FRESH {
                        break;
                    }
                    continue;
                }
            };
            quiet_since = Instant::now();
            let outcome = match next {
                Err(_) if !gathering.messages.is_empty() => shared.apply(&gathering.take()),
                Err(_) => {
                    shared.forget_expired();
                    if client.connection_state() == State::Connected {
                        contact = Instant::now();
                    }
                    Ok(())
                }
                Ok(Some(Ok(message))) => {
                    // Tombstones may have expired in the meantime.
                    if contact.elapsed() > TOMBSTONE_KEPT / 2 {
                        return shared.fail(too_late());
                    }
                    contact = Instant::now();
                    take(&message, &mut received, &mut gathering, &shared)
                }
                Ok(Some(Err(error))) => {
                    tracing::info!("Following the store's stream anew: {error}");
                    break;
                }
                Ok(None) => break,
            };
            if let Err(error) = outcome {
                return shared.fail(error);
            }
        }
        tokio::time::sleep(PAUSE).await;
    }
}

async fn consume(stream: &Stream, inbox: String, from: u64) -> Result<Ordered, String> {
    let config = OrderedConfig {
        deliver_subject: inbox,
        deliver_policy: DeliverPolicy::ByStartSequence { start_sequence: from },
        ..OrderedConfig::default()
    };
    let consumer = stream.create_consumer(config).await.map_err(|error| error.to_string())?;
    consumer.messages().await.map_err(|error| error.to_string())
}

fn take(
    message: &Received,
    received: &mut u64,
    gathering: &mut Gathering,
    shared: &Shared,
) -> Result<(), EngineError> {
    let failed = |detail: String| EngineError::Failed { doing: FOLLOWING, detail };
    let info = message.info().map_err(|error| failed(error.to_string()))?;
    let (sequence, pending) = (info.stream_sequence, info.pending);
    if sequence <= *received {
        return Ok(());
    }
    *received = sequence;
    let bytes = message.payload.len() as u64;
    let message = decode(&message.payload)
        .map_err(|fault| failed(format!("message {sequence} is damaged: {fault}")))?;
    if gathering.add(Delivered { message, sequence, bytes }, pending) {
        shared.apply(&gathering.take())?;
    }
    Ok(())
}

fn too_late() -> EngineError {
    let detail = "it was out of reach for so long that removals may have been missed".to_owned();
    EngineError::Failed { doing: FOLLOWING, detail }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    fn delivered(commit: u128, part: u16, n_parts: u16, sequence: u64) -> Delivered {
        let (commit, unit) = (Uuid::from_u128(commit), vec![1]);
        let message = Message { commit, part, n_parts, unit, is_whole: true, writes: Vec::new() };
        Delivered { message, sequence, bytes: 1 }
    }

    #[test]
    fn messages_of_a_commit_are_applied_together() {
        let mut gathering = Gathering::default();
        assert!(!gathering.add(delivered(1, 0, 2, 5), 0));
        assert!(gathering.add(delivered(1, 1, 2, 6), 7));
        assert_eq!(gathering.take().len(), 2);
        assert!(gathering.add(delivered(2, 0, 1, 7), 7));
    }

    #[test]
    fn what_follows_a_gap_waits_for_the_end_of_the_stream() {
        let mut gathering = Gathering::default();
        assert!(!gathering.add(delivered(1, 1, 2, 6), 3), "its beginning was replaced");
        assert!(!gathering.add(delivered(2, 0, 1, 7), 2));
        assert!(!gathering.add(delivered(3, 0, 2, 8), 1));
        assert!(gathering.add(delivered(3, 1, 2, 9), 0));
        gathering.take();
        assert!(!gathering.add(delivered(4, 0, 2, 10), 9));
        assert!(!gathering.add(delivered(5, 0, 1, 12), 8), "an end was replaced");
        assert!(gathering.add(delivered(6, 0, 1, 13), 0));
    }
}
