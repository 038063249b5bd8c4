//! The open sessions, most recently changed first.

use std::collections::BTreeSet;
use std::sync::Arc;

use palpate_schemas as wire;
use palpate_store::entity::Session;
use palpate_store::journal::{Entry, Event};

use super::Sessions;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::live::status;
use crate::wire::life::Status;
use crate::wire::{self as convert, count, time, within};

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
    /// The open sessions.
    pub(crate) async fn fleet(
        self: &Arc<Self>,
        query: wire::FleetQuery,
    ) -> Result<wire::Fleet, Cause> {
        let asked = query.limit.map_or(SESSIONS_MAX, u64::from);
        let limit = within("?limit", asked, 1, SESSIONS_MAX)? as usize;
        let sessions = Arc::clone(self);
        self.pool.place()?.run_long(move || sessions.fleet_now(limit)).await?
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
            let Ok(Some(session)) = self.store.sessions().find(id) else { continue };
            let status = status(&self.store, &session, now)?;
            if status.end.is_none() {
                open.push(OpenSession { session, status });
            }
        }
        Ok(open)
    }

    fn fleet_session(&self, one: OpenSession) -> Result<wire::FleetSession, Cause> {
        let OpenSession { session, status, .. } = one;
        let from = status.length.saturating_sub(READINGS);
        let entries = self.store.journal().entries(session.id, from, READINGS as usize)?;
        let is_reading = |entry: &&Entry| matches!(entry.event, Event::Reading(_));
        let newest = entries.iter().rev().find(is_reading);
        let ids = entries.iter().filter_map(|entry| entry.reading_id.as_ref());
        let robots: BTreeSet<&str> = ids.map(|id| id.robot.as_str()).collect();
        let catalogue = self.catalogues.name(session.catalogue)?;
        Ok(wire::FleetSession {
            robots: robots.into_iter().map(str::to_owned).collect(),
            last_reading_at: newest.map(|entry| time(entry.received_at_ms)),
            session: convert::session::session(&session, &catalogue, status, |key| {
                self.keys.writer(key)
            }),
        })
    }
}
