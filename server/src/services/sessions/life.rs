//! Lifetimes of sessions: start, leases, closing, expiry and deletion, of which that of ended
//! sessions after a configured time limits the use of the disk.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use futures::stream::{self, StreamExt};
use palpate_schemas as wire;
use palpate_schemas::SessionEvent;
use palpate_store::entity::Session;
use palpate_store::error::StoreError;
use palpate_store::running::Running;
use rayon::prelude::*;
use tokio::sync::watch;
use uuid::Uuid;

use super::fits::fits;
use super::health::LOOK_BACK_MS;
use super::open::Full;
use super::{SessionError, Sessions, finished};
use crate::asker;
use crate::budget::ShareFull;
use crate::cause::Cause;
use crate::client::Client;
use crate::clock::{now_ms, pause};
use crate::live::{Live, LiveError, status};
use crate::model::Model;
use crate::services::catalogues::DEFAULT;
use crate::wire::life::{opened_by, set_lease, set_truth};
use crate::wire::session::{Limits, Outcome};
use crate::wire::{self as convert};

/// Interval at which expired sessions are searched.
const SWEEP_EVERY: Duration = Duration::from_secs(1);
/// Number of sessions per read at the start.
pub(super) const SESSIONS_PER_READ: usize = 1000;
/// Interval at which ended sessions are deleted, unless they are kept for less.
const FORGET_EVERY: Duration = Duration::from_secs(60);
/// Number of ended sessions per piece, and of those deleted at once: deletions share a flush.
const FORGET_PAGE: usize = 256;
const FORGET_AT_ONCE: usize = 16;

impl Sessions {
    /// Registers all sessions and the open ones, and removes the checkpoints of others. Blocks.
    pub(crate) fn take_stock(&self) -> Result<(), Cause> {
        let (mut after, now) = (None, now_ms());
        let running = self.tools.store.running(now);
        loop {
            let page = self.tools.store.sessions().list_whole(after, SESSIONS_PER_READ)?;
            page.items.iter().for_each(|session| self.ids.add(session.id));
            // For sessions that were not closed, the last reading determines whether they
            // have expired.
            let since = now.saturating_sub(LOOK_BACK_MS);
            let closed =
                page.items.iter().filter(|it| it.closed_at_ms.is_some_and(|at| at >= since));
            closed.for_each(|session| self.sensors.health().note(session.id));
            let ends = page.items.par_iter().filter(|session| session.closed_at_ms.is_none());
            let ends =
                ends.map(|session| Ok((session, status(&self.tools.store, session, &running)?)));
            page.items.iter().try_for_each(|session| self.note_unforwarded(session))?;
            for (session, status) in ends.collect::<Result<Vec<_>, StoreError>>()? {
                match status.end {
                    None => self.open.note(session.id, status.expires_ran_ms, opened_by(session)),
                    Some(end) if end.at_ms >= since => self.sensors.health().note(session.id),
                    Some(_) => {}
                }
            }
            after = page.next;
            if after.is_none() {
                break;
            }
        }
        self.tools.checkpoints.tidy(|id| self.open.contains(id));
        Ok(())
    }

    pub(crate) async fn create(
        &self,
        request: &wire::CreateSession,
    ) -> Result<wire::Session, SessionError> {
        let _using = self.catalogues.using().await;
        let name = request.catalogue.as_deref().unwrap_or(DEFAULT);
        let pinned = self.catalogues.pin(name, request.version, request.alias.as_deref())?;
        let method = convert::session::method(request, pinned.has_surfaces);
        let model = self.model(pinned.catalogue, pinned.version, method).await?;
        let (time_to_live, opened_by) = (self.time_to_live, asker::Asker::current().key());
        let limits = Limits { time_to_live, now_ms: now_ms(), opened_by };
        let session =
            convert::session::new_session(request, method, &model, Uuid::now_v7(), limits)?;
        fits(&session, &model, self.belief_bytes_max)?;
        self.begin(session, model).await
    }

    /// Stores a new session and opens it.
    pub(super) async fn begin(
        &self,
        session: Session,
        model: Arc<Model>,
    ) -> Result<wire::Session, SessionError> {
        let status = self.status(&session)?;
        self.enter(session.id, status.expires_ran_ms, asker::Asker::current().client())?;
        if let Err(error) = self.tools.store.sessions().create(&session).await {
            // One with its id keeps its place.
            if !matches!(error, StoreError::Exists { .. }) {
                self.open.leave(session.id);
            }
            return Err(error.into());
        }
        self.outgoing.note(session.id, 0);
        tracing::debug!(session.id = %session.id, "Created session {}", session.id);
        self.ids.add(session.id);
        let (outcome, writer) = (Outcome::default(), |key| self.keys.writer(key));
        let shown = convert::session::session(&session, &model.name, status, outcome, writer);
        self.keep(session.id, Arc::new(Live::new(&self.tools, session, model, &self.beliefs)));
        Ok(shown)
    }

