//! One session in memory: its belief, how far it is folded, and who follows it.
//!
//! The belief is a function of the set of the readings that are not withdrawn: they are folded
//! in one order, whatever order they came in. Whoever needs the belief folds what is missing, on
//! the compute pool; if that panics nothing is in memory, and the next one to ask folds anew.

mod account;
mod ending;
mod explain;
mod folding;
mod memory;
mod next_touch;
mod order;
mod past;
mod presses;
mod replay;
mod retract;
mod state;
mod turns;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use palpate_core::belief::answer::Answer;
use palpate_core::object::ObjectIdx;
use palpate_core::stop::Stop;
use palpate_schemas as wire;
use palpate_schemas::{BeliefDetail, SessionEvent};
use palpate_store::database::Database;
use palpate_store::entity::{ReadingId, Session, StoredReading};
use palpate_store::error::StoreError;
use palpate_store::journal::{Event, Journal, NewEntry};
use tokio::sync::broadcast;
use tracing::Instrument;

use crate::asker::Asker;
use crate::belief::{SessionBelief, check};
use crate::catalogues::Model;
use crate::clock::now_ms;
use crate::compute::{ComputeError, Length, Place};
use crate::refusal::Refusal;
use crate::repeats::new_readings;
use crate::sessions::{POSES, Tools, status};
use crate::wire::belief::{belief, top};
use crate::wire::life::Status;
use crate::wire::reading::{Incoming, warnings};
use crate::wire::session::{is_geometric, options};
use crate::wire::{count, geometry};
use account::Account;
pub(crate) use account::Total;
use folding::Folding;
pub(crate) use replay::ReplayQuestion;
use state::State;
use turns::Turns;

/// Folding more readings than this gives way to what other robots wait for. Chosen: a batch of an
/// arm's ten touches never does; a session that is folded anew from its journal may.
const SHORT_READINGS_MAX: usize = 32;

/// How many events a slow follower may lag behind before it misses some.
const EVENTS_MAX: usize = 16;

/// A session in memory.
pub(crate) struct Live {
    session: Session,
    model: Arc<Model>,
    turns: Turns<State>,
    events: broadcast::Sender<SessionEvent>,
    last_use: AtomicU64,
    account: Account,
}

/// What a session has in memory besides its belief, about: itself and its channel of events.
const ENTRY_BYTES: usize = size_of::<Live>() + EVENTS_MAX * size_of::<SessionEvent>();

