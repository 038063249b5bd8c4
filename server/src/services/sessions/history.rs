//! Readings of sessions, their retraction, replay and explanation.

use std::sync::Arc;

use palpate_schemas as wire;
use palpate_schemas::BeliefDetail;
use palpate_store::entity::ReadingId;
use palpate_store::error::StoreError;
use palpate_store::journal::Limit;
use uuid::Uuid;

use super::error::SessionError;
use super::{Sessions, finished, poses};
use crate::asker;
use crate::cause::Cause;
use crate::live::ReplayQuestion;
use crate::wire::{PAGE_BYTES, page_length, page_number, reading, within};

/// Default number of steps of a replay.
const STEPS: u32 = 100;
/// Maximum number of steps of an answer.
const STEPS_MAX: u64 = 1000;

impl Sessions {
    /// A session's readings in order of arrival, withdrawn ones included.
    pub(crate) fn readings(
        &self,
        id: &str,
        query: &wire::PageQuery,
    ) -> Result<wire::SessionReadingPage, Cause> {
        let session = self.find(id)?.id;
        let (from, limit) = (page_number(query)?, page_length(query)?);
        let journal = self.store.journal();
        let withdrawn = journal.retractions(session)?;
        let limit = Limit { records: limit, bytes: PAGE_BYTES };
        let entries = journal.page(session, from, limit)?;
        let next = from + entries.len() as u64;
        let mut items = Vec::with_capacity(entries.len());
        for entry in &entries {
            let by = withdrawn.get(&entry.seq).map(|by| journal.entry(session, *by));
            let by = by.transpose()?.flatten();
            items.extend(reading::of_session(entry, by.as_ref(), |key| self.keys.writer(key)));
        }
        let is_last = next >= journal.len(session)?;
        Ok(wire::SessionReadingPage { items, next_cursor: (!is_last).then(|| next.to_string()) })
    }

    /// Withdraws the reading with a number within the session.
    pub(crate) async fn retract(
        self: &Arc<Self>,
        id: &str,
        number: &str,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, SessionError> {
        let session = self.find(id)?.id;
        self.retract_number(session, number.parse().map_err(|_| no_reading(number))?, detail).await
    }

    /// Withdraws the reading with a robot's number.
    pub(crate) async fn retract_of_robot(
        self: &Arc<Self>,
        id: &str,
        robot: &str,
        seq: &str,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, SessionError> {
        let session = self.find(id)?.id;
        let unknown = || no_reading(&format!("{robot}/{seq}"));
        let seq = seq.parse().map_err(|_| unknown())?;
        let reading_id = ReadingId { robot: robot.to_owned(), seq };
        let number = self.number(session, &reading_id)?.ok_or_else(unknown)?;
        self.retract_number(session, number, detail).await
    }

    /// The entry with a robot's number: of the caller's own key, else of the key that owns
    /// the robot's name.
    fn number(&self, session: Uuid, id: &ReadingId) -> Result<Option<u64>, StoreError> {
        let journal = self.store.journal();
        let own = journal.find(session, id, asker::Asker::current().key())?;
        if own.is_some() {
            return Ok(own);
        }
        journal.find(session, id, self.keys.holder(&id.robot))
    }

    /// The beliefs of a session, revision by revision.
    pub(crate) async fn replay(
        self: &Arc<Self>,
        id: &str,
        query: wire::ReplayQuery,
    ) -> Result<wire::Replay, SessionError> {
        let limit = within("?limit", u64::from(query.limit.unwrap_or(STEPS)), 1, STEPS_MAX)?;
        let poses = poses(query.poses)?;
        let upto = query.upto.map(u64::from);
        let after = u64::from(query.after.unwrap_or(0));
        let question = ReplayQuestion { upto, after, limit, poses };
        let live = self.live(self.parse(id)?).await?;
        Ok(live.replay(&self.tools(), question).await?)
    }

    /// The contribution of each reading to a session's belief.
    pub(crate) async fn explain(
        self: &Arc<Self>,
        id: &str,
        query: wire::ExplainQuery,
    ) -> Result<wire::Explanation, SessionError> {
        let live = self.live(self.parse(id)?).await?;
        Ok(live.explain(&self.tools(), query.at.map(u64::from)).await?)
    }

    async fn retract_number(
        self: &Arc<Self>,
        session: Uuid,
        number: u64,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, SessionError> {
        let live = self.live(session).await?;
        let sessions = Arc::clone(self);
        let task =
            asker::spawn(async move { live.retract(&sessions.tools(), number, detail).await });
        finished(task).await
    }
}

fn no_reading(reference: &str) -> Cause {
    Cause::NotFound { what: "reading", reference: reference.to_owned() }
}