    /// Keeps a session open for a time without new readings; a longer lease stays.
    pub(crate) async fn extend(
        &self,
        id: &str,
        asked: wire::ExtendSession,
    ) -> Result<wire::Session, SessionError> {
        let id = self.find(id)?.id;
        let lease = convert::life::lease(asked)?;
        let (store, now, key) = (self.tools.store.clone(), now_ms(), asker::Asker::current().key());
        let (lease_ms, running) = (lease.as_millis() as u64, store.running(now));
        let table = self.tools.store.sessions();
        let extended = table.update(id, move |session| {
            let status = status(&store, session, &running)?;
            if let Some(end) = status.end {
                return Err(LiveError::Ended { session: id, end });
            }
            if status.leased_ran_ms < Some(running.now_ms() + lease_ms) {
                set_lease(session, now, lease_ms, key);
            }
            Ok(())
        });
        let session = extended.await??;
        Ok(self.show(&session)?)
    }

    /// Closes a session, and records its true object if stated; closing it again changes
    /// nothing else.
    pub(crate) async fn close(
        self: &Arc<Self>,
        id: &str,
        asked: &wire::CloseSession,
    ) -> Result<wire::Session, SessionError> {
        let id = self.find(id)?.id;
        let live = self.live(id).await?;
        let told = convert::life::reported_truth(asked, live.model())?;
        let sessions = Arc::clone(self);
        // A session is closed even if the caller has gone.
        let closing = asker::spawn_within(self.answer_timeout, async move {
            if let Some(truth) = told {
                let truth = live.judge(truth).await?;
                sessions.note_truth(id, truth).await?;
            }
            live.close().await?;
            sessions.leave(id);
            let session = sessions.show(&sessions.tools.store.sessions().get(id)?)?;
            live.publish(SessionEvent::Closed { session: Box::new(session.clone()) });
            Ok::<_, SessionError>(session)
        });
        finished(closing).await
    }

    /// Records a session's true object, and scores its belief.
    async fn note_truth(&self, id: Uuid, truth: wire::Truth) -> Result<(), SessionError> {
        let is_new = Arc::new(AtomicBool::new(false));
        let (noted, told) = (Arc::clone(&is_new), truth.clone());
        let table = self.tools.store.essential().sessions();
        let changed = table.update(id, move |session| {
            noted.store(set_truth(session, &told)?, Ordering::Relaxed);
            Ok::<(), SessionError>(())
        });
        changed.await??;
        self.outgoing.note(id, 0);
        if is_new.load(Ordering::Relaxed) {
            let answer = if truth.was_right { "right" } else { "wrong" };
            let object = if truth.object.is_some() { "known" } else { "unknown" };
            let labels = [("answer", answer), ("object", object)];
            metrics::counter!("palpate_feedback_total", &labels).increment(1);
            metrics::histogram!("palpate_feedback_probability").record(truth.probability);
        }
        Ok(())
    }

    /// Deletes a session with its readings.
    pub(crate) async fn delete(&self, id: &str) -> Result<(), SessionError> {
        let id = self.find(id)?.id;
        match self.live.get(&id).map(|live| Arc::clone(&live)) {
            Some(live) => {
                live.delete().await?;
                self.live.remove(&id);
                live.publish(SessionEvent::Deleted { session: id });
            }
            None => {
                self.tools.store.essential().remove_session(id).await?;
            }
        }
        self.leave(id);
        self.outgoing.forget(id);
        self.ids.remove(id);
        tracing::info!(session.id = %id, "Deleted session {id}");
        Ok(())
    }

    /// Ends expired sessions until the server stops.
    pub(crate) async fn watch(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        while pause(SWEEP_EVERY, &mut stopping).await {
            if let Err(refusal) = self.sweep() {
                tracing::error!("Cannot look for sessions that have expired: {refusal}");
            }
        }
    }

