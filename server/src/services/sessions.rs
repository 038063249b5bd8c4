//! Sessions: beliefs about one unknown object from its readings.
//!
//! The journal is the truth: a reading is acknowledged when it is durable there. A belief is
//! derived: folded from the journal's readings in their order, kept while the session is in
//! use, and rebuilt on demand. One session is one entry with its own lock; no guard of the
//! map lives across an await. Changes of a session run in a separate task, so that a robot
//! that hangs up does not leave them half done.

mod attention;
mod elsewhere;
mod fits;
mod fleet;
mod forwarded;
mod health;
mod ids;
mod life;
mod listing;
mod open;
mod outcome;
mod outgoing;
mod questions;
mod retraction;
mod search;
mod watch;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use dashmap::DashMap;
use palpate_schemas as wire;
use palpate_schemas::{BeliefDetail, Method, SessionEvent, SessionState};
use palpate_store::database::Database;
use palpate_store::entity::Session;
use palpate_store::error::StoreError;
use thiserror::Error;
use tokio::sync::Mutex;
use tokio::task::JoinHandle;
use uuid::Uuid;

use crate::asker;
use crate::budget::ShareFull;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::Pool;
use crate::config::Config;
use crate::live::checkpoints::Checkpoints;
use crate::live::outcome::touched_by;
use crate::live::trace::Traces;
use crate::live::{Live, LiveError, Tools, Total, status};
use crate::model::Model;
use crate::notices::Notices;
use crate::outgoing::Outgoing;
use crate::services::catalogues::{CatalogueError, Catalogues};
use crate::services::keys::Keys;
use crate::services::keys::error::KeyError;
use crate::services::sensors::Sensors;
use crate::wire::life::{OtherTruth, Status};
use crate::wire::reading::{Given, Incoming};
use crate::wire::session::Outcome;
use crate::wire::{self as convert};
use ids::Ids;
use open::Open;
pub(crate) use outgoing::OutgoingSession;

/// All sessions.
pub(crate) struct Sessions {
    tools: Arc<Tools>,
    catalogues: Arc<Catalogues>,
    sensors: Arc<Sensors>,
    keys: Arc<Keys>,
    live: DashMap<Uuid, Arc<Live>>,
    uses: AtomicU64,
    ids: Ids,
    open: Open,
    live_max: usize,
    /// Used and permitted memory of beliefs.
    beliefs: Total,
    belief_bytes_max: usize,
    /// Default lifetime of sessions.
    time_to_live: Duration,
    answer_timeout: Duration,
    /// Held while the watch forms a belief, whose model others may have to wait for.
    recalling: Mutex<()>,
    outgoing: Arc<Outgoing>,
}

impl Sessions {
    pub(crate) fn new(
        store: Database,
        catalogues: Arc<Catalogues>,
        sensors: Arc<Sensors>,
        pool: Pool,
        keys: Arc<Keys>,
        (notices, outgoing): (Arc<Notices>, Arc<Outgoing>),
        config: &Config,
    ) -> Self {
        let tools = Tools {
            store,
            sensors: Arc::clone(sensors.known()),
            pool,
            readings_max: config.session_readings_max,
            checkpoints: Arc::new(Checkpoints::new(config.data.join("checkpoints"))),
            traces: Traces::default(),
            notices,
        };
        Self {
            tools: Arc::new(tools),
            catalogues,
            sensors,
            keys,
            live: DashMap::new(),
            uses: AtomicU64::new(0),
            ids: Ids::default(),
            open: Open::new(config.sessions_open_max),
            live_max: config.beliefs_in_memory_max.max(1),
            beliefs: Total::default(),
            belief_bytes_max: config.belief_memory_bytes_max,
            time_to_live: config.session_time_to_live,
            answer_timeout: config.answer_timeout,
            recalling: Mutex::default(),
            outgoing,
        }
    }

