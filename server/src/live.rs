//! One session in memory: its belief, the folded part of its journal, and its followers.
//!
//! The belief is a function of the set of readings that are not withdrawn: they are folded in
//! one order, whatever their order of arrival. A request that needs the belief folds the
//! missing readings on the compute pool. If that panics, the memory is dropped and the next
//! request folds everything again.

mod account;
mod adding;
pub(crate) mod belief;
pub(crate) mod checkpoints;
mod ending;
pub(crate) mod error;
mod explain;
mod folding;
mod memory;
mod next_touch;
mod order;
mod past;
mod presses;
mod readings;
mod replay;
mod retract;
mod state;
mod status;
mod turns;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use palpate_core::belief::answer::Answer;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::stop::Stop;
use palpate_schemas as wire;
use palpate_schemas::{BeliefDetail, SessionEvent};
use palpate_store::database::Database;
use palpate_store::entity::Session;
use tokio::sync::broadcast;

use crate::asker::Asker;
use crate::cause::Cause;
use crate::compute::{ComputeError, Length, Place, Pool};
use crate::known_sensors::KnownSensors;
use crate::model::Model;
use crate::wire::Invalid;
use crate::wire::belief::{belief, top};
use crate::wire::geometry;
use crate::wire::life::Status;
use crate::wire::reading::Incoming;
use crate::wire::session::options;
use account::Account;
pub(crate) use account::Total;
use belief::{ObjectMarginals, SessionBelief, check};
use checkpoints::Checkpoints;
use error::LiveError;
use folding::Folding;
use readings::{Readings, Ready};
pub(crate) use replay::ReplayQuestion;
use state::State;
pub(crate) use status::status;
use turns::Turns;

/// Number of readings above which folding yields to other robots' work. Chosen: a batch of an
/// arm's ten touches never does; a session folded from its journal may.
const SHORT_READINGS_MAX: usize = 32;

/// Number of events by which a slow follower may lag before it misses some.
const EVENTS_MAX: usize = 16;

/// Default number of pose hypotheses in an answer.
pub(crate) const POSES: usize = 5;

/// The services that an entry uses.
pub(crate) struct Tools<'a> {
    pub(crate) store: &'a Database,
    pub(crate) sensors: &'a Arc<KnownSensors>,
    pub(crate) pool: &'a Pool,
    pub(crate) readings_max: usize,
    pub(crate) checkpoints: &'a Arc<Checkpoints>,
}

/// A session in memory.
pub(crate) struct Live {
    session: Session,
    model: Arc<Model>,
    turns: Turns<State>,
    events: broadcast::Sender<SessionEvent>,
    last_use: AtomicU64,
    account: Account,
    first_pose: OnceLock<Option<Pose>>,
}

/// Approximate memory of a session besides its belief: itself and its channel of events.
const ENTRY_BYTES: usize = size_of::<Live>() + EVENTS_MAX * size_of::<SessionEvent>();

