//! Sending: every waiting session in the order of its journal, the oldest sessions first.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use futures::stream::{self, StreamExt};
use palpate_client::Client;
use palpate_client::schemas::{ForwardEntries, Labels, Session, SessionEnd};
use palpate_server::Outbox;
use palpate_server::outbox::Outgoing;
use uuid::Uuid;

use super::{Pause, Trouble, note_line};

/// Number of sessions that are sent at once: on a slow line more would only wait for each other.
const AT_ONCE: usize = 4;
/// Number of waiting sessions that are looked up at once.
const PER_PAGE: usize = 64;
/// Pause before a refused session is tried again, at least, and for each refused session: the
/// central service limits how often requests of a key fail.
const REFUSED_PAUSE: Duration = Duration::from_secs(60);
const REFUSED_EACH: Duration = Duration::from_secs(1);
/// Longest time between two looks at the waiting sessions.
const LOOK_EVERY: Duration = Duration::from_secs(5);

/// What the central service has of a session.
#[derive(Clone, Debug)]
struct There {
    /// Number of readings and retractions.
    n_entries: u64,
    labels: Labels,
}

impl There {
    fn of(session: Session) -> Self {
        let is_closed = session.ended == Some(SessionEnd::Closed);
        let n_entries = u64::from(session.revision) - u64::from(is_closed);
        Self { n_entries, labels: session.labels }
    }
}

/// Result of an attempt with one session.
enum Sent {
    /// All of it is there; if it is still open, this is what is known of it.
    Done(Option<There>),
    /// Something in between failed; this is known.
    Failed(Option<There>, Trouble),
}

/// Sends until it is dropped.
pub(super) async fn run(outbox: &Outbox, client: &Client) {
    let (mut pause, mut known, mut refused) = (Pause::new(), HashMap::new(), HashMap::new());
    loop {
        match round(outbox, client, &mut known, &mut refused).await {
            Ok(()) => {
                pause = Pause::new();
                outbox.changed(LOOK_EVERY).await;
            }
            Err((error, wait)) => {
                note_line(outbox, error);
                tokio::time::sleep(pause.next(wait)).await;
            }
        }
    }
}

/// Sends every waiting session once; fails as soon as nothing gets through.
async fn round(
    outbox: &Outbox,
    client: &Client,
    known: &mut HashMap<Uuid, There>,
    refused: &mut HashMap<Uuid, Instant>,
) -> Result<(), (String, Option<Duration>)> {
    let pause = REFUSED_EACH.saturating_mul(u32::try_from(refused.len()).unwrap_or(u32::MAX));
    refused.retain(|_, at| at.elapsed() < pause.max(REFUSED_PAUSE));
    let mut after = None;
    loop {
        let page = outbox.waiting(after, PER_PAGE);
        let Some(last) = page.last().copied() else { return Ok(()) };
        let due: Vec<(Uuid, Option<There>)> = page
            .into_iter()
            .filter(|id| !refused.contains_key(id))
            .map(|id| (id, known.remove(&id)))
            .collect();
        let mut sending = stream::iter(due)
            .map(|(id, there)| async move { (id, send(outbox, client, id, there).await) })
            .buffer_unordered(AT_ONCE);
        let mut down = None;
        while let Some((id, sent)) = sending.next().await {
            match sent {
                Sent::Done(there) => known.extend(there.map(|there| (id, there))),
                Sent::Failed(there, Trouble::Line { error, wait }) => {
                    known.extend(there.map(|there| (id, there)));
                    down = Some((error, wait));
                }
                // What is known of it may be wrong.
                Sent::Failed(_, Trouble::Refused(reason)) => {
                    tracing::warn!(session.id = %id, "Session {id} was refused: {reason}");
                    outbox.answered();
                    outbox.refused(id, reason);
                    refused.insert(id, Instant::now());
                }
                Sent::Failed(there, Trouble::Own(error)) => {
                    tracing::error!(session.id = %id, "Cannot read session {id}: {error}");
                    known.extend(there.map(|there| (id, there)));
                    outbox.refused(id, format!("this server cannot read it: {error}"));
                    refused.insert(id, Instant::now());
                }
            }
        }
        if let Some(down) = down {
            return Err(down);
        }
        after = Some(last);
    }
}

/// Sends what the central service does not have of a session.
async fn send(outbox: &Outbox, client: &Client, id: Uuid, there: Option<There>) -> Sent {
    let outgoing = match outbox.session(id).await {
        Ok(Some(outgoing)) => outgoing,
        Ok(None) => return Sent::Done(None),
        Err(error) => return Sent::Failed(there, error.into()),
    };
    let mut there = there;
    match bring(outbox, client, &outgoing, &mut there).await {
        Ok(()) => Sent::Done(there.filter(|_| outgoing.closing().is_none())),
        Err(trouble) => Sent::Failed(there, trouble),
    }
}

async fn bring(
    outbox: &Outbox,
    client: &Client,
    outgoing: &Outgoing,
    known: &mut Option<There>,
) -> Result<(), Trouble> {
    let (id, n_entries) = (outgoing.id, outgoing.n_entries());
    let there = match known {
        Some(there) => there,
        None => {
            let found = There::of(client.forward_session(id, outgoing.request()).await?);
            outbox.answered();
            if found.n_entries > n_entries {
                return Err(Trouble::Refused(format!(
                    "the central service has {} entries of it, and this server {n_entries}: was an \
                     older backup restored here?",
                    found.n_entries
                )));
            }
            known.insert(found)
        }
    };
    while there.n_entries < n_entries {
        outbox.still_waits(id, n_entries - there.n_entries);
        let entries = outbox.entries(id, there.n_entries).await?;
        let from = u32::try_from(there.n_entries).unwrap_or(u32::MAX);
        let sent = client.forward_entries(id, &ForwardEntries { from, entries }).await?;
        outbox.answered();
        there.n_entries = u64::from(sent.revision);
    }
    outbox.still_waits(id, 0);
    let labels = &outgoing.request().session.labels;
    if there.labels != *labels {
        client.set_session_labels(id, labels).await?;
        there.labels.clone_from(labels);
    }
    if let Some(closing) = outgoing.closing() {
        client.close_session_with(id, closing).await?;
    }
    outbox.answered();
    Ok(outbox.forwarded(outgoing).await?)
}
