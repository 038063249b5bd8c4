//! The end of a session: closing, deletion, and comparison of its belief with the truth.

use palpate_schemas as wire;
use palpate_store::database::Database;
use palpate_store::journal::{Event, NewEntry};

use super::error::LiveError;
use super::{Live, Tools, answer};
use crate::asker::Asker;
use crate::clock::now_ms;

impl Live {
    /// Closes the session with the last entry of its journal. Closing it again changes nothing.
    pub(crate) async fn close(&self, store: &Database) -> Result<(), LiveError> {
        let _turn = self.turns.insist().await;
        let now = now_ms();
        let status = self.status(store, now)?;
        if status.end.is_some() {
            return Ok(());
        }
        let (event, written_by) = (Event::Closed, Asker::current().key());
        let closed = NewEntry { reading_id: None, received_at_ms: now, event, written_by };
        store.journal().append(self.session.id, status.length, &[closed]).await?;
        let table = store.sessions();
        let noted = table.update(self.session.id, |session| {
            session.closed_at_ms = Some(now);
            Ok::<(), LiveError>(())
        });
        noted.await??;
        Ok(())
    }

    /// Deletes the session while no other request uses it.
    pub(crate) async fn delete(&self, store: &Database) -> Result<(), LiveError> {
        let _turn = self.turns.insist().await;
        store.remove_session(self.session.id).await?;
        Ok(())
    }

    /// Compares the belief with the true object; `None` is an object outside the catalogue.
    pub(crate) async fn judge(
        &self,
        tools: &Tools<'_>,
        truth: Option<usize>,
    ) -> Result<wire::Truth, LiveError> {
        let mut state = self.turns.insist().await;
        let length = tools.store.journal().len(self.session.id)?;
        let place = tools.pool.place()?;
        let answer =
            self.ask(&mut state, self.folding(tools, Vec::new()), place, length, answer(0)).await?;
        let probability = match truth {
            Some(object) => answer.probabilities[object],
            None => answer.unknown,
        };
        let others = answer.probabilities.iter().enumerate();
        let others = others.filter(|(object, _)| Some(*object) != truth).map(|(_, p)| *p);
        let unknown = truth.map(|_| answer.unknown);
        let was_right = others.chain(unknown).all(|other| probability > other);
        let object = truth.map(|object| &self.model.objects[object]);
        Ok(wire::Truth {
            object: object.map(|object| object.id),
            name: object.map(|object| object.name.clone()),
            probability,
            was_right,
        })
    }
}
