//! Retraction of a reading, which stays in the journal and no longer counts.

use palpate_schemas as wire;
use palpate_schemas::BeliefDetail;
use palpate_store::journal::{Event, NewEntry};

use super::error::LiveError;
use super::{Live, POSES, Tools, past, shown};
use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::wire::count;

impl Live {
    /// Withdraws the reading that is entry `number` of the journal, and returns the belief
    /// without it. A repetition changes nothing and gives the same answer.
    pub(crate) async fn retract(
        &self,
        tools: &Tools<'_>,
        number: u64,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, LiveError> {
        let mut state = self.turns.take().await?;
        let now = now_ms();
        let (session, journal) = (self.session.id, tools.store.journal());
        let status = self.status(tools.store, now)?;
        let entry = journal.entry(session, number)?;
        if !entry.is_some_and(|entry| matches!(entry.event, Event::Reading(_))) {
            return Err(Cause::NotFound { what: "reading", reference: number.to_string() }.into());
        }
        let before = journal.retraction(session, number)?;
        if let Some(end) = status.end.filter(|_| before.is_none()) {
            return Err(LiveError::Ended { session, end });
        }
        let place = self.place(tools, detail)?;
        if before.is_none() {
            let event = Event::Retraction { seq: number };
            let written_by = Asker::current().key();
            let entry = NewEntry { reading_id: None, received_at_ms: now, event, written_by };
            journal.append(session, status.length, &[entry]).await?;
            tracing::info!(session.id = %session, reading.number = number,
                "Withdrew reading {number} of session {session}");
        }
        let is_new = before.is_none();
        let revision = before.unwrap_or(status.length) + 1;
        let belief = match place {
            None => None,
            Some(place) if is_new => Some(
                self.renew(&mut state, self.folding(tools, Vec::new()), place, revision).await?,
            ),
            Some(place) => {
                let start = past::start(&state.memory, revision);
                Some(self.past(tools, place, revision, POSES, start).await?)
            }
        };
        Ok(wire::ReadingRetracted {
            session,
            number: count(number),
            revision: count(revision),
            n_readings: count(status.n_readings - u64::from(is_new)),
            belief: shown(belief, detail),
        })
    }
}
