//! Sessions that this cell forwards: what the central service is to get of each.

use palpate_schemas as wire;
use palpate_store::entity::Session;
use palpate_store::journal::Limit;
use uuid::Uuid;

use super::{SessionError, Sessions};
use crate::cause::Cause;
use crate::wire::forwarding;
use crate::wire::session::{ForwardMark, options};

/// Number of entries of one request, and their stored bytes: a bad line carries it in seconds.
const ENTRIES: Limit = Limit { records: 200, bytes: 128 << 10 };

/// A session as the central service is to get it.
#[derive(Clone, Debug)]
pub(crate) struct OutgoingSession {
    pub(crate) request: wire::ForwardSession,
    /// Number of readings and retractions.
    pub(crate) n_entries: u64,
    /// How to close it; `None` while it is open.
    pub(crate) closing: Option<wire::CloseSession>,
    pub(crate) mark: ForwardMark,
    /// Number of its changes before it was read.
    pub(crate) n_changes: u64,
}

impl Sessions {
    /// Whether all of a session is at the central service, or this server is no cell.
    pub(super) fn is_forwarded(&self, session: &Session) -> bool {
        let Some(forward) = self.outgoing.forward() else { return true };
        options(session).forwarded == Some(forwarding::mark(session, &forward.to))
    }

    /// Notes a session that waits at the start.
    pub(super) fn note_unforwarded(&self, session: &Session) -> Result<(), Cause> {
        if !self.is_forwarded(session) {
            let length = self.tools.store.journal().len(session.id)?;
            self.outgoing.note_since(session.id, length, session.created_at_ms);
        }
        Ok(())
    }

    /// A waiting session; `None` if it was deleted or this server is no cell. Blocks.
    pub(crate) fn outgoing(&self, id: Uuid) -> Result<Option<OutgoingSession>, SessionError> {
        let n_changes = self.outgoing.n_changes(id);
        let Some(forward) = self.outgoing.forward() else { return Ok(None) };
        let Some(session) = self.tools.store.sessions().find(id)? else {
            self.outgoing.forget(id);
            return Ok(None);
        };
        let is_closed = self.tools.store.journal().head(id)?.is_closed;
        let status = self.status(&session)?;
        let name = self.catalogues.name(session.catalogue)?;
        let hash = self.catalogues.hash(&name, session.version)?;
        Ok(Some(OutgoingSession {
            request: forwarding::request(&session, name, (&forward.cell, hash)),
            n_entries: status.length - u64::from(is_closed),
            closing: status.end.map(|_| forwarding::closing(&session)),
            mark: forwarding::mark(&session, &forward.to),
            n_changes,
        }))
    }

    /// Entries of a session from a number on, as many as one request takes. Blocks.
    pub(crate) fn outgoing_entries(
        &self,
        id: Uuid,
        from: u64,
    ) -> Result<Vec<wire::ForwardedEntry>, SessionError> {
        let entries = self.tools.store.journal().page(id, from, ENTRIES)?;
        let mut shown = Vec::with_capacity(entries.len());
        for entry in &entries {
            let mut name = String::new();
            if let palpate_store::journal::Event::Reading(reading) = &entry.event {
                name.clone_from(&self.tools.sensors.get(&reading.sensor.to_string())?.name);
            }
            shown.extend(forwarding::entry(entry, |_| name.clone()));
        }
        Ok(shown)
    }

    /// Records that a session is at the central service as it was when it was read.
    pub(crate) async fn note_forwarded(
        &self,
        id: Uuid,
        sent: &OutgoingSession,
    ) -> Result<(), SessionError> {
        if sent.closing.is_some() {
            let table = self.tools.store.essential().sessions();
            let marked = table.update(id, |session| {
                forwarding::set_mark(session, &sent.mark);
                Ok::<(), SessionError>(())
            });
            marked.await??;
        }
        self.outgoing.forwarded(id, sent.n_changes);
        Ok(())
    }
}