impl Live {
    pub(crate) fn new(session: Session, model: Arc<Model>, total: &Total) -> Self {
        let (events, _) = broadcast::channel(EVENTS_MAX);
        let (last_use, account) = (AtomicU64::new(0), total.open(ENTRY_BYTES));
        Self { session, model, turns: Turns::default(), events, last_use, account }
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

    /// Gives its belief's memory back, unless somebody works with it at this moment; whoever
    /// needs the belief again folds it anew.
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

    /// Tells everybody who follows the session; nobody has to.
    pub(crate) fn publish(&self, event: SessionEvent) {
        let _ = self.events.send(event);
    }

    /// Refuses readings that the session's method cannot fold: none of them is stored.
    pub(crate) fn check(&self, readings: &[Incoming]) -> Result<(), Refusal> {
        check(&self.session, &self.model, readings)
    }

    /// Stores readings and answers the belief after them.
    pub(crate) async fn add(
        &self,
        tools: &Tools<'_>,
        readings: Vec<Incoming>,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingsAdded, Refusal> {
        let mut state = self.turns.take().await?;
        let (now, key) = (now_ms(), Asker::current().key());
        let status = self.status(tools.store, now)?;
        let new = self.new_readings(tools.store, &readings)?;
        let n_new = new.len();
        if let Some(end) = status.end.filter(|_| n_new > 0) {
            return Err(Refusal::SessionEnded { session: self.session.id, end });
        }
        if status.n_stored() + n_new as u64 > tools.readings_max as u64 {
            return Err(Refusal::ReadingsFull {
                what: "session",
                found: status.n_stored(),
                more: n_new,
                max: tools.readings_max,
            });
        }
        let repeated = if n_new == 0 { self.revision_of(tools.store, &readings)? } else { None };
        let remembered = repeated.and_then(|revision| state.remembered(revision));
        let is_answered = remembered.is_some() || detail == BeliefDetail::None;
        let place =
            if repeated.is_some() && is_answered { None } else { self.place(tools, detail)? };
        if n_new > 0 {
            let entries: Vec<NewEntry> =
                new.iter().map(|reading| reading.entry(now, key)).collect();
            let journal = tools.store.journal();
            let span = tracing::info_span!("append", session.id = %self.session.id, n_new);
            let appending = journal.append(self.session.id, status.length, &entries);
            appending.instrument(span).await?;
            metrics::counter!("palpate_readings_total").increment(n_new as u64);
        }
        let belief = match (remembered, place, repeated) {
            (Some(belief), ..) => Some(belief),
            (None, None, _) => None,
            (None, Some(place), Some(revision)) => {
                let start = past::start(&state.memory, revision);
                Some(self.past(tools, place, revision, POSES, start).await?)
            }
            (None, Some(place), None) => {
                Some(self.renew(&mut state, tools, place, status.length + n_new as u64).await?)
            }
        };
        let first = tools.store.journal().entry(self.session.id, 0)?;
        Ok(wire::ReadingsAdded {
            session: self.session.id,
            n_new: count(n_new),
            n_repeated: count(readings.len() - n_new),
            n_readings: count(status.n_readings + n_new as u64),
            n_presses: belief.as_ref().map(|belief| belief.n_readings),
            belief: shown(belief, detail),
            warnings: warnings(&readings, first.as_ref()),
        })
    }

    /// The belief after what was just stored, for whoever sent it and those who follow.
    async fn renew(
        &self,
        state: &mut State,
        tools: &Tools<'_>,
        place: Place,
        length: u64,
    ) -> Result<wire::Belief, Refusal> {
        let answer = self.ask(state, tools, place, length, answer(POSES)).await?;
        let belief = self.shown(length, &answer);
        state.remember(&belief);
        self.count(state);
        self.publish(SessionEvent::Belief { belief: belief.clone() });
        Ok(belief)
    }

    /// The revision of the belief that was answered to readings which are all known.
    fn revision_of(&self, store: &Database, readings: &[Incoming]) -> Result<Option<u64>, Refusal> {
        let journal = store.journal();
        let mut revision = None;
        for id in readings.iter().filter_map(|reading| reading.id.as_ref()) {
            let number = journal.find(self.session.id, id, Asker::current().key())?;
            revision = revision.max(number.map(|number| number + 1));
        }
        Ok(revision)
    }

    /// The belief as it is now; `None` when its revision is known.
    pub(crate) async fn belief(
        &self,
        tools: &Tools<'_>,
        poses: usize,
        known_revision: Option<u64>,
    ) -> Result<Option<wire::Belief>, Refusal> {
        let mut state = self.turns.take().await?;
        let length = tools.store.journal().len(self.session.id)?;
        if known_revision == Some(length) {
            return Ok(None);
        }
        let place = tools.pool.place()?;
        let answer = self.ask(&mut state, tools, place, length, answer(poses)).await?;
        Ok(Some(self.shown(length, &answer)))
    }

    /// How probable each coordinate of an object's pose is (of the likeliest object if none
    /// is named); `None` when the revision is known.
    pub(crate) async fn marginals(
        &self,
        tools: &Tools<'_>,
        object: Option<&str>,
        known_revision: Option<u64>,
    ) -> Result<Option<wire::Marginals>, Refusal> {
        let object = object.map(|reference| self.object(reference)).transpose()?;
        let mut state = self.turns.take().await?;
        let length = tools.store.journal().len(self.session.id)?;
        if known_revision == Some(length) {
            return Ok(None);
        }
        let place = tools.pool.place()?;
        let ask = move |belief: &SessionBelief| belief.marginals(object);
        let found = self.ask(&mut state, tools, place, length, ask).await?;
        let marginals = found.ok_or(Refusal::NoMarginals { session: self.session.id })?;
        Ok(Some(geometry::marginals(self.session.id, length, &marginals, &self.model)))
    }

    fn status(&self, store: &Database, now: u64) -> Result<Status, Refusal> {
        let session = store.sessions().find(self.session.id)?.ok_or_else(|| self.unknown())?;
        status(store, &session, now)
    }

    fn unknown(&self) -> Refusal {
        Refusal::NotFound { what: "session", reference: self.session.id.to_string() }
    }

    fn new_readings<'a>(
        &self,
        store: &Database,
        readings: &'a [Incoming],
    ) -> Result<Vec<&'a Incoming>, Refusal> {
        let journal = store.journal();
        let key = Asker::current().key();
        new_readings(readings, |id| Ok(stored(&journal, self.session.id, id, key)?))
    }

