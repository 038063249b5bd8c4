//! Changes of a session: adding readings, withdrawing them, closing and deletion.
//!
//! New readings are stored and folded; repeated ones get the first answer again. A withdrawn
//! reading stays in the journal and no longer counts.

use std::collections::BTreeMap;

use glam::DVec3;
use palpate_schemas as wire;
use palpate_schemas::{BeliefDetail, SessionEvent};
use palpate_store::entity::{ReadingId, StoredReading};
use palpate_store::error::StoreError;
use palpate_store::journal::{AppendError, Event, Journal, NewEntry};
use tracing::Instrument;
use uuid::Uuid;

use super::outcome::outcome;
use super::readings::Ready;
use super::state::State;
use super::trace::Point;
use super::{Live, LiveError, POSES, answer};
use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::{Place, Urgency};
use crate::hints::{SetBack, of_clock};
use crate::repeats::new_readings;
use crate::wire::belief::top;
use crate::wire::count;
use crate::wire::life::Status;
use crate::wire::reading::{Incoming, warnings};
use crate::wire::session::{options, set_outcome};

/// Maximum number of times that other servers may be faster with a session. Each time a reading of
/// somebody is added.
const OVERTAKEN_MAX: usize = 64;

/// Result of comparing a request's readings with the journal.
enum Request {
    /// All readings are known: the belief of this revision was their answer.
    Repeat(u64),
    /// Readings that are new, with their numbers.
    Append(Vec<Ready>),
}

/// New readings for a journal of `length` entries.
struct Append {
    length: u64,
    now: u64,
    new: Vec<Ready>,
    detail: BeliefDetail,
}

/// Whether another server appended to the journal in the meantime.
fn is_overtaken(error: &LiveError) -> bool {
    matches!(error, LiveError::Cause(Cause::Store(StoreError::Changed { .. })))
}

/// The robot, its number and the stamp of a reading that has them.
fn stamp(reading: &Incoming) -> Option<((&str, u64), i64)> {
    let id = reading.id.as_ref()?;
    Some(((id.robot.as_str(), id.seq), reading.stored.stamp_ns?))
}

