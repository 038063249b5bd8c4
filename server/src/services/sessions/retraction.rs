//! Retractions of readings, by their number within the session or by a robot's number.

use std::sync::Arc;

use palpate_schemas as wire;
use palpate_schemas::BeliefDetail;
use palpate_store::entity::ReadingId;
use palpate_store::error::StoreError;
use uuid::Uuid;

use super::{SessionError, Sessions, finished};
use crate::asker;
use crate::cause::Cause;

impl Sessions {
    /// Withdraws the reading with a number within the session.
    pub(crate) async fn retract(
        &self,
        id: &str,
        number: &str,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, SessionError> {
        let session = self.find(id)?.id;
        let number = number.parse().map_err(|_| Cause::unknown("reading", number))?;
        self.retract_number(session, number, detail).await
    }

    /// Withdraws the reading with a robot's number.
    pub(crate) async fn retract_of_robot(
        &self,
        id: &str,
        robot: &str,
        seq: &str,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, SessionError> {
        let session = self.find(id)?.id;
        let unknown = || Cause::unknown("reading", format!("{robot}/{seq}"));
        let seq = seq.parse().map_err(|_| unknown())?;
        let reading_id = ReadingId { robot: robot.to_owned(), seq };
        let number = self.number(session, &reading_id)?.ok_or_else(unknown)?;
        self.retract_number(session, number, detail).await
    }

    /// The entry with a robot's number: of the caller's own key, else of the key that owns
    /// the robot's name.
    fn number(&self, session: Uuid, id: &ReadingId) -> Result<Option<u64>, StoreError> {
        let journal = self.tools.store.journal();
        let own = journal.find(session, id, asker::Asker::current().key())?;
        if own.is_some() {
            return Ok(own);
        }
        journal.find(session, id, self.keys.holder(&id.robot))
    }

    async fn retract_number(
        &self,
        session: Uuid,
        number: u64,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, SessionError> {
        let live = self.live(session).await?;
        let outgoing = Arc::clone(&self.outgoing);
        let retracting = asker::spawn(async move {
            let retracted = live.retract(number, detail).await;
            outgoing.note(session, u64::from(retracted.is_ok()));
            retracted
        });
        finished(retracting).await
    }
}
