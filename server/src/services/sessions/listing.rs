//! Lists of sessions, searched and in either order, and the readings of one.

use palpate_schemas as wire;
use palpate_store::error::StoreError;
use palpate_store::journal::{Event, Limit};
use palpate_store::running::Running;
use palpate_store::table::LOOKED_AT_MAX;
use uuid::Uuid;

use super::Sessions;
use super::search::Search;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::live::status;
use crate::wire::{PAGE_BYTES, cursor, page_id, page_length, page_number, reading};

/// Number of ids that are looked up at once.
const IDS_PER_PAGE: usize = 4096;

impl Sessions {
    pub(crate) fn get(&self, id: &str) -> Result<wire::Session, Cause> {
        let session = self.find(id)?;
        Ok(self.show(&session)?)
    }

    /// A page of the sessions that fit. Looks at [`LOOKED_AT_MAX`] sessions at most.
    pub(crate) fn list(&self, query: wire::SessionsQuery) -> Result<wire::SessionPage, Cause> {
        let page = wire::PageQuery { limit: query.limit, cursor: query.cursor.clone() };
        let (after, limit) = (page_id(&page)?, page_length(&page)?);
        let (search, running) = (Search::new(query)?, self.tools.store.running(now_ms()));
        let mut range = search.range();
        range = after.map_or(range, |after| range.behind(after));
        let (mut items, mut n_looked_at) = (Vec::new(), 0);
        loop {
            let ids = self.ids.page(range, IDS_PER_PAGE);
            let Some(last) = ids.last().copied() else {
                return Ok(wire::SessionPage { items, next_cursor: None });
            };
            for id in ids {
                if search.is_of_open() && !self.open.contains(id) {
                    continue;
                }
                n_looked_at += 1;
                let shown = self.shown_of(id, &running)?;
                items.extend(shown.filter(|session| search.fits(session)));
                if items.len() == limit || n_looked_at == LOOKED_AT_MAX {
                    let is_more = !self.ids.page(range.behind(id), 1).is_empty();
                    let next_cursor = cursor(is_more.then_some(id));
                    return Ok(wire::SessionPage { items, next_cursor });
                }
            }
            range = range.behind(last);
        }
    }

    /// A session in its wire form; `None` if it was deleted, or is damaged, which is logged.
    fn shown_of(&self, id: Uuid, running: &Running) -> Result<Option<wire::Session>, Cause> {
        let shown = self.tools.store.sessions().find(id).and_then(|found| {
            let shown = |session| {
                let status = status(&self.tools.store, &session, running)?;
                self.show_as(&session, status)
            };
            found.map(shown).transpose()
        });
        match shown {
            Err(error @ StoreError::Damaged { .. }) => {
                tracing::error!(session.id = %id, "Left session {id} out of a list: {error}");
                Ok(None)
            }
            other => Ok(other?),
        }
    }

    /// A session's readings in order of arrival, withdrawn ones included.
    pub(crate) fn readings(
        &self,
        id: &str,
        query: &wire::PageQuery,
    ) -> Result<wire::SessionReadingPage, Cause> {
        let session = self.find(id)?.id;
        let (from, limit) = (page_number(query)?, page_length(query)?);
        let journal = self.tools.store.journal();
        let withdrawn = journal.retractions(session)?;
        let limit = Limit { records: limit, bytes: PAGE_BYTES };
        let entries = journal.page(session, from, limit)?;
        let next = from + entries.len() as u64;
        let mut items = Vec::with_capacity(entries.len());
        for entry in &entries {
            let by = withdrawn.get(&entry.seq).map(|by| journal.entry(session, *by));
            let by = by.transpose()?.flatten();
            let corrected = match &entry.event {
                Event::Reading(reading) => self.tools.sensors.pose(reading)?,
                Event::Retraction { .. } | Event::Closed => None,
            };
            let writer = |key| self.keys.writer(key);
            items.extend(reading::of_session(entry, by.as_ref(), corrected, writer));
        }
        let is_last = next >= journal.len(session)?;
        Ok(wire::SessionReadingPage { items, next_cursor: (!is_last).then(|| next.to_string()) })
    }
}
