//! The fleet: the open sessions, those that need attention first, and what operators do to many
//! of them at once.

use std::sync::Arc;

use futures::stream::{self, StreamExt};
use palpate_schemas as wire;
use palpate_store::entity::Session;
use palpate_store::journal::{Entry, Event};
use uuid::Uuid;

use super::attention::{Handled, Judgement, Rank, Seen, judge};
use super::search::has_words;
use super::{SessionError, Sessions};
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::live::trace::Point;
use crate::live::{LiveError, status};
use crate::wire::life::{Status, set_acknowledged};
use crate::wire::session::options;
use crate::wire::{Invalid, count, time, within};

/// Maximum number of sessions in an answer: as many as one stream of events follows.
const SESSIONS_MAX: u64 = 100;
/// Maximum length of a search, characters.
const SEARCH_MAX: usize = 200;
/// Number of newest entries among which the newest reading is looked for.
const READINGS: u64 = 64;
/// Maximum time of a mute, seconds: a week.
const MUTE_MAX_S: u64 = 604_800;
/// Number of sessions changed at once: their writes share a flush.
const AT_ONCE: usize = 16;

/// An open session, its status, and the attention that it needs.
pub(super) struct OpenSession {
    pub(super) session: Session,
    pub(super) status: Status,
    pub(super) judgement: Judgement,
    pub(super) is_needed: bool,
    /// Whether the watch forms its belief without a request.
    pub(super) is_cheap: bool,
    handled: Handled,
    trace: Vec<Point>,
    rank: Rank,
}

impl OpenSession {
    /// The attention that it needs, in its wire form.
    pub(super) fn attention(&self) -> wire::Attention {
        wire::Attention {
            level: self.judgement.level,
            reason: self.judgement.reason.clone(),
            since: time(self.judgement.since_ms),
            is_needed: self.is_needed,
            acknowledged_at: self.handled.acknowledged_at_ms.map(time),
            muted_until: self.handled.muted_until_ms.map(time),
        }
    }
}

impl Sessions {
    /// A page of the open sessions, those that need attention first.
    pub(crate) async fn fleet(
        self: &Arc<Self>,
        query: wire::FleetQuery,
    ) -> Result<wire::Fleet, Cause> {
        let asked = query.limit.map_or(SESSIONS_MAX, u64::from);
        let limit = within("?limit", asked, 1, SESSIONS_MAX)? as usize;
        let after = query.cursor.as_deref().map(rank).transpose()?;
        let n_letters = query.search.as_ref().map_or(0, |search| search.chars().count());
        if n_letters > SEARCH_MAX {
            let detail = format!("has {n_letters} characters, expected at most {SEARCH_MAX}");
            return Err(Invalid::field("?search", detail).into());
        }
        let sessions = Arc::clone(self);
        let listing = move || sessions.fleet_now(&query, after, limit);
        self.tools.pool.place()?.run_long(listing).await?
    }

    /// Records that somebody has seen the alarms of sessions, and mutes them if asked to.
    pub(crate) async fn acknowledge(
        self: &Arc<Self>,
        asked: &wire::AcknowledgeSessions,
    ) -> Result<wire::FleetChanged, SessionError> {
        check_ids(&asked.sessions)?;
        let mute = asked.mute_s.map(|s| within("/mute_s", u64::from(s), 0, MUTE_MAX_S));
        let (mute, now) = (mute.transpose()?, now_ms());
        let muted_until = mute.map(|seconds| now + 1000 * seconds);
        Ok(self.for_each(&asked.sessions, |id| self.acknowledge_one(id, now, muted_until)).await)
    }

    /// Closes sessions without a truth.
    pub(crate) async fn close_many(
        self: &Arc<Self>,
        asked: &wire::CloseSessions,
    ) -> Result<wire::FleetChanged, SessionError> {
        check_ids(&asked.sessions)?;
        let close = |id: Uuid| async move {
            self.close(&id.to_string(), &wire::CloseSession::default()).await.map(|_| ())
        };
        Ok(self.for_each(&asked.sessions, close).await)
    }

    async fn acknowledge_one(
        &self,
        id: Uuid,
        now: u64,
        muted_until: Option<u64>,
    ) -> Result<(), SessionError> {
        self.find(&id.to_string())?;
        let store = self.tools.store.clone();
        let table = self.tools.store.sessions();
        let changed = table.update(id, move |session| {
            if let Some(end) = status(&store, session, &store.running(now))?.end {
                return Err(LiveError::Ended { session: id, end });
            }
            set_acknowledged(session, now, muted_until);
            Ok(())
        });
        changed.await??;
        Ok(())
    }

