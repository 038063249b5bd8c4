//! The way of one commit: its large content put, then planned, published, and planned again when
//! another server was faster.
//!
//! A publication without an answer may have been stored. It expects the same last sequence as
//! its repetition, so at most one of them is; when the repetition is refused, the stream tells
//! which, since it delivers the commit's id.

use std::sync::Arc;
use std::time::{Duration, Instant};

use uuid::Uuid;

use super::content::{Contents, Object};
use super::lanes::Admitted;
use super::plan::{Parts, plan};
use super::publish::{Publisher, Refused};
use super::shared::Shared;
use super::spool::Stored;
use crate::engine::{CommitError, EngineError, Expected};

/// Time after which a commit without success is given up. A leader's crash takes seconds.
const PATIENCE: Duration = Duration::from_secs(60);
/// Time after which a message that names objects is not published any more. Chosen: far below the
/// time after which objects without a message are removed.
const NAMED_WITHIN: Duration = Duration::from_secs(600);
/// First pause before another attempt; it doubles up to the longest.
const PAUSE: Duration = Duration::from_millis(2);
const PAUSE_MAX: Duration = Duration::from_millis(500);
/// Time to follow up to a sequence that a leader named.
const FOLLOW_WITHIN: Duration = Duration::from_secs(5);

/// Commits until it is stored, refused, or given up.
pub(super) async fn commit(
    admitted: &Admitted,
    publisher: &Publisher,
    shared: &Arc<Shared>,
    contents: &Contents,
) -> Result<(), CommitError> {
    let id = Uuid::now_v7();
    let begun = Instant::now();
    fetch_expected(admitted, shared).await?;
    let content = contents.put(id, &admitted.job.work.commit.writes).await.map_err(failed)?;
    shared.begin(id);
    let outcome = attempts(admitted, publisher, shared, &content, (id, begun)).await;
    shared.end(id);
    if outcome.is_ok() {
        shared.count();
    }
    outcome
}

/// Fetches the content whose values a commit expects, since no other commit is planned meanwhile.
async fn fetch_expected(admitted: &Admitted, shared: &Arc<Shared>) -> Result<(), EngineError> {
    let objects: Vec<Arc<Object>> = {
        let index = shared.index();
        let expected = admitted.job.work.commit.expectations.iter();
        let found = expected.filter_map(|(key, expected)| match expected {
            Expected::Value(_) => index.pairs.get(&key[..]),
            Expected::Absent => None,
        });
        let content = found.filter_map(|stored| match stored {
            Stored::Content { object, .. } => Some(object),
            Stored::Memory(_) | Stored::File { .. } => None,
        });
        content.collect()
    };
    for object in objects {
        object.fetch().await?;
    }
    Ok(())
}

async fn attempts(
    admitted: &Admitted,
    publisher: &Publisher,
    shared: &Arc<Shared>,
    content: &Parts,
    (id, put): (Uuid, Instant),
) -> Result<(), CommitError> {
    let begun = Instant::now();
    let mut pause = PAUSE;
    loop {
        shared.check()?;
        let work = &admitted.job.work;
        let planned = plan(&shared.index(), work, content, id, publisher.payload_max);
        if !content.is_empty() && put.elapsed() > NAMED_WITHIN {
            return Err(failed(format!("its content was put more than {NAMED_WITHIN:?} ago")));
        }
        let outgoing = match planned {
            // What its expectations miss is its own work: the follower came by meanwhile.
            Err(CommitError::Conflict { .. }) if shared.is_delivered(id) => return Ok(()),
            planned => planned?,
        };
        if outgoing.is_empty() {
            return Ok(());
        }
        let detail = match publisher.publish(&outgoing).await {
            Ok(sequence) => return Ok(shared.reach(sequence).await?),
            Err(Refused::NoRoom(detail)) => return Err(failed(detail)),
            Err(Refused::Changed) => "other servers were faster each time".to_owned(),
            Err(Refused::Busy) => "the servers are busy".to_owned(),
            Err(Refused::Unknown(detail)) => detail,
        };
        let units = outgoing.iter().map(|message| &message.unit);
        let behind = catch_up(units, publisher, shared).await;
        if shared.is_delivered(id) {
            return Ok(());
        }
        if begun.elapsed() > PATIENCE {
            let detail = behind.err().unwrap_or(detail);
            return Err(failed(format!("no success within {PATIENCE:?}: {detail}")));
        }
        tokio::time::sleep(pause).await;
        pause = (pause * 2).min(PAUSE_MAX);
    }
}

/// Follows the stream up to the last messages of a commit's units, as the leader knows them.
async fn catch_up(
    units: impl Iterator<Item = &Vec<u8>>,
    publisher: &Publisher,
    shared: &Arc<Shared>,
) -> Result<(), String> {
    for unit in units {
        let last = publisher.last_sequence(unit).await?;
        if last == 0 {
            shared.forget(unit);
            continue;
        }
        let reached = tokio::time::timeout(FOLLOW_WITHIN, shared.reach(last)).await;
        let late = |_| format!("followed to {}, expected {last}", shared.position());
        reached.map_err(late)?.map_err(|error| error.to_string())?;
    }
    Ok(())
}

/// Follows the stream up to its last message, as the leader knows it.
pub(super) async fn catch_up_all(
    publisher: &Publisher,
    shared: &Arc<Shared>,
) -> Result<(), EngineError> {
    let failed = |detail: String| EngineError::Failed { doing: "reading from the cluster", detail };
    let info = publisher.stream.get_info().await.map_err(|error| failed(error.to_string()))?;
    let last = info.state.last_sequence;
    let reached = tokio::time::timeout(FOLLOW_WITHIN, shared.reach(last)).await;
    let late = |_| failed(format!("followed to {}, expected {last}", shared.position()));
    reached.map_err(late)?
}

fn failed(detail: String) -> CommitError {
    EngineError::Failed { doing: "writing to the cluster", detail }.into()
}
