//! Sessions that another server of the same store created, changed, ended or deleted.

use std::sync::Arc;

use palpate_schemas::SessionEvent;
use uuid::Uuid;

use super::Sessions;
use crate::cause::Cause;
use crate::live::Live;
use crate::wire::life::opened_by;

impl Sessions {
    /// Looks again at a session that another server changed, and tells its followers here.
    pub(crate) fn heard(&self, id: Uuid) -> Result<(), Cause> {
        let live = || self.live.get(&id).map(|live| Arc::clone(&live));
        let Some(session) = self.tools.store.sessions().find(id)? else {
            if let Some(live) = live() {
                self.live.remove(&id);
                live.publish(SessionEvent::Deleted { session: id });
            }
            self.ids.remove(id);
            self.left_elsewhere(id);
            return Ok(());
        };
        self.ids.add(id);
        let status = self.status(&session)?;
        if status.end.is_none() {
            self.open.note(id, status.expires_ran_ms, opened_by(&session));
        } else if self.open.contains(id) {
            self.left_elsewhere(id);
            if let Some(live) = live() {
                let session = Box::new(self.show(&session)?);
                live.publish(SessionEvent::Closed { session });
            }
            return Ok(());
        }
        if let Some(live) = live().filter(|live| live.is_followed() && live.is_first_to_hear()) {
            tokio::spawn(tell(live));
        }
        Ok(())
    }

    /// Looks again at all sessions. Blocks.
    pub(crate) fn heard_all(&self) -> Result<(), Cause> {
        let known = self.open.page(None, usize::MAX - 1).0;
        let mut after = None;
        loop {
            let page =
                self.tools.store.sessions().list_whole(after, super::life::SESSIONS_PER_READ)?;
            page.items.iter().try_for_each(|session| self.heard(session.id))?;
            after = page.next;
            if after.is_none() {
                break;
            }
        }
        known.into_iter().try_for_each(|id| self.heard(id))
    }

    /// Registers the end of a session, which the other server counts to the health of its sensors.
    fn left_elsewhere(&self, id: Uuid) {
        self.open.leave(id);
        self.tools.traces.forget(id);
        self.tools.checkpoints.remove(id);
    }
}

async fn tell(live: Arc<Live>) {
    if let Err(error) = live.tell_followers().await {
        let id = live.session().id;
        tracing::debug!(session.id = %id, "Cannot form the belief of session {id} yet: {error}");
    }
}
