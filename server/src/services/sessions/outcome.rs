//! Stored outcome of ended sessions, and labels of sessions.
//!
//! Closing a session stores its outcome with its end. A session that expires, or whose last readings
//! came with `belief=none`, gets its outcome in the background.

use std::sync::Arc;

use palpate_schemas as wire;
use palpate_store::entity::Session;

use super::health::READINGS_MAX;
use super::{SessionError, Sessions, is_idle};
use crate::live::outcome::outcome;
use crate::wire::labels;
use crate::wire::life::{EndReason, Status};
use crate::wire::session::{options, set_labels, set_outcome};

impl Sessions {
    /// Replaces a session's labels.
    pub(crate) async fn label(
        &self,
        id: &str,
        asked: wire::SetLabels,
    ) -> Result<wire::Session, SessionError> {
        let id = self.find(id)?.id;
        labels::checked(&asked.labels)?;
        let table = self.tools.store.sessions();
        let changed = table.update(id, |session| {
            set_labels(session, &asked.labels);
            Ok::<(), SessionError>(())
        });
        let changed = changed.await??;
        self.outgoing.note(id, 0);
        Ok(self.show(&changed)?)
    }

    /// Stores the outcome of a session that ended without one. Beliefs that cost much are not
    /// formed for it.
    pub(super) async fn keep_outcome(
        self: &Arc<Self>,
        session: &Session,
        status: &Status,
    ) -> Result<(), SessionError> {
        let (id, options) = (session.id, options(session));
        if options.outcome.is_some() {
            return Ok(());
        }
        let is_closed = status.end.is_some_and(|end| end.reason == EndReason::Closed);
        let revision = status.length - u64::from(is_closed);
        let mut outcome = outcome(&self.tools, id, revision)?;
        let was_live = self.live.contains_key(&id);
        let is_costly = !was_live && (revision > READINGS_MAX || options.method.is_geometric());
        if outcome.latest.is_none() && status.n_readings > 0 && !is_costly {
            let live = self.live(id).await?;
            let place = self.place().await?;
            outcome.latest = Some(live.last_point(place).await?.shown());
            drop(live);
            if !was_live {
                self.live.remove_if(&id, |_, live| is_idle(live));
            }
        }
        let table = self.tools.store.essential().sessions();
        let changed = table.update(id, |session| {
            set_outcome(session, &outcome);
            Ok::<(), SessionError>(())
        });
        changed.await??;
        Ok(())
    }
}
