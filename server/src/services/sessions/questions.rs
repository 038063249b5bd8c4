//! Questions about a session: its belief, marginals and next touches, its replay and
//! explanation, and its later events.

use std::sync::Arc;
use std::time::Instant;

use palpate_schemas as wire;
use palpate_schemas::{SessionEvent, SessionState};
use tokio::sync::broadcast;
use uuid::Uuid;

use super::{SessionError, Sessions, finished};
use crate::asker;
use crate::cause::Cause;
use crate::etag::Tags;
use crate::live::{Live, POSES, ReplayQuestion};
use crate::wire::{next_touch, within};

/// Maximum number of pose hypotheses in an answer.
const POSES_MAX: u64 = 100;
/// Default number of steps of a replay.
const STEPS: u32 = 100;
/// Maximum number of steps of an answer.
const STEPS_MAX: u64 = 1000;

impl Sessions {
    /// The revision of the present belief, or of that after some readings; and the belief, unless
    /// its tag is known.
    pub(crate) async fn belief(
        &self,
        id: &str,
        query: wire::BeliefQuery,
        known: &Tags,
    ) -> Result<(u64, Option<wire::Belief>), SessionError> {
        let poses = poses(query.poses)?;
        let live = self.live(self.parse(id)?).await?;
        let revision = live.revision("?at", query.at.map(u64::from))?;
        if known.has(&revision.to_string()) {
            return Ok((revision, None));
        }
        let belief = match query.at {
            Some(at) => live.belief_at(poses, u64::from(at)).await?,
            None => present(live, poses).await?,
        };
        Ok((u64::from(belief.revision), Some(belief)))
    }

    /// The revision of the present marginals of an object's pose; and these, unless its tag is
    /// known.
    pub(crate) async fn marginals(
        &self,
        id: &str,
        query: wire::MarginalsQuery,
        known: &Tags,
    ) -> Result<(u64, Option<wire::Marginals>), SessionError> {
        let live = self.live(self.parse(id)?).await?;
        let revision = live.revision("", None)?;
        if known.has(&revision.to_string()) {
            return Ok((revision, None));
        }
        let object = query.object;
        let asking = async move { live.marginals(object.as_deref()).await };
        let marginals = finished(asker::spawn(asking)).await?;
        Ok((u64::from(marginals.revision), Some(marginals)))
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

    /// The events that tell a session's state to a follower that knows a revision, or nothing; and
    /// its later events.
    pub(crate) async fn follow(
        &self,
        id: Uuid,
        known_revision: Option<u64>,
    ) -> Result<(Vec<SessionEvent>, broadcast::Receiver<SessionEvent>), SessionError> {
        let live = self.live(id).await?;
        // What comes from now on is in both, rather than in none.
        let events = live.subscribe();
        let mut now = Vec::new();
        if known_revision != Some(live.revision("", None)?) {
            now.push(SessionEvent::Belief { belief: present(live, POSES).await? });
        }
        let session = self.show(&self.tools.store.sessions().get(id)?)?;
        if session.state != SessionState::Open {
            now.push(SessionEvent::Closed { session: Box::new(session) });
        }
        Ok((now, events))
    }
}

/// The present belief.
async fn present(live: Arc<Live>, poses: usize) -> Result<wire::Belief, SessionError> {
    finished(asker::spawn(async move { live.belief(poses).await })).await
}

/// Maximum number of poses of an answer.
fn poses(asked: Option<u32>) -> Result<usize, Cause> {
    let asked = asked.map_or(POSES as u64, u64::from);
    Ok(within("?poses", asked, 0, POSES_MAX)? as usize)
}