    /// Stores readings, all or none, and returns the belief after them.
    pub(crate) async fn add(
        &self,
        id: &str,
        request: &wire::AddReadings,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingsAdded, SessionError> {
        let given = convert::reading::given(&request.readings);
        let list = ("/readings", request.readings.len());
        let add = |live: Arc<Live>, readings| async move {
            let added = live.add(readings, detail).await?;
            Ok::<_, LiveError>((u64::from(added.n_new), added))
        };
        let (mut added, warnings) = self.take_in(id, list, &given, add).await?;
        added.warnings.extend(warnings);
        Ok(added)
    }

    /// The one way into a session for readings, whoever brings them: checks those `given` in a list
    /// of a request against the session, the sensors and the names of robots, and stores them with
    /// `store`, which also tells the number of new entries. Returns its answer, and what is to be
    /// warned of.
    async fn take_in<T, F>(
        &self,
        id: &str,
        (list, length): (&str, usize),
        given: &[Given<'_>],
        store: impl FnOnce(Arc<Live>, Vec<Incoming>) -> F,
    ) -> Result<(T, Vec<wire::Warning>), SessionError>
    where
        T: Send + 'static,
        F: Future<Output = Result<(u64, T), LiveError>> + Send + 'static,
    {
        let id = self.parse(id)?;
        let live = self.live(id).await?;
        let frame_id = convert::session::frame_id(live.session());
        let using = self.sensors.using().await;
        convert::reading::check_size(list, length, given)?;
        let sources = self.sensors.sources(given)?;
        let readings = convert::reading::readings(given, sources, frame_id)?;
        live.check(&readings)?;
        self.keys.claim_robots(asker::Asker::current().key(), &readings).await?;
        let is_followed = live.is_followed();
        let named: Vec<Uuid> = readings.iter().map(|reading| reading.sensor.id).collect();
        let outgoing = Arc::clone(&self.outgoing);
        let storing = store(live, readings);
        let storing = async move {
            let _using = using;
            let stored = storing.await;
            // Also readings whose belief failed may be stored.
            outgoing.note(id, stored.as_ref().map_or(0, |(n_new, _)| *n_new));
            stored
        };
        // Followers of the session wait for its belief as well.
        let storing = match is_followed {
            true => asker::spawn_within(self.answer_timeout, storing),
            false => asker::spawn(storing),
        };
        let (_, answer) = finished(storing).await?;
        Ok((answer, self.sensors.health().warnings(&named)))
    }

    /// The id of a session in a path.
    pub(crate) fn parse(&self, id: &str) -> Result<Uuid, Cause> {
        Uuid::parse_str(id).map_err(|_| Cause::unknown("session", id))
    }

    /// Number of open sessions.
    pub(crate) fn n_open(&self) -> usize {
        self.open.len()
    }

    /// Bytes of memory of beliefs.
    pub(crate) fn belief_bytes(&self) -> usize {
        self.beliefs.bytes() + self.catalogues.table_bytes()
    }

    /// Number of sessions in memory.
    pub(crate) fn n_live(&self) -> usize {
        self.live.len()
    }

    /// Stores the beliefs in memory, so that the next start need not fold them again. Blocks.
    pub(crate) fn store_beliefs(&self) {
        for live in &self.live {
            live.store();
        }
    }

    fn find(&self, id: &str) -> Result<Session, Cause> {
        let found = self.tools.store.sessions().find(self.parse(id)?)?;
        found.ok_or_else(|| Cause::unknown("session", id))
    }

    /// The session, also if another server has just created it.
    async fn find_anywhere(&self, id: Uuid) -> Result<Session, Cause> {
        match self.find(&id.to_string()) {
            Err(_) => self.tools.store.catch_up().await?,
            found => return found,
        }
        self.find(&id.to_string())
    }

    fn show(&self, session: &Session) -> Result<wire::Session, StoreError> {
        self.show_as(session, self.status(session)?)
    }

    /// The status of a session now.
    fn status(&self, session: &Session) -> Result<Status, StoreError> {
        status(&self.tools.store, session, &self.tools.store.running(now_ms()))
    }

    fn show_as(&self, session: &Session, status: Status) -> Result<wire::Session, StoreError> {
        let catalogue = self.catalogues.name(session.catalogue)?;
        let (id, kept) = (session.id, convert::session::options(session).outcome);
        let outcome = match kept.filter(|_| status.end.is_some()) {
            Some(kept) => kept,
            None => Outcome {
                latest: self.tools.traces.newest(id).map(|point| point.shown()),
                touched_by: touched_by(&self.tools.store, id, status.length)?,
            },
        };
        let writer = |key| self.keys.writer(key);
        Ok(convert::session::session(session, &catalogue, status, outcome, writer))
    }

    /// The session's entry in memory, created from the store if necessary.
    async fn live(&self, id: Uuid) -> Result<Arc<Live>, SessionError> {
        self.make_room(0)?;
        if let Some(live) = self.live.get(&id).map(|live| Arc::clone(&live)) {
            live.used(self.uses.fetch_add(1, Ordering::Relaxed));
            self.make_room(live.bytes_missing())?;
            return Ok(live);
        }
        let session = self.find_anywhere(id).await?;
        let method = convert::session::options(&session).method;
        let model = self.model(session.catalogue, session.version, method).await?;
        let live = self.keep(id, Arc::new(Live::new(&self.tools, session, model, &self.beliefs)));
        self.make_room(live.bytes_missing())?;
        Ok(live)
    }

    /// The model part of a method. Unused sessions in memory are evicted for it: their
    /// beliefs are in their journals.
    async fn model(
        &self,
        catalogue: Uuid,
        version: u32,
        method: Method,
    ) -> Result<Arc<Model>, CatalogueError> {
        let part = convert::session::part(method);
        match self.catalogues.load(catalogue, version, part).await {
            Err(CatalogueError::ModelsInUse { .. }) => {}
            other => return other,
        }
        self.live.retain(|_, live| !is_idle(live));
        match self.catalogues.load(catalogue, version, part).await {
            Err(CatalogueError::ModelsInUse { .. }) => {}
            other => return other,
        }
        // The watch, which no client waits for, must not keep a client from a model.
        let _none_recalled = self.recalling.lock().await;
        self.live.retain(|_, live| !is_idle(live));
        self.catalogues.load(catalogue, version, part).await
    }

    /// Keeps the memory of beliefs and their tables within its budget, with space for `more`
    /// bytes: the least recently used beliefs are dropped and folded again on demand. Refuses
    /// if those in use take it all.
    fn make_room(&self, more: usize) -> Result<(), LiveError> {
        let max = self.belief_bytes_max;
        if self.belief_bytes() + more <= max {
            return Ok(());
        }
        let mut uses: Vec<(u64, Arc<Live>)> =
            self.live.iter().map(|entry| (entry.last_use(), Arc::clone(&entry))).collect();
        uses.sort_unstable_by_key(|(last_use, _)| *last_use);
        // A quarter at once, so that not every request has to evict.
        for (_, live) in uses {
            if self.belief_bytes() + more <= max - max / 4 {
                break;
            }
            live.forget();
        }
        let bytes = self.belief_bytes() + more;
        if bytes > max { Err(LiveError::BeliefsFull { bytes, max }) } else { Ok(()) }
    }

    /// Keeps an entry, unless another one was quicker; evicts entries when there are too many.
    fn keep(&self, id: Uuid, live: Arc<Live>) -> Arc<Live> {
        live.used(self.uses.fetch_add(1, Ordering::Relaxed));
        let kept = Arc::clone(&self.live.entry(id).or_insert(live));
        if self.live.len() > self.live_max {
            self.forget_idle();
        }
        metrics::gauge!("palpate_sessions_in_memory").set(self.live.len() as f64);
        kept
    }

    /// Evicts the least recently used quarter. Entries in use stay: there must never be two
    /// of one session.
    fn forget_idle(&self) {
        let mut uses: Vec<(u64, Uuid)> =
            self.live.iter().map(|entry| (entry.last_use(), *entry.key())).collect();
        uses.sort_unstable();
        for (_, id) in uses.iter().take(uses.len() / 4 + 1) {
            self.live.remove_if(id, |_, live| is_idle(live));
        }
    }
}

/// Error of sessions.
#[derive(Debug, Error)]
pub(crate) enum SessionError {
    #[error(
        "{max} sessions are open, which is the maximum: close finished ones, or let them expire \
         (`ttl_s`)"
    )]
    Full { max: usize, wait: Option<Duration> },
    #[error(transparent)]
    ShareFull(#[from] ShareFull),
    #[error(transparent)]
    OtherTruth(#[from] OtherTruth),
    #[error(transparent)]
    Live(#[from] LiveError),
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    #[error(transparent)]
    Key(#[from] KeyError),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for SessionError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}

/// The outcome of a task that goes on when its caller leaves.
async fn finished<T, E>(task: JoinHandle<Result<T, E>>) -> Result<T, SessionError>
where
    SessionError: From<E>,
{
    Ok(task.await.map_err(|_| Cause::Panicked)??)
}

/// Whether no request uses an entry and no follower has it.
fn is_idle(live: &Arc<Live>) -> bool {
    Arc::strong_count(live) == 1 && !live.is_followed()
}

/// Whether an event ends a stream of one session.
pub(crate) fn is_last(event: &SessionEvent) -> bool {
    match event {
        SessionEvent::Belief { .. } => false,
        SessionEvent::Closed { session } => session.state == SessionState::Closed,
        SessionEvent::Deleted { .. } => true,
    }
}
