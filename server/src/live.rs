//! One session in memory: its belief, the folded part of its journal, and its followers.
//!
//! The belief is a function of the set of readings that are not withdrawn: they are folded in
//! one order, whatever their order of arrival. A request that needs the belief folds the
//! missing readings on the compute pool. If that panics, the memory is dropped and the next
//! request folds everything again.

pub(crate) mod belief;
mod changes;
pub(crate) mod checkpoints;
mod clocks;
mod folding;
mod followed;
mod forwarded;
mod history;
mod order;
pub(crate) mod outcome;
mod past;
mod presses;
mod questions;
mod readings;
mod state;
mod status;
pub(crate) mod trace;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use palpate_core::stop::Stop;
use palpate_schemas as wire;
use palpate_schemas::{Method, SessionEvent};
use palpate_store::database::Database;
use palpate_store::entity::Session;
use palpate_store::error::StoreError;
use thiserror::Error;
use tokio::sync::broadcast;
use uuid::Uuid;

use crate::asker::Asker;
use crate::cause::Cause;
use crate::compute::{ComputeError, Place, Pool, Size, Urgency};
use crate::hints::of_clock;
use crate::known_sensors::KnownSensors;
use crate::limits::megabytes;
use crate::model::Model;
use crate::notices::Notices;
use crate::wire::Invalid;
use crate::wire::belief::belief;
use crate::wire::life::{End, Status};
use crate::wire::reading::Incoming;
use crate::wire::session::options;
use belief::{SessionBelief, check};
use checkpoints::Checkpoints;
use folding::{Answered, Fold, Folding};
pub(crate) use history::ReplayQuestion;
pub(crate) use past::PastReadings;
use readings::{Readings, Ready};
pub(crate) use state::Total;
use state::{Account, State, Turns};
pub(crate) use status::status;
use trace::Traces;

/// Number of objects times missing readings up to which a fold is small. Chosen: each takes 12 µs,
/// and to share costs a tenth of a millisecond.
const SMALL_OBJECTS_MAX: usize = 64;

/// Number of events by which a slow follower may lag before it misses some.
const EVENTS_MAX: usize = 16;

/// Default number of pose hypotheses in an answer.
pub(crate) const POSES: usize = 5;

/// The services that all sessions use.
pub(crate) struct Tools {
    pub(crate) store: Database,
    pub(crate) sensors: Arc<KnownSensors>,
    pub(crate) pool: Pool,
    pub(crate) readings_max: usize,
    pub(crate) checkpoints: Arc<Checkpoints>,
    pub(crate) traces: Traces,
    pub(crate) notices: Arc<Notices>,
}

/// A session in memory.
pub(crate) struct Live {
    tools: Arc<Tools>,
    session: Session,
    model: Arc<Model>,
    turns: Turns<State>,
    events: broadcast::Sender<SessionEvent>,
    last_use: AtomicU64,
    account: Account,
    first_place: OnceLock<Option<DVec3>>,
    /// Whether its followers are about to hear what other servers added.
    is_hearing: AtomicBool,
}

/// Error of one session in memory.
#[derive(Debug, Error)]
pub(crate) enum LiveError {
    #[error(
        "session {session} {end}; it accepts no more readings, but its readings and its belief can \
         still be read"
    )]
    Ended { session: Uuid, end: End },
    #[error(
        "{waiting} requests already wait for this session: send several readings in one request, \
         or fewer requests at once"
    )]
    Busy { waiting: usize },
    #[error(
        "session {session} has no marginals: its method keeps no pose distribution, or its \
         readings rule the object out"
    )]
    NoMarginals { session: Uuid },
    #[error(
        "session {session} has the method `{method}`, which cannot rank next touches: expected \
         `surface`"
    )]
    NoNextTouches { session: Uuid, method: &'static str },
    #[error(
        "session {session} has no touch yet: expected a `workspace` (center and radius of a ball \
         that contains the object), or a reading that touches the object"
    )]
    NoTouch { session: Uuid },
    #[error(
        "session {session} rests on {found} readings, and at most {max} can be explained: name an \
         earlier revision with `?at=`"
    )]
    TooManyToExplain { session: Uuid, found: usize, max: usize },
    #[error(
        "beliefs in use take {} of memory, and at most {} are allowed",
        megabytes(*bytes as u64), megabytes(*max as u64)
    )]
    BeliefsFull { bytes: usize, max: usize },
    #[error(
        "session {session} is one of cell {cell:?}, which forwards its readings: write to it there"
    )]
    OfCell { session: Uuid, cell: String },
    #[error("session {session} belongs to robots of this server, no cell forwards it")]
    NotForwarded { session: Uuid },
    #[error("session {session} has {length} entries, and entry {from} does not follow")]
    Gap { session: Uuid, from: u64, length: u64 },
    #[error("entry {number} of session {session} is another one than the forwarded one")]
    OtherEntry { session: Uuid, number: u64 },
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for LiveError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}

/// Approximate memory of a session besides its belief: itself and its channel of events.
const ENTRY_BYTES: usize = size_of::<Live>() + EVENTS_MAX * size_of::<SessionEvent>();

