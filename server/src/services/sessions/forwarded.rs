//! Sessions that cells forward to this server.

use std::sync::Arc;

use palpate_schemas as wire;
use palpate_store::error::StoreError;

use super::fits::fits;
use super::{SessionError, Sessions};
use crate::asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::live::{Live, LiveError};
use crate::wire::session::{Limits, options};
use crate::wire::{self as convert, forwarding};

impl Sessions {
    /// Creates a session of a cell under its id, or finds it.
    pub(crate) async fn forward(
        self: &Arc<Self>,
        id: &str,
        request: &wire::ForwardSession,
    ) -> Result<wire::Session, SessionError> {
        let id = forwarding::session_id(id)?;
        let (name, version, asked) = forwarding::settings(request)?;
        if let Some(known) = self.tools.store.sessions().find(id)? {
            return match options(&known).cell {
                Some(cell) if cell == request.cell => Ok(self.show(&known)?),
                Some(cell) => Err(LiveError::OfCell { session: id, cell }.into()),
                None => Err(LiveError::NotForwarded { session: id }.into()),
            };
        }
        forwarding::check_time(id, now_ms())?;
        let _using = self.catalogues.using().await;
        self.catalogues.expect_hash(name, version, &request.version_hash)?;
        let pinned = self.catalogues.pin(name, Some(version), None)?;
        let method = convert::session::method(&asked, pinned.has_surfaces);
        let model = self.model(pinned.catalogue, pinned.version, method).await?;
        let limits = Limits {
            time_to_live: self.time_to_live,
            now_ms: forwarding::created_at_ms(id),
            opened_by: asker::Asker::current().key(),
        };
        let session = convert::session::new_session(&asked, method, &model, id, limits)?;
        let session = forwarding::of_cell(session, &request.cell);
        fits(&session, &model, self.belief_bytes_max)?;
        match self.begin(session, model).await {
            // Another request of the cell was faster.
            Err(SessionError::Cause(Cause::Store(StoreError::Exists { .. }))) => {
                Ok(self.show(&self.tools.store.sessions().get(id)?)?)
            }
            begun => begun,
        }
    }

    /// Stores entries of a cell's session, all or none.
    pub(crate) async fn forward_entries(
        self: &Arc<Self>,
        id: &str,
        request: &wire::ForwardEntries,
    ) -> Result<wire::EntriesForwarded, SessionError> {
        let given = forwarding::readings(request)?;
        let (from, list) = (u64::from(request.from), ("/entries", request.entries.len()));
        let forward = |live: Arc<Live>, readings| {
            let entries = forwarding::entries(request, readings);
            async move {
                let forwarded = live.forward(from, &entries.map_err(Cause::from)?).await?;
                Ok::<_, LiveError>((u64::from(forwarded.n_new), forwarded))
            }
        };
        let (mut forwarded, warnings) = self.take_in(id, list, &given, forward).await?;
        forwarded.warnings.extend(warnings);
        forwarding::point_to_entries(&mut forwarded.warnings, &given);
        Ok(forwarded)
    }
}