    /// Deletes sessions that ended longer than `keep` ago, until the server stops.
    pub(crate) async fn forget(
        self: Arc<Self>,
        keep: Duration,
        mut stopping: watch::Receiver<bool>,
    ) {
        while pause(keep.min(FORGET_EVERY), &mut stopping).await {
            match self.forget_ended(keep).await {
                Ok(0) => {}
                Ok(n) => tracing::info!("Deleted {n} sessions that ended {keep:?} ago or earlier"),
                Err(error) => tracing::error!("Cannot delete sessions that ended: {error}"),
            }
        }
    }

    /// Ends the expired sessions and notifies their followers.
    fn sweep(&self) -> Result<(), Cause> {
        let running = self.tools.store.running(now_ms());
        for id in self.open.due(running.now_ms()) {
            let Some(session) = self.tools.store.sessions().find(id)? else {
                self.open.leave(id);
                continue;
            };
            let status = status(&self.tools.store, &session, &running)?;
            if status.end.is_none() {
                self.open.note(id, status.expires_ran_ms, opened_by(&session));
                continue;
            }
            self.leave(id);
            self.keys.want_time();
            tracing::info!(session.id = %id, "Session {id} expired");
            if let Some(live) = self.live.get(&id).map(|live| Arc::clone(&live)) {
                let session = Box::new(self.show(&session)?);
                live.publish(SessionEvent::Closed { session });
            }
        }
        Ok(())
    }

    /// Deletes the sessions that ended longer than `keep` ago in running time; their number.
    async fn forget_ended(&self, keep: Duration) -> Result<usize, SessionError> {
        // What the clocks of other servers showed is known afterwards.
        if let Err(error) = self.keys.store_time().await {
            tracing::warn!(%error, "Cannot store the time");
        }
        let running = self.tools.store.running(now_ms());
        let Some(before_ran_ms) = running.now_ms().checked_sub(keep.as_millis() as u64) else {
            return Ok(0);
        };
        let (mut after, mut n_deleted) = (None, 0);
        loop {
            let (ended, next) = self.ended(after, before_ran_ms, &running)?;
            let mut deleting = stream::iter(ended)
                .map(|id| async move { self.delete(&id.to_string()).await })
                .buffer_unordered(FORGET_AT_ONCE);
            while let Some(deleted) = deleting.next().await {
                match deleted {
                    Ok(()) => n_deleted += 1,
                    // A client was quicker.
                    Err(SessionError::Cause(Cause::NotFound { .. })) => {}
                    Err(error) => return Err(error),
                }
            }
            match next {
                Some(next) => after = Some(next),
                None => return Ok(n_deleted),
            }
        }
    }

    /// Sessions of one piece that had ended by a running time, and the start of the next piece.
    fn ended(
        &self,
        after: Option<Uuid>,
        before_ran_ms: u64,
        running: &Running,
    ) -> Result<(Vec<Uuid>, Option<Uuid>), StoreError> {
        let page = self.tools.store.sessions().list_whole(after, FORGET_PAGE)?;
        let mut ended = Vec::new();
        for session in &page.items {
            // Ids are in the order of the clock at their creation: later ones cannot have ended by
            // then, as far as the clock tells.
            if running.at(session.created_at_ms) > before_ran_ms {
                return Ok((ended, None));
            }
            let end = status(&self.tools.store, session, running)?.end;
            let is_over = end.is_some_and(|end| end.ran_ms <= before_ran_ms);
            // A cell keeps what the central service does not have.
            if is_over && self.is_forwarded(session) {
                ended.push(session.id);
            }
        }
        Ok((ended, page.next))
    }

    /// Registers the end of a session.
    fn leave(&self, id: Uuid) {
        self.open.leave(id);
        self.outgoing.note(id, 0);
        self.tools.traces.forget(id);
        self.sensors.health().note(id);
        self.tools.checkpoints.remove(id);
    }

    /// Takes a slot for a new session, that of an expired one if necessary.
    fn enter(
        &self,
        id: Uuid,
        expires: Option<u64>,
        client: Option<Client>,
    ) -> Result<(), SessionError> {
        if self.open.enter(id, expires, client).is_ok() {
            return Ok(());
        }
        self.sweep()?;
        self.open.enter(id, expires, client).map_err(|full| match full {
            Full::Total { max, soonest_ms } => {
                let ran_ms = self.tools.store.running(now_ms()).now_ms();
                let wait = soonest_ms.map(|soonest| {
                    Duration::from_millis(soonest.saturating_sub(ran_ms)).max(SWEEP_EVERY)
                });
                SessionError::Full { max, wait }
            }
            Full::Share { used, max } => {
                ShareFull { name: "sessions", unit: "sessions", used, total: max }.into()
            }
        })
    }
}
