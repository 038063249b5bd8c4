//! Adding readings: new ones are stored and folded, repeated ones get the first answer again.

use palpate_core::pose::Pose;
use palpate_schemas as wire;
use palpate_schemas::BeliefDetail;
use palpate_store::database::Database;
use palpate_store::entity::{ReadingId, StoredReading};
use palpate_store::error::StoreError;
use palpate_store::journal::{Event, Journal, NewEntry};
use tracing::Instrument;

use super::error::LiveError;
use super::readings::Ready;
use super::state::State;
use super::{Live, POSES, Tools, past, shown};
use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::repeats::new_readings;
use crate::wire::count;
use crate::wire::life::Status;
use crate::wire::reading::{Incoming, pose_of, warnings};
use crate::wire::session::options;

/// Result of comparing a request's readings with the journal.
enum Request {
    /// All readings are known: the belief of this revision was their answer.
    Repeat(u64),
    /// Readings that are new, with their numbers.
    Append(Vec<Ready>),
}

impl Request {
    fn n_new(&self) -> usize {
        match self {
            Self::Repeat(_) => 0,
            Self::Append(new) => new.len(),
        }
    }
}

/// New readings for a journal of `length` entries.
struct Append {
    length: u64,
    now: u64,
    new: Vec<Ready>,
    detail: BeliefDetail,
}

impl Live {
    /// Stores readings and returns the belief after them.
    pub(crate) async fn add(
        &self,
        tools: &Tools<'_>,
        readings: Vec<Incoming>,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingsAdded, LiveError> {
        let mut state = self.turns.take().await?;
        let now = now_ms();
        let status = self.status(tools.store, now)?;
        let request = self.request(tools, &status, &readings)?;
        let n_new = request.n_new();
        let belief = match request {
            Request::Repeat(revision) => self.repeat(&mut state, tools, revision, detail).await?,
            Request::Append(new) => {
                let length = status.length;
                self.append(&mut state, tools, Append { length, now, new, detail }).await?
            }
        };
        Ok(wire::ReadingsAdded {
            session: self.session.id,
            n_new: count(n_new),
            n_repeated: count(readings.len() - n_new),
            n_readings: count(status.n_readings + n_new as u64),
            n_presses: belief.as_ref().map(|belief| belief.n_readings),
            belief: shown(belief, detail),
            warnings: warnings(&readings, self.first_pose(tools.store)?),
        })
    }

    /// Whether the readings of a request repeat earlier ones, or which of them are new. New ones
    /// are refused when the session has ended or is full.
    fn request(
        &self,
        tools: &Tools<'_>,
        status: &Status,
        readings: &[Incoming],
    ) -> Result<Request, LiveError> {
        let new = self.new_readings(tools.store, readings)?;
        if new.is_empty() {
            return Ok(Request::Repeat(self.revision_of(tools.store, readings)?));
        }
        if let Some(end) = status.end {
            return Err(LiveError::Ended { session: self.session.id, end });
        }
        if status.n_stored() + new.len() as u64 > tools.readings_max as u64 {
            return Err(Cause::ReadingsFull {
                what: "session",
                found: status.n_stored(),
                more: new.len(),
                max: tools.readings_max,
            }
            .into());
        }
        let options = options(&self.session);
        let numbered = (status.length..).zip(new);
        Ok(Request::Append(
            numbered.map(|(number, incoming)| Ready::of(number, incoming, &options)).collect(),
        ))
    }

    /// The belief of a revision, if the answer is to contain one.
    async fn repeat(
        &self,
        state: &mut State,
        tools: &Tools<'_>,
        revision: u64,
        detail: BeliefDetail,
    ) -> Result<Option<wire::Belief>, LiveError> {
        let remembered = state.remembered(revision);
        if remembered.is_some() || detail == BeliefDetail::None {
            return Ok(remembered);
        }
        let place = tools.pool.place()?;
        let start = past::start(&state.memory, revision);
        Ok(Some(self.past(tools, place, revision, POSES, start).await?))
    }

    /// Stores new readings and folds them. The compute slot is taken first: an overloaded server
    /// refuses instead of storing readings that it cannot answer.
    async fn append(
        &self,
        state: &mut State,
        tools: &Tools<'_>,
        Append { length, now, new, detail }: Append,
    ) -> Result<Option<wire::Belief>, LiveError> {
        let (place, key) = (self.place(tools, detail)?, Asker::current().key());
        let entries: Vec<NewEntry> = new.iter().map(|ready| ready.entry(now, key)).collect();
        let (journal, n_new) = (tools.store.journal(), new.len());
        let span = tracing::info_span!("append", session.id = %self.session.id, n_new);
        journal.append(self.session.id, length, &entries).instrument(span).await?;
        metrics::counter!("palpate_readings_total").increment(n_new as u64);
        let Some(place) = place else { return Ok(None) };
        let folding = self.folding(tools, new);
        let length = length + n_new as u64;
        Ok(Some(self.renew(state, folding, place, length).await?))
    }

    /// The pose of the session's first reading, if it has one.
    fn first_pose(&self, store: &Database) -> Result<Option<Pose>, LiveError> {
        if let Some(known) = self.first_pose.get() {
            return Ok(*known);
        }
        let Some(first) = store.journal().entry(self.session.id, 0)? else { return Ok(None) };
        Ok(*self.first_pose.get_or_init(|| pose_of(&first)))
    }

    /// The revision of the belief that was answered to readings which are all known.
    fn revision_of(&self, store: &Database, readings: &[Incoming]) -> Result<u64, LiveError> {
        let (journal, key) = (store.journal(), Asker::current().key());
        let mut revision = 0;
        for id in readings.iter().filter_map(|reading| reading.id.as_ref()) {
            let number = journal.find(self.session.id, id, key)?;
            revision = revision.max(number.map_or(0, |number| number + 1));
        }
        Ok(revision)
    }

    fn new_readings<'a>(
        &self,
        store: &Database,
        readings: &'a [Incoming],
    ) -> Result<Vec<&'a Incoming>, Cause> {
        let journal = store.journal();
        let key = Asker::current().key();
        new_readings(readings, |id| Ok(stored(&journal, self.session.id, id, key)?))
    }
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