    /// A place to compute. Without a belief to answer it is taken only for those who follow.
    fn place(&self, tools: &Tools<'_>, detail: BeliefDetail) -> Result<Option<Place>, Refusal> {
        match detail {
            BeliefDetail::Full | BeliefDetail::Top => Ok(Some(tools.pool.place()?)),
            BeliefDetail::None if self.is_followed() => Ok(tools.pool.place().ok()),
            BeliefDetail::None => Ok(None),
        }
    }

    /// Folds the entries up to `length` into the belief, and asks it something.
    async fn ask<T: Send + 'static>(
        &self,
        state: &mut State,
        tools: &Tools<'_>,
        place: Place,
        length: u64,
        question: impl FnOnce(&SessionBelief) -> T + Send + 'static,
    ) -> Result<T, Refusal> {
        let folding = self.folding(tools);
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
                // What was folded before its asker left is kept.
                if matches!(answer, Ok(_) | Err(Refusal::Compute(ComputeError::Stopped))) {
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

    fn object(&self, reference: &str) -> Result<ObjectIdx, Refusal> {
        let found = self.model.find(reference).ok_or_else(|| {
            let (name, version) = (&self.model.name, self.model.version);
            let detail =
                format!("version {version} of catalogue {name:?} does not know {reference:?}");
            Refusal::field("?object", detail)
        })?;
        Ok(ObjectIdx(found as u32))
    }

    /// Whether folding so many entries gives way to what other robots wait for.
    fn length_of(&self, missing: usize, folding: &Folding) -> Length {
        let is_long = missing > SHORT_READINGS_MAX || is_geometric(folding.options.method);
        if is_long { Length::Long } else { Length::Short }
    }

    fn folding(&self, tools: &Tools<'_>) -> Folding {
        Folding {
            session: self.session.clone(),
            model: Arc::clone(&self.model),
            journal: tools.store.journal(),
            sensors: Arc::clone(tools.sensors),
            options: options(&self.session),
            checkpoints: Arc::clone(tools.checkpoints),
            asker: Asker::current(),
        }
    }

    /// Stores the belief as it is, so that a restart need not fold it again; nobody may work
    /// with it. Blocks.
    pub(crate) fn store(&self, tools: &Tools<'_>) {
        if let Some(mut state) = self.turns.try_take() {
            self.folding(tools).store(&mut state.memory, 1);
        }
    }
}

/// The question for an answer with at most `poses` poses.
fn answer(poses: usize) -> impl FnOnce(&SessionBelief) -> Answer + Send + 'static {
    move |belief| belief.answer(poses)
}

fn stored(
    journal: &Journal,
    session: uuid::Uuid,
    id: &ReadingId,
    key: Option<uuid::Uuid>,
) -> Result<Option<StoredReading>, StoreError> {
    let Some(seq) = journal.find(session, id, key)? else { return Ok(None) };
    Ok(journal.entry(session, seq)?.and_then(|entry| match entry.event {
        Event::Reading(reading) => Some(reading),
        Event::Retraction { .. } | Event::Closed => None,
    }))
}

fn shown(belief: Option<wire::Belief>, detail: BeliefDetail) -> Option<wire::Belief> {
    match detail {
        BeliefDetail::Full => belief,
        BeliefDetail::Top => belief.map(top),
        BeliefDetail::None => None,
    }
}
