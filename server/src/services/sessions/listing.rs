//! Lists of sessions: all by their ids, the open ones by their last change, and the readings of
//! one.

use std::collections::BTreeSet;
use std::sync::Arc;

use palpate_schemas as wire;
use palpate_schemas::SessionState;
use palpate_store::entity::Session;
use palpate_store::journal::{Entry, Event, Limit};
use uuid::Uuid;

use super::Sessions;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::live::status;
use crate::wire::life::Status;
use crate::wire::{
    PAGE_BYTES, count, cursor, page_id, page_length, page_number, reading, time, within,
};

/// Maximum number of sessions in an answer: as many as one stream of events follows.
const SESSIONS_MAX: u64 = 100;
/// Number of newest readings whose robots are named.
const READINGS: u64 = 64;

/// An open session and its status.
struct OpenSession {
    session: Session,
    status: Status,
}

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

    /// The open sessions.
    pub(crate) async fn fleet(
        self: &Arc<Self>,
        query: wire::FleetQuery,
    ) -> Result<wire::Fleet, Cause> {
        let asked = query.limit.map_or(SESSIONS_MAX, u64::from);
        let limit = within("?limit", asked, 1, SESSIONS_MAX)? as usize;
        let sessions = Arc::clone(self);
        self.tools.pool.place()?.run_long(move || sessions.fleet_now(limit)).await?
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

    fn fleet_now(&self, limit: usize) -> Result<wire::Fleet, Cause> {
        let now = now_ms();
        let mut open = self.open_now(now)?;
        let n_open = count(open.len());
        // Among sessions changed in one millisecond, those with entries changed after they began.
        let newest =
            |one: &OpenSession| (one.status.changed_at_ms, one.status.length > 0, one.session.id);
        open.sort_by_key(|one| std::cmp::Reverse(newest(one)));
        let sessions: Result<_, _> =
            open.into_iter().take(limit).map(|one| self.fleet_session(one)).collect();
        Ok(wire::Fleet { at: time(now), n_open, sessions: sessions? })
    }

    fn open_now(&self, now: u64) -> Result<Vec<OpenSession>, Cause> {
        let mut open = Vec::new();
        for id in self.open.page(None, usize::MAX).0 {
            // A session deleted or damaged meanwhile is not open any more.
            let Ok(Some(session)) = self.tools.store.sessions().find(id) else { continue };
            let status = status(&self.tools.store, &session, now)?;
            if status.end.is_none() {
                open.push(OpenSession { session, status });
            }
        }
        Ok(open)
    }

    fn fleet_session(&self, one: OpenSession) -> Result<wire::FleetSession, Cause> {
        let OpenSession { session, status, .. } = one;
        let from = status.length.saturating_sub(READINGS);
        let entries = self.tools.store.journal().entries(session.id, from, READINGS as usize)?;
        let is_reading = |entry: &&Entry| matches!(entry.event, Event::Reading(_));
        let newest = entries.iter().rev().find(is_reading);
        let ids = entries.iter().filter_map(|entry| entry.reading_id.as_ref());
        let robots: BTreeSet<&str> = ids.map(|id| id.robot.as_str()).collect();
        Ok(wire::FleetSession {
            robots: robots.into_iter().map(str::to_owned).collect(),
            last_reading_at: newest.map(|entry| time(entry.received_at_ms)),
            session: self.show_as(&session, status)?,
        })
    }
}
