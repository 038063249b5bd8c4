//! Lists of sessions by their ids, and the readings of one.

use palpate_schemas as wire;
use palpate_schemas::SessionState;
use palpate_store::journal::{Event, Limit};
use uuid::Uuid;

use super::Sessions;
use crate::cause::Cause;
use crate::wire::{PAGE_BYTES, cursor, page_id, page_length, page_number, reading};

impl Sessions {
    pub(crate) fn get(&self, id: &str) -> Result<wire::Session, Cause> {
        let session = self.find(id)?;
        Ok(self.show(&session)?)
    }

    pub(crate) fn list(&self, query: &wire::SessionsQuery) -> Result<wire::SessionPage, Cause> {
        let page = wire::PageQuery { limit: query.limit, cursor: query.cursor.clone() };
        let (mut after, limit) = (page_id(&page)?, page_length(&page)?);
        if query.state == Some(SessionState::Open) {
            return self.list_open(after, limit);
        }
        let mut items = Vec::new();
        loop {
            let page = self.tools.store.sessions().list_whole(after, limit - items.len())?;
            for session in &page.items {
                let shown = self.show(session)?;
                if query.state.is_none_or(|state| shown.state == state) {
                    items.push(shown);
                }
            }
            after = page.next;
            if items.len() == limit || after.is_none() {
                return Ok(wire::SessionPage { items, next_cursor: cursor(after) });
            }
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

    fn list_open(&self, after: Option<Uuid>, limit: usize) -> Result<wire::SessionPage, Cause> {
        let (ids, more) = self.open.page(after, limit);
        let next_cursor = cursor(ids.last().copied().filter(|_| more));
        let mut items = Vec::with_capacity(ids.len());
        for id in ids {
            let Some(session) = self.tools.store.sessions().find(id)? else { continue };
            items.push(self.show(&session)?);
        }
        items.retain(|session| session.state == SessionState::Open);
        Ok(wire::SessionPage { items, next_cursor })
    }
}
