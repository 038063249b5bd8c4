//! Questions about a session: its belief, marginals and next touches, its replay and
//! explanation, and its later events.

use std::sync::Arc;
use std::time::Instant;

use palpate_schemas as wire;
use palpate_schemas::SessionEvent;
use tokio::sync::broadcast;
use uuid::Uuid;

use super::{SessionError, Sessions, finished};
use crate::asker;
use crate::cause::Cause;
use crate::live::{Live, POSES, ReplayQuestion};
use crate::wire::{next_touch, within};

/// Maximum number of pose hypotheses in an answer.
const POSES_MAX: u64 = 100;
/// Default number of steps of a replay.
const STEPS: u32 = 100;
/// Maximum number of steps of an answer.
const STEPS_MAX: u64 = 1000;

impl Sessions {
    /// The present belief or that after some readings; `None` when it is that of `known_revision`.
    pub(crate) async fn belief(
        &self,
        id: &str,
        query: wire::BeliefQuery,
        known_revision: Option<u64>,
    ) -> Result<Option<wire::Belief>, SessionError> {
        let poses = poses(query.poses)?;
        let live = self.live(self.parse(id)?).await?;
        match query.at {
            Some(at) => Ok(live.belief_at(poses, u64::from(at), known_revision).await?),
            None => present(live, poses, known_revision).await,
        }
    }

    /// The present marginals of an object's pose; `None` when they are those of `known_revision`.
    pub(crate) async fn marginals(
        &self,
        id: &str,
        query: wire::MarginalsQuery,
        known_revision: Option<u64>,
    ) -> Result<Option<wire::Marginals>, SessionError> {
        let live = self.live(self.parse(id)?).await?;
        let object = query.object;
        let asking = async move { live.marginals(object.as_deref(), known_revision).await };
        finished(asker::spawn(asking)).await
    }

    /// The best next touches by the present belief.
    pub(crate) async fn next_touches(
        &self,
        id: &str,
        asked: &wire::AskNextTouches,
    ) -> Result<wire::NextTouches, SessionError> {
        let begun = Instant::now();
        let live = self.live(self.parse(id)?).await?;
        let sensor = self.sensors.known().find(&asked.sensor)?;
        let question = next_touch::question(asked, sensor.as_deref())?;
        finished(asker::spawn(async move { live.next_touches(question, begun).await })).await
    }

    /// The beliefs of a session, revision by revision.
    pub(crate) async fn replay(
        &self,
        id: &str,
        query: wire::ReplayQuery,
    ) -> Result<wire::Replay, SessionError> {
        let limit = within("?limit", u64::from(query.limit.unwrap_or(STEPS)), 1, STEPS_MAX)?;
        let poses = poses(query.poses)?;
        let upto = query.upto.map(u64::from);
        let after = u64::from(query.after.unwrap_or(0));
        let question = ReplayQuestion { upto, after, limit, poses };
        let live = self.live(self.parse(id)?).await?;
        Ok(live.replay(question).await?)
    }

    /// The contribution of each reading to a session's belief.
    pub(crate) async fn explain(
        &self,
        id: &str,
        query: wire::ExplainQuery,
    ) -> Result<wire::Explanation, SessionError> {
        let live = self.live(self.parse(id)?).await?;
        Ok(live.explain(query.at.map(u64::from)).await?)
    }

    /// Later events of a session, and its present belief.
    pub(crate) async fn follow(
        &self,
        id: Uuid,
        known_revision: Option<u64>,
    ) -> Result<(Option<wire::Belief>, broadcast::Receiver<SessionEvent>), SessionError> {
        let live = self.live(id).await?;
        let events = live.subscribe();
        Ok((present(live, POSES, known_revision).await?, events))
    }
}

/// The present belief; `None` when it is that of `known_revision`.
async fn present(
    live: Arc<Live>,
    poses: usize,
    known_revision: Option<u64>,
) -> Result<Option<wire::Belief>, SessionError> {
    finished(asker::spawn(async move { live.belief(poses, known_revision).await })).await
}

/// Maximum number of poses of an answer.
fn poses(asked: Option<u32>) -> Result<usize, Cause> {
    let asked = asked.map_or(POSES as u64, u64::from);
    Ok(within("?poses", asked, 0, POSES_MAX)? as usize)
}