impl Live {
    /// Stores readings and returns the belief after them.
    pub(crate) async fn add(
        &self,
        readings: Vec<Incoming>,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingsAdded, LiveError> {
        self.check_writer()?;
        let mut state = self.turns.take().await?;
        let mut attempts = OVERTAKEN_MAX;
        let (status, n_new, belief) = loop {
            let now = now_ms();
            let status = self.status(now)?;
            let new = match self.request(&status, &readings)? {
                Request::Repeat(revision) => {
                    break (status, 0, self.repeat(&mut state, revision, detail).await?);
                }
                Request::Append(new) => new,
            };
            let n_new = new.len();
            let append = Append { length: status.length, now, new, detail };
            match self.append(&mut state, append).await {
                Err(error) if is_overtaken(&error) && attempts > 0 => attempts -= 1,
                added => break (status, n_new, added?),
            }
        };
        Ok(wire::ReadingsAdded {
            session: self.session.id,
            n_new: count(n_new),
            n_repeated: count(readings.len() - n_new),
            n_readings: count(status.n_readings + n_new as u64),
            n_presses: belief.as_ref().map(|belief| belief.n_readings),
            belief: in_detail(belief, detail),
            warnings: self.warned(readings.iter())?,
        })
    }

    /// Withdraws the reading that is entry `number` of the journal, and returns the belief
    /// without it. A repetition changes nothing and gives the same answer.
    pub(crate) async fn retract(
        &self,
        number: u64,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, LiveError> {
        self.check_writer()?;
        let mut state = self.turns.take().await?;
        let mut attempts = OVERTAKEN_MAX;
        loop {
            match self.withdraw(&mut state, number, detail).await {
                Err(error) if is_overtaken(&error) && attempts > 0 => attempts -= 1,
                withdrawn => return withdrawn,
            }
        }
    }

    async fn withdraw(
        &self,
        state: &mut State,
        number: u64,
        detail: BeliefDetail,
    ) -> Result<wire::ReadingRetracted, LiveError> {
        let now = now_ms();
        let (session, journal) = (self.session.id, self.tools.store.journal());
        let status = self.status(now)?;
        let entry = journal.entry(session, number)?;
        if !entry.is_some_and(|entry| matches!(entry.event, Event::Reading(_))) {
            return Err(Cause::unknown("reading", number).into());
        }
        let before = journal.retraction(session, number)?;
        let is_new = before.is_none();
        if let Some(end) = status.end.filter(|_| is_new) {
            return Err(LiveError::Ended { session, end });
        }
        let place = self.place(detail)?;
        if is_new {
            let entry = event(Event::Retraction { seq: number }, now);
            journal.append(session, status.length, &[entry]).await?;
            tracing::info!(session.id = %session, reading.number = number,
                "Withdrew reading {number} of session {session}");
        }
        let revision = before.unwrap_or(status.length) + 1;
        let belief = match place {
            None => None,
            Some(place) if is_new => {
                Some(self.renew(state, (Vec::new(), now), place, revision).await?)
            }
            Some(place) => {
                let start = state.memory.start(revision);
                Some(self.past(place, revision, POSES, start).await?)
            }
        };
        Ok(wire::ReadingRetracted {
            session,
            number: count(number),
            revision: count(revision),
            n_readings: count(status.n_readings - u64::from(is_new)),
            belief: in_detail(belief, detail),
        })
    }

    /// Closes the session with the last entry of its journal. Closing it again changes nothing.
    pub(crate) async fn close(&self) -> Result<(), LiveError> {
        let _turn = self.turns.insist().await;
        let store = self.tools.store.essential();
        let mut attempts = OVERTAKEN_MAX;
        let (now, status) = loop {
            let now = now_ms();
            let status = self.status(now)?;
            if status.end.is_some() {
                return Ok(());
            }
            let closed = event(Event::Closed, now);
            match store.journal().append(self.session.id, status.length, &[closed]).await {
                Err(AppendError::Sequence { .. }) if attempts > 0 => attempts -= 1,
                closed => break closed.map(|()| (now, status))?,
            }
        };
        let outcome = outcome(&self.tools, self.session.id, status.length)?;
        let is_known = outcome.latest.is_some() || status.n_readings == 0;
        let table = store.sessions();
        let noted = table.update(self.session.id, |session| {
            session.closed_at_ms = Some(now);
            if is_known {
                set_outcome(session, &outcome);
            }
            Ok::<(), LiveError>(())
        });
        noted.await??;
        Ok(())
    }

    /// Deletes the session while no other request uses it.
    pub(crate) async fn delete(&self) -> Result<(), LiveError> {
        let _turn = self.turns.insist().await;
        self.tools.store.essential().remove_session(self.session.id).await?;
        Ok(())
    }

    /// Whether the readings of a request repeat earlier ones, or which of them are new. New ones
    /// are refused when the session has ended or is full.
    fn request(&self, status: &Status, readings: &[Incoming]) -> Result<Request, LiveError> {
        let (journal, key) = (self.tools.store.journal(), Asker::current().key());
        let new = new_readings(readings, |id| Ok(stored(&journal, self.session.id, id, key)?))?;
        if new.is_empty() {
            return Ok(Request::Repeat(self.revision_of(&journal, readings, key)?));
        }
        if let Some(end) = status.end {
            return Err(LiveError::Ended { session: self.session.id, end });
        }
        let (found, more, max) = (status.n_stored(), new.len(), self.tools.readings_max);
        if found + more as u64 > max as u64 {
            return Err(Cause::ReadingsFull { what: "session", found, more, max }.into());
        }
        let options = options(&self.session);
        let numbered = (status.length..).zip(new);
        Ok(Request::Append(
            numbered.map(|(number, incoming)| Ready::of(number, incoming, &options)).collect(),
        ))
    }

    /// The revision of the belief that was answered to readings which are all known.
    fn revision_of(
        &self,
        journal: &Journal,
        readings: &[Incoming],
        key: Option<Uuid>,
    ) -> Result<u64, StoreError> {
        let mut revision = 0;
        for id in readings.iter().filter_map(|reading| reading.id.as_ref()) {
            let number = journal.find(self.session.id, id, key)?;
            revision = revision.max(number.map_or(0, |number| number + 1));
        }
        Ok(revision)
    }

    /// The belief of a revision, if the answer is to contain one.
    async fn repeat(
        &self,
        state: &mut State,
        revision: u64,
        detail: BeliefDetail,
    ) -> Result<Option<wire::Belief>, LiveError> {
        let remembered = state.remembered(revision);
        if remembered.is_some() || detail == BeliefDetail::None {
            return Ok(remembered);
        }
        let place = self.tools.pool.place()?;
        Ok(Some(self.past(place, revision, POSES, state.memory.start(revision)).await?))
    }

    /// Stores new readings and folds them. The compute slot is taken first: an overloaded server
    /// refuses instead of storing readings that it cannot answer.
    async fn append(
        &self,
        state: &mut State,
        Append { length, now, new, detail }: Append,
    ) -> Result<Option<wire::Belief>, LiveError> {
        let (place, key) = (self.place(detail)?, Asker::current().key());
        let entries: Vec<NewEntry> = new.iter().map(|ready| ready.entry(now, key)).collect();
        let (journal, n_new) = (self.tools.store.journal(), new.len());
        let span = tracing::info_span!("append", session.id = %self.session.id, n_new);
        journal.append(self.session.id, length, &entries).instrument(span).await?;
        metrics::counter!("palpate_readings_total").increment(n_new as u64);
        let Some(place) = place else { return Ok(None) };
        Ok(Some(self.renew(state, (new, now), place, length + n_new as u64).await?))
    }

    /// The belief after new entries of the journal, for their sender and the followers. `handed`
    /// are the readings among them and their time of arrival (ms since 1970).
    pub(super) async fn renew(
        &self,
        state: &mut State,
        (handed, now): (Vec<Ready>, u64),
        place: Place,
        length: u64,
    ) -> Result<wire::Belief, LiveError> {
        let (folding, place) = (self.folding(handed), (place, Urgency::Reading));
        let answer = self.ask(state, folding, place, length, answer(POSES)).await?;
        let belief = self.shown(length, &answer);
        state.remember(&belief);
        self.tools.traces.note(self.session.id, [Point::of(&belief, now)]);
        self.tools.notices.belief(&belief, now);
        self.count(state);
        self.publish(SessionEvent::Belief { belief: belief.clone() });
        Ok(belief)
    }

    /// A slot to compute. Without a belief to answer it is taken only for followers.
    pub(super) fn place(&self, detail: BeliefDetail) -> Result<Option<Place>, LiveError> {
        match detail {
            BeliefDetail::Full | BeliefDetail::Top => Ok(Some(self.tools.pool.place()?)),
            BeliefDetail::None if self.is_followed() => Ok(self.tools.pool.place().ok()),
            BeliefDetail::None => Ok(None),
        }
    }

    /// The warning about the first reading of a request that is stamped before its robot's number
    /// before it, of the request or else stored.
    fn set_back(&self, readings: &[&Incoming]) -> Result<Option<wire::Warning>, LiveError> {
        let (journal, key) = (self.tools.store.journal(), Asker::current().key());
        let stamps: BTreeMap<(&str, u64), i64> =
            readings.iter().filter_map(|reading| stamp(reading)).collect();
        for (index, reading) in readings.iter().enumerate() {
            let Some(((robot, later), now)) = stamp(reading) else { continue };
            let before = match stamps.range((robot, 0)..(robot, later)).next_back() {
                Some(((_, before), stamp)) => Some((*before, *stamp)),
                None => match later.checked_sub(1) {
                    Some(seq) => {
                        let id = ReadingId { robot: robot.to_owned(), seq };
                        let known = stored(&journal, self.session.id, &id, key)?;
                        known.and_then(|known| Some((seq, known.stamp_ns?)))
                    }
                    None => None,
                },
            };
            if let Some((before, _)) = before.filter(|(_, stamp)| *stamp > now) {
                let found = SetBack { robot: robot.to_owned(), later, before };
                return Ok(Some(of_clock(&found, format!("/readings/{index}/stamp"))));
            }
        }
        Ok(None)
    }

    /// The probable mistakes in readings that were just stored.
    pub(super) fn warned<'a>(
        &self,
        readings: impl Iterator<Item = &'a Incoming> + Clone,
    ) -> Result<Vec<wire::Warning>, LiveError> {
        let method = Some(options(&self.session).method);
        let mut warnings = warnings(readings.clone(), self.first_place()?, method);
        warnings.extend(self.set_back(&readings.collect::<Vec<_>>())?);
        Ok(warnings)
    }

    /// The place of the session's first reading, if it has one.
    fn first_place(&self) -> Result<Option<DVec3>, LiveError> {
        if let Some(known) = self.first_place.get() {
            return Ok(*known);
        }
        let first = self.tools.store.journal().entry(self.session.id, 0)?;
        let Some(first) = first else { return Ok(None) };
        let place = self.tools.sensors.place_of(&first).map_err(Cause::from)?;
        Ok(*self.first_place.get_or_init(|| place))
    }
}

/// An entry that is not a reading.
fn event(event: Event, received_at_ms: u64) -> NewEntry {
    NewEntry { reading_id: None, received_at_ms, event, written_by: Asker::current().key() }
}

/// The reading stored under a robot's number.
fn stored(
    journal: &Journal,
    session: Uuid,
    id: &ReadingId,
    key: Option<Uuid>,
) -> Result<Option<StoredReading>, StoreError> {
    let Some(seq) = journal.find(session, id, key)? else { return Ok(None) };
    Ok(journal.entry(session, seq)?.and_then(|entry| match entry.event {
        Event::Reading(reading) => Some(reading),
        Event::Retraction { .. } | Event::Closed => None,
    }))
}

fn in_detail(belief: Option<wire::Belief>, detail: BeliefDetail) -> Option<wire::Belief> {
    match detail {
        BeliefDetail::Full => belief,
        BeliefDetail::Top => belief.map(top),
        BeliefDetail::None => None,
    }
}