impl Live {
    pub(crate) fn new(session: Session, model: Arc<Model>, total: &Total) -> Self {
        let (events, _) = broadcast::channel(EVENTS_MAX);
        let (last_use, account) = (AtomicU64::new(0), total.open(ENTRY_BYTES));
        let (turns, first_pose) = (Turns::default(), OnceLock::new());
        Self { session, model, turns, events, last_use, account, first_pose }
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

    /// The belief after stored readings, for their sender and the followers.
    async fn renew(
        &self,
        state: &mut State,
        folding: Folding,
        place: Place,
        length: u64,
    ) -> Result<wire::Belief, LiveError> {
        let answer = self.ask(state, folding, place, length, answer(POSES)).await?;
        let belief = self.shown(length, &answer);
        state.remember(&belief);
        self.count(state);
        self.publish(SessionEvent::Belief { belief: belief.clone() });
        Ok(belief)
    }

    /// The present belief; `None` when its revision is known.
    pub(crate) async fn belief(
        &self,
        tools: &Tools<'_>,
        poses: usize,
        known_revision: Option<u64>,
    ) -> Result<Option<wire::Belief>, LiveError> {
        let mut state = self.turns.take().await?;
        let length = tools.store.journal().len(self.session.id)?;
        if known_revision == Some(length) {
            return Ok(None);
        }
        let place = tools.pool.place()?;
        let answer = self
            .ask(&mut state, self.folding(tools, Vec::new()), place, length, answer(poses))
            .await?;
        Ok(Some(self.shown(length, &answer)))
    }

    /// The distribution of each coordinate of an object's pose (the likeliest object's if
    /// none is named); `None` when the revision is known.
    pub(crate) async fn marginals(
        &self,
        tools: &Tools<'_>,
        object: Option<&str>,
        known_revision: Option<u64>,
    ) -> Result<Option<wire::Marginals>, LiveError> {
        let object = object.map(|reference| self.object(reference)).transpose()?;
        let mut state = self.turns.take().await?;
        let length = tools.store.journal().len(self.session.id)?;
        if known_revision == Some(length) {
            return Ok(None);
        }
        let place = tools.pool.place()?;
        let ask = move |belief: &SessionBelief| belief.marginals(object);
        let found =
            self.ask(&mut state, self.folding(tools, Vec::new()), place, length, ask).await?;
        let marginals = found.ok_or(LiveError::NoMarginals { session: self.session.id })?;
        let ObjectMarginals { object, probability, marginals } = marginals;
        let object = &self.model.objects[object.0 as usize];
        let id = self.session.id;
        Ok(Some(geometry::marginals(id, length, object, probability, &marginals)))
    }

    fn status(&self, store: &Database, now: u64) -> Result<Status, LiveError> {
        let session = store.sessions().find(self.session.id)?.ok_or_else(|| self.unknown())?;
        Ok(status(store, &session, now)?)
    }

    fn unknown(&self) -> Cause {
        Cause::NotFound { what: "session", reference: self.session.id.to_string() }
    }

    /// A slot to compute. Without a belief to answer it is taken only for followers.
    fn place(&self, tools: &Tools<'_>, detail: BeliefDetail) -> Result<Option<Place>, LiveError> {
        match detail {
            BeliefDetail::Full | BeliefDetail::Top => Ok(Some(tools.pool.place()?)),
            BeliefDetail::None if self.is_followed() => Ok(tools.pool.place().ok()),
            BeliefDetail::None => Ok(None),
        }
    }

    /// Folds the entries up to `length` into the belief, and evaluates a question on it.
    async fn ask<T: Send + 'static>(
        &self,
        state: &mut State,
        folding: Folding,
        place: Place,
        length: u64,
        question: impl FnOnce(&SessionBelief) -> T + Send + 'static,
    ) -> Result<T, LiveError> {
        let mut memory = std::mem::take(&mut state.memory);
        let missing = (length as usize).saturating_sub(memory.chronicle.len());
        let work_length = self.length_of(missing, &folding);
        let span = tracing::info_span!(
            "fold", session.id = %self.session.id, revision = length,
            catalogue.version = self.session.version
        );
        let work = move || {
            let _within = span.enter();
            let asked = Stop::heeding(|| {
                let belief = folding.bring(&mut memory, length as usize)?;
                Ok(question(belief))
            });
            (memory, asked.unwrap_or(Err(ComputeError::Stopped.into())))
        };
        let answer = match place.run_as(work_length, work).await {
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

    fn shown(&self, revision: u64, answer: &Answer) -> wire::Belief {
        belief(&self.session, revision, answer, &self.model)
    }

    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    fn object(&self, reference: &str) -> Result<ObjectIdx, LiveError> {
        let found = self.model.find(reference).ok_or_else(|| {
            let (name, version) = (&self.model.name, self.model.version);
            let detail =
                format!("version {version} of catalogue {name:?} does not know {reference:?}");
            Cause::field("?object", detail)
        })?;
        Ok(ObjectIdx(found as u32))
    }

    /// Whether folding this many entries yields to other robots' work.
    fn length_of(&self, missing: usize, folding: &Folding) -> Length {
        let is_long = missing > SHORT_READINGS_MAX || folding.method.is_geometric();
        if is_long { Length::Long } else { Length::Short }
    }

    /// A fold of the session; `handed` are the newest entries of its journal.
    fn folding(&self, tools: &Tools<'_>, handed: Vec<Ready>) -> Folding {
        let options = options(&self.session);
        let (journal, sensors) = (tools.store.journal(), Arc::clone(tools.sensors));
        Folding {
            session: self.session.clone(),
            model: Arc::clone(&self.model),
            method: options.method,
            readings: Readings::new(self.session.id, journal, sensors, options, handed),
            checkpoints: Arc::clone(tools.checkpoints),
            asker: Asker::current(),
        }
    }

    /// Stores the present belief, so that a restart need not fold it again; it must not be in
    /// use. Blocks.
    pub(crate) fn store(&self, tools: &Tools<'_>) {
        if let Some(mut state) = self.turns.try_take() {
            self.folding(tools, Vec::new()).store(&mut state.memory, 1);
        }
    }
}

/// The question for an answer with at most `poses` poses.
fn answer(poses: usize) -> impl FnOnce(&SessionBelief) -> Answer + Send + 'static {
    move |belief| belief.answer(poses)
}

fn shown(belief: Option<wire::Belief>, detail: BeliefDetail) -> Option<wire::Belief> {
    match detail {
        BeliefDetail::Full => belief,
        BeliefDetail::Top => belief.map(top),
        BeliefDetail::None => None,
    }
}