    /// Does something to sessions; what fails for one does not keep it from the others.
    async fn for_each<F>(&self, ids: &[Uuid], change: impl Fn(Uuid) -> F) -> wire::FleetChanged
    where
        F: Future<Output = Result<(), SessionError>>,
    {
        let one = |id: Uuid| {
            let changing = change(id);
            async move {
                let problem = changing.await.err().map(|error| error.to_string());
                wire::FleetResult { session: id, problem }
            }
        };
        let results: Vec<wire::FleetResult> =
            stream::iter(ids.to_vec()).map(one).buffered(AT_ONCE).collect().await;
        let n_done = count(results.iter().filter(|one| one.problem.is_none()).count());
        wire::FleetChanged { n_done, results }
    }

    fn fleet_now(
        &self,
        query: &wire::FleetQuery,
        after: Option<Rank>,
        limit: usize,
    ) -> Result<wire::Fleet, Cause> {
        let now = now_ms();
        let mut open = self.open_now(now)?;
        let n_open = count(open.len());
        let n_needed = count(open.iter().filter(|one| one.is_needed).count());
        let only_needed = query.needed.unwrap_or(false);
        open.retain(|one| {
            after.is_none_or(|after| one.rank > after) && (one.is_needed || !only_needed)
        });
        if let Some(search) = &query.search {
            let mut found = Vec::new();
            for one in open {
                if has_words(&self.show_as(&one.session, one.status)?, search) {
                    found.push(one);
                }
            }
            open = found;
        }
        open.sort_unstable_by_key(|one| one.rank);
        let more = open.len() > limit;
        open.truncate(limit);
        let next_cursor = open.last().filter(|_| more).map(|one| one.rank.to_string());
        let with_trace = query.trace.unwrap_or(false);
        let shown = |one| self.fleet_session(one, with_trace);
        let sessions = open.into_iter().map(shown).collect::<Result<_, _>>()?;
        Ok(wire::Fleet { at: time(now), n_open, n_needed, sessions, next_cursor })
    }

    /// The open sessions in no order. Blocks.
    pub(super) fn open_now(&self, now: u64) -> Result<Vec<OpenSession>, Cause> {
        let (mut open, running) = (Vec::new(), self.tools.store.running(now));
        for id in self.open.page(None, usize::MAX).0 {
            // A session deleted or damaged meanwhile is not open any more.
            let Ok(Some(session)) = self.tools.store.sessions().find(id) else { continue };
            let status = status(&self.tools.store, &session, &running)?;
            if status.end.is_none() {
                open.push(self.judged(session, status, now));
            }
        }
        Ok(open)
    }

    fn judged(&self, session: Session, status: Status, now: u64) -> OpenSession {
        let trace = self.tools.traces.of(session.id);
        let (n_readings, changed_at_ms) = (status.n_readings, status.changed_at_ms);
        let judgement = judge(Seen { trace: &trace, n_readings, changed_at_ms }, now);
        let options = options(&session);
        let handled = Handled {
            acknowledged_at_ms: options.acknowledged_at_ms,
            muted_until_ms: options.muted_until_ms.filter(|until| *until > now),
        };
        let is_needed = handled.leaves_needed(&judgement, now);
        let rank = Rank::new(&judgement, is_needed, session.id);
        let is_cheap = !options.method.is_geometric();
        OpenSession { session, status, judgement, is_needed, is_cheap, handled, trace, rank }
    }

    fn fleet_session(
        &self,
        one: OpenSession,
        with_trace: bool,
    ) -> Result<wire::FleetSession, Cause> {
        let attention = one.attention();
        let OpenSession { session, status, trace, .. } = one;
        let from = status.length.saturating_sub(READINGS);
        let entries = self.tools.store.journal().entries(session.id, from, READINGS as usize)?;
        let is_reading = |entry: &&Entry| matches!(entry.event, Event::Reading(_));
        let newest = entries.iter().rev().find(is_reading);
        Ok(wire::FleetSession {
            last_reading_at: newest.map(|entry| time(entry.received_at_ms)),
            session: self.show_as(&session, status)?,
            attention,
            trace: trace.iter().filter(|_| with_trace).map(Point::shown).collect(),
        })
    }
}

/// The place in the list after which a page begins.
fn rank(cursor: &str) -> Result<Rank, Invalid> {
    let expected = format!("came {cursor:?}, expected a `next_cursor` of this list");
    cursor.parse().map_err(|()| Invalid::field("?cursor", expected))
}

fn check_ids(ids: &[Uuid]) -> Result<(), Invalid> {
    let n = ids.len() as u64;
    if !(1..=SESSIONS_MAX).contains(&n) {
        let detail = format!("{n} ids came, expected 1 to {SESSIONS_MAX}");
        return Err(Invalid::field("/sessions", detail));
    }
    Ok(())
}
