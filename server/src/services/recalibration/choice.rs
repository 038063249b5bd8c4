//! Choice of the sessions of a recalibration: named ones, or the newest that tell something.

use std::collections::{BTreeMap, BTreeSet};

use palpate_core::stop::Stop;
use palpate_recogniser::belief::READINGS_MAX;
use palpate_recogniser::belief::recalibrate::{READINGS_MIN, SESSIONS_MAX, SESSIONS_MIN};
use palpate_schemas::{Method, RecalibrateCatalogue};
use palpate_store::database::Database;
use palpate_store::entity::Session;
use palpate_store::error::StoreError;
use palpate_store::journal::{Entry, Event};
use uuid::Uuid;

use super::{RecalibrationError, Sources, Target, enough};
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::live::status;
use crate::wire::session::options;

/// Number of sessions per read.
const SESSIONS_PER_PAGE: usize = 256;

/// What the truths of sessions mean to a version.
pub(crate) struct Truths<'a> {
    store: &'a Database,
    target: &'a Target,
    /// Whether another version of the catalogue knew all objects of this one.
    knew_all: BTreeMap<u32, bool>,
}

impl<'a> Truths<'a> {
    pub(crate) fn new(store: &'a Database, target: &'a Target) -> Self {
        Self { store, target, knew_all: BTreeMap::new() }
    }

    /// The object that a session touched: its index in the version, inside `None` for one that the
    /// version lacks. `None` if the session does not tell, or is none of this catalogue and of
    /// the method `surface`.
    pub(crate) fn of(&mut self, session: &Session) -> Result<Option<Option<usize>>, StoreError> {
        let options = options(session);
        let is_ours = session.catalogue == self.target.catalogue.id;
        let (true, Method::Surface, Some(truth)) = (is_ours, options.method, options.truth) else {
            return Ok(None);
        };
        let objects = &self.target.manifest.objects;
        Ok(match truth.object {
            Some(id) => Some(objects.iter().position(|object| object.id == id)),
            // None of the objects of then: an object of today, unless all of them were known.
            None => self.knew_all(session.version)?.then_some(None),
        })
    }

    fn knew_all(&mut self, version: u32) -> Result<bool, StoreError> {
        if let Some(known) = self.knew_all.get(&version) {
            return Ok(*known);
        }
        let known = match self.store.catalogues().manifest(self.target.catalogue.id, version) {
            Ok(then) => {
                let ids: BTreeSet<Uuid> = then.objects.iter().map(|object| object.id).collect();
                self.target.manifest.objects.iter().all(|object| ids.contains(&object.id))
            }
            Err(StoreError::NoVersion { .. }) => false,
            Err(error) => return Err(error),
        };
        self.knew_all.insert(version, known);
        Ok(known)
    }
}

/// Chooses the sessions of a recalibration, oldest first. Named sessions must each have a usable
/// truth; without names, the newest [`SESSIONS_MAX`] that have one are taken. Blocks the thread;
/// ends early when `stop` asks.
pub(crate) fn choose(
    target: &Target,
    request: &RecalibrateCatalogue,
    sources: &Sources<'_>,
    stop: &Stop,
) -> Result<Vec<Uuid>, RecalibrationError> {
    let sensor = request.sensor.as_deref().map(|named| sensor(named, sources)).transpose()?;
    let mut truths = Truths::new(sources.store, target);
    let chosen = match &request.sessions {
        Some(named) => named_sessions(named, &mut truths, sensor, sources)?,
        None => newest(&mut truths, sensor, sources, stop)?,
    };
    let known: Vec<usize> = chosen.iter().filter_map(|(_, truth)| *truth).collect();
    enough(target, &known)?;
    Ok(chosen.into_iter().map(|(id, _)| id).collect())
}

fn sensor(named: &str, sources: &Sources<'_>) -> Result<Uuid, RecalibrationError> {
    let found = sources.sensors.find(named)?.ok_or_else(|| {
        let detail = format!("there is no sensor {named:?}, expected an id or a name");
        Cause::field("/sensor", detail)
    })?;
    Ok(found.id)
}

/// A session and the index of its object.
type Told = (Uuid, Option<usize>);

fn named_sessions(
    named: &[Uuid],
    truths: &mut Truths<'_>,
    sensor: Option<Uuid>,
    sources: &Sources<'_>,
) -> Result<Vec<Told>, RecalibrationError> {
    if !(SESSIONS_MIN..=SESSIONS_MAX).contains(&named.len()) {
        let n = named.len();
        let detail = format!("{n} sessions came, expected {SESSIONS_MIN} to {SESSIONS_MAX}");
        return Err(Cause::field("/sessions", detail).into());
    }
    let mut chosen = BTreeMap::new();
    for (index, id) in named.iter().enumerate() {
        let refused = |detail: String| Cause::field(format!("/sessions/{index}"), detail);
        let session = sources.store.sessions().find(*id)?;
        let session = session.ok_or_else(|| refused(format!("there is no session {id}")))?;
        let Some(truth) = truths.of(&session)? else {
            let detail = format!(
                "session {id} does not tell what it touched: expected a session of this catalogue \
                 with the method `surface` that was closed with its true object"
            );
            return Err(refused(detail).into());
        };
        if let Some(why) = unfit(&session, sensor, sources)? {
            return Err(refused(format!("session {id} {why}")).into());
        }
        if chosen.insert(*id, truth).is_some() {
            return Err(refused(format!("session {id} came twice")).into());
        }
    }
    Ok(chosen.into_iter().collect())
}

fn newest(
    truths: &mut Truths<'_>,
    sensor: Option<Uuid>,
    sources: &Sources<'_>,
    stop: &Stop,
) -> Result<Vec<Told>, RecalibrationError> {
    let table = sources.store.sessions();
    let (mut told, mut after) = (Vec::new(), None);
    loop {
        stop.check();
        let page = table.list_whole(after, SESSIONS_PER_PAGE)?;
        for session in &page.items {
            if let Some(truth) = truths.of(session)? {
                told.push((session.id, truth));
            }
        }
        after = page.next;
        if after.is_none() {
            break;
        }
    }
    let mut chosen = Vec::new();
    for (id, truth) in told.into_iter().rev() {
        if chosen.len() == SESSIONS_MAX {
            break;
        }
        stop.check();
        // It may have been deleted meanwhile.
        let Some(session) = table.find(id)? else { continue };
        if unfit(&session, sensor, sources)?.is_none() {
            chosen.push((id, truth));
        }
    }
    chosen.reverse();
    Ok(chosen)
}

/// Why a session whose truth is known tells too little; `None` if it does not.
fn unfit(
    session: &Session,
    sensor: Option<Uuid>,
    sources: &Sources<'_>,
) -> Result<Option<String>, Cause> {
    let status = status(sources.store, session, &sources.store.running(now_ms()))?;
    if status.end.is_none() {
        return Ok(Some("is open, expected an ended one".to_owned()));
    }
    if status.n_readings < READINGS_MIN as u64 {
        let found = status.n_readings;
        return Ok(Some(format!("has {found} readings, expected at least {READINGS_MIN}")));
    }
    let Some(sensor) = sensor else { return Ok(None) };
    let entries = sources.store.journal().entries(session.id, 0, READINGS_MAX)?;
    let is_other = |entry: &Entry| match &entry.event {
        Event::Reading(reading) => reading.sensor != sensor,
        Event::Retraction { .. } | Event::Closed => false,
    };
    let has_other = entries.iter().any(is_other);
    Ok(has_other.then(|| "has readings of other sensors".to_owned()))
}