impl Live {
    pub(crate) fn new(
        tools: &Arc<Tools>,
        session: Session,
        model: Arc<Model>,
        total: &Total,
    ) -> Self {
        let tools = Arc::clone(tools);
        let (events, _) = broadcast::channel(EVENTS_MAX);
        let (last_use, account) = (AtomicU64::new(0), total.open(ENTRY_BYTES));
        let (turns, first_place) = (Turns::default(), OnceLock::new());
        let is_hearing = AtomicBool::new(false);
        Self { tools, session, model, turns, events, last_use, account, first_place, is_hearing }
    }

    pub(crate) fn session(&self) -> &Session {
        &self.session
    }

    pub(crate) fn used(&self, at: u64) {
        self.last_use.store(at, Ordering::Relaxed);
    }

    pub(crate) fn last_use(&self) -> u64 {
        self.last_use.load(Ordering::Relaxed)
    }

    pub(crate) fn is_followed(&self) -> bool {
        self.events.receiver_count() > 0
    }

    pub(crate) fn subscribe(&self) -> broadcast::Receiver<SessionEvent> {
        self.events.subscribe()
    }

    /// Drops the belief from memory, unless it is in use; a later request folds it again.
    pub(crate) fn forget(&self) {
        if let Some(mut state) = self.turns.try_take() {
            *state = State::default();
            self.count(&state);
        }
    }

    /// Bytes of tables that its belief needs and that no other belief has.
    pub(crate) fn bytes_missing(&self) -> usize {
        let memory = SessionBelief::memory(&self.session, &self.model);
        memory.ok().flatten().map_or(0, |memory| memory.missing)
    }

    fn count(&self, state: &State) {
        self.account.set(ENTRY_BYTES + state.bytes());
    }

    /// Notifies all followers of the session, if any.
    pub(crate) fn publish(&self, event: SessionEvent) {
        let _ = self.events.send(event);
    }

    /// Refuses readings that the session's method cannot fold; none of them is stored.
    pub(crate) fn check(&self, readings: &[Incoming]) -> Result<(), Invalid> {
        check(&self.session, &self.model, readings)
    }

    fn status(&self, now: u64) -> Result<Status, LiveError> {
        let (store, id) = (&self.tools.store, self.session.id);
        let unknown = || Cause::unknown("session", id);
        let session = store.sessions().find(id)?.ok_or_else(unknown)?;
        Ok(status(store, &session, &store.running(now))?)
    }

    /// Number of entries of the journal.
    fn length(&self) -> Result<u64, StoreError> {
        self.tools.store.journal().len(self.session.id)
    }

    /// Folds the entries up to `length` into the belief, and evaluates a question on it.
    async fn ask<T: Send + 'static>(
        &self,
        state: &mut State,
        folding: Folding,
        (place, urgency): (Place, Urgency),
        length: u64,
        question: impl FnOnce(&Fold) -> T + Send + 'static,
    ) -> Result<T, LiveError> {
        let mut memory = std::mem::take(&mut state.memory);
        let missing = (length as usize).saturating_sub(memory.chronicle.len());
        let is_small = urgency == Urgency::Reading
            && folding.method == Method::Surface
            && missing * self.model.objects.len() <= SMALL_OBJECTS_MAX;
        let size = if is_small { Size::Small } else { Size::Large };
        let span = tracing::info_span!(
            "fold", session.id = %self.session.id, revision = length,
            catalogue.version = self.session.version
        );
        let work = move || {
            let _within = span.enter();
            let asked = Stop::heeding(|| {
                let fold = folding.bring(&mut memory, length as usize)?;
                Ok(question(fold))
            });
            (memory, asked.unwrap_or(Err(ComputeError::Stopped.into())))
        };
        let answer = match place.run_as((urgency, size), work).await {
            Ok((memory, answer)) => {
                // The part folded before its asker left is kept.
                if matches!(
                    answer,
                    Ok(_) | Err(LiveError::Cause(Cause::Compute(ComputeError::Stopped)))
                ) {
                    state.memory = memory;
                }
                answer
            }
            Err(error) => Err(error.into()),
        };
        self.count(state);
        answer
    }

    fn shown(&self, revision: u64, Answered { answer, set_back }: &Answered) -> wire::Belief {
        let mut shown = belief(&self.session, revision, answer, &self.model);
        shown.warnings.extend(set_back.iter().map(|found| of_clock(found, String::new())));
        shown
    }

    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    /// A fold of the session; `handed` are the newest entries of its journal.
    fn folding(&self, handed: Vec<Ready>) -> Folding {
        let options = options(&self.session);
        let (journal, sensors) = (self.tools.store.journal(), Arc::clone(&self.tools.sensors));
        Folding {
            session: self.session.clone(),
            model: Arc::clone(&self.model),
            method: options.method,
            readings: Readings::new(self.session.id, journal, sensors, options, handed),
            checkpoints: Arc::clone(&self.tools.checkpoints),
            store: self.tools.store.clone(),
            asker: Asker::current(),
            is_kept: true,
        }
    }

    /// Stores the present belief, so that a restart need not fold it again; it must not be in
    /// use. Blocks.
    pub(crate) fn store(&self) {
        if let Some(mut state) = self.turns.try_take() {
            self.folding(Vec::new()).store(&mut state.memory, 1);
        }
    }
}

/// The question for an answer with at most `poses` poses.
fn answer(poses: usize) -> impl FnOnce(&Fold) -> Answered + Send + 'static {
    move |fold| fold.answer(poses)
}
