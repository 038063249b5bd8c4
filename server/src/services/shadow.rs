//! Comparison of two versions of a catalogue on recorded sessions, before one becomes current.
//!
//! Both versions replay the same readings, so that what differs is the version alone. Not here:
//! queueing jobs (`jobs`).

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_core::belief::answer::Answer;
use palpate_core::object::ObjectIdx;
use palpate_core::reading::Felt;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_recogniser::belief::{READINGS_MAX, SurfaceBelief};
use palpate_recogniser::model::SurfaceModel;
use palpate_schemas as wire;
use palpate_schemas::{JobStage, Method};
use palpate_store::database::Database;
use palpate_store::entity::Session;
use palpate_store::error::StoreError;
use thiserror::Error;
use uuid::Uuid;

use crate::cause::Cause;
use crate::clock::now_ms;
use crate::known_sensors::KnownSensors;
use crate::live::belief::seen;
use crate::live::{PastReadings, status};
use crate::model::{Model, NoPart};
use crate::services::recalibration::{Sources, Target, Truths};
use crate::wire::session::{Options, options, surface_options, untold_unknown_prior};
use crate::wire::{NONE_OF_THESE, count};

/// Numbers of sessions: of a request at most, and by default. Chosen: a hundred sessions of eight
/// touches are replayed in about a minute.
const SESSIONS_MAX: usize = 300;
const SESSIONS: usize = 100;
/// Maximum number of changed sessions in a report.
const CHANGED_MAX: usize = 100;
/// Number of sessions per read.
const SESSIONS_PER_PAGE: usize = 256;

/// Error of a comparison.
#[derive(Debug, Error)]
pub(crate) enum ShadowError {
    #[error("it was told to stop")]
    Stopped,
    #[error(
        "catalogue {catalogue:?} has no session to compare versions on, expected ended sessions \
         with the method `surface` and a reading"
    )]
    NoSessions { catalogue: String },
    #[error("none of the {found} sessions can be replayed")]
    NothingReplayed { found: usize },
    #[error(transparent)]
    NoPart(#[from] NoPart),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for ShadowError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}

/// A version in a comparison.
pub(crate) struct Side<'a> {
    pub(crate) target: &'a Target,
    pub(crate) model: &'a Model,
}

/// Progress function: receives stage, done and total, and may stop the work.
type Progress<'a> = dyn Fn(JobStage, usize, usize) -> ControlFlow<()> + Sync + 'a;

/// Chooses the sessions of a comparison, oldest first: the named ones, or the newest. Blocks; ends
/// early when `stop` asks.
pub(crate) fn choose(
    target: &Target,
    named: Option<&[Uuid]>,
    store: &Database,
    stop: &Stop,
) -> Result<Vec<Uuid>, ShadowError> {
    let Some(named) = named else {
        let mut fit = Vec::new();
        let mut after = None;
        loop {
            stop.check();
            let page = store.sessions().list_whole(after, SESSIONS_PER_PAGE)?;
            for session in &page.items {
                if unfit(session, target, store)?.is_none() {
                    fit.push(session.id);
                }
            }
            after = page.next;
            if after.is_none() {
                break;
            }
        }
        if fit.is_empty() {
            return Err(ShadowError::NoSessions { catalogue: target.catalogue.name.clone() });
        }
        return Ok(fit.split_off(fit.len().saturating_sub(SESSIONS)));
    };
    if !(1..=SESSIONS_MAX).contains(&named.len()) {
        let detail = format!("{} sessions came, expected 1 to {SESSIONS_MAX}", named.len());
        return Err(Cause::field("/sessions", detail).into());
    }
    let mut chosen: Vec<Uuid> = Vec::with_capacity(named.len());
    for (index, id) in named.iter().enumerate() {
        let refused = |detail: String| Cause::field(format!("/sessions/{index}"), detail);
        let session = store.sessions().find(*id)?;
        let session = session.ok_or_else(|| refused(format!("there is no session {id}")))?;
        if let Some(why) = unfit(&session, target, store)? {
            return Err(refused(format!("session {id} {why}")).into());
        }
        if chosen.contains(id) {
            return Err(refused(format!("session {id} came twice")).into());
        }
        chosen.push(*id);
    }
    chosen.sort_unstable();
    Ok(chosen)
}

/// Why a session cannot be replayed; `None` if it can.
fn unfit(
    session: &Session,
    target: &Target,
    store: &Database,
) -> Result<Option<&'static str>, StoreError> {
    if session.catalogue != target.catalogue.id {
        return Ok(Some("is of another catalogue"));
    }
    if options(session).method != Method::Surface {
        return Ok(Some("has another method, expected `surface`"));
    }
    let status = status(store, session, &store.running(now_ms()))?;
    Ok(match (status.end, status.n_readings) {
        (None, _) => Some("is open, expected an ended one"),
        (Some(_), 0) => Some("has no reading"),
        (Some(_), _) => None,
    })
}

/// Replays sessions by both versions. Blocks.
pub(crate) fn compare(
    old: &Side<'_>,
    new: &Side<'_>,
    sessions: &[Uuid],
    risk: f64,
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<wire::ShadowReport, ShadowError> {
    let began = Instant::now();
    let mut truths = [old, new].map(|side| Truths::new(sources.store, side.target));
    let (mut sides, mut changed) = ([Tally::default(), Tally::default()], Vec::new());
    let mut n_with_truth = 0;
    for (done, id) in sessions.iter().enumerate() {
        if progress(JobStage::Replaying, done, sessions.len()).is_break() {
            return Err(ShadowError::Stopped);
        }
        let Some(session) = sources.store.sessions().find(*id)? else { continue };
        let Some(readings) = read(&session, sources.store, sources.sensors)? else { continue };
        let felt = readings.felt();
        let [truth_of_old, truth_of_new] = &mut truths;
        let told = truth_of_old.of(&session)?.zip(truth_of_new.of(&session)?);
        n_with_truth += usize::from(told.is_some());
        let [truth_of_old, truth_of_new] = [told.map(|told| told.0), told.map(|told| told.1)];
        let [of_old, of_new] = &mut sides;
        let mut by_old = || replayed(old.model, &session, &felt, risk, truth_of_old, of_old);
        let mut by_new = || replayed(new.model, &session, &felt, risk, truth_of_new, of_new);
        // Who comes first finds nothing in the processor's caches: they take turns.
        let (before, after) = if done % 2 == 0 {
            (by_old()?, by_new()?)
        } else {
            let after = by_new()?;
            (by_old()?, after)
        };
        if before.name != after.name {
            let truth = options(&session).truth;
            let truth = truth.map(|it| it.name.unwrap_or_else(|| NONE_OF_THESE.to_owned()));
            let n_readings = count(felt.len());
            let (old, new) = (before, after);
            changed.push(wire::ShadowChange { session: *id, n_readings, truth, old, new });
        }
    }
    let n_sessions = sides[0].n_sessions;
    if n_sessions == 0 {
        return Err(ShadowError::NothingReplayed { found: sessions.len() });
    }
    let n_changed = changed.len();
    changed.reverse();
    changed.truncate(CHANGED_MAX);
    let [old_side, new_side] = sides.map(|side| side.shown(n_with_truth));
    Ok(wire::ShadowReport {
        version: new.target.manifest.version,
        against: old.target.manifest.version,
        risk,
        n_sessions: count(n_sessions),
        n_left_out: count(sessions.len() - n_sessions),
        n_with_truth: count(n_with_truth),
        old: old_side,
        new: new_side,
        n_changed: count(n_changed),
        changed,
        seconds: began.elapsed().as_secs_f64(),
    })
}

/// The readings of a session; `None` if they cannot be used any more.
fn read(
    session: &Session,
    store: &Database,
    sensors: &Arc<KnownSensors>,
) -> Result<Option<PastReadings>, ShadowError> {
    match PastReadings::read(store, sensors, session, READINGS_MAX) {
        Ok(readings) => Ok(Some(readings)),
        Err(error @ (Cause::Store(_) | Cause::Compute(_))) => Err(error.into()),
        Err(error) => {
            tracing::warn!(session.id = %session.id, "Left session {} out: {error}", session.id);
            Ok(None)
        }
    }
}

/// What one version made of the sessions so far.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    n_sessions: usize,
    n_decided: usize,
    n_decided_wrongly: usize,
    /// Sum over the decided sessions.
    touches: usize,
    n_right: usize,
    unknown: f64,
    n_touches: usize,
    time: Duration,
}

impl Tally {
    fn shown(self, n_with_truth: usize) -> wire::ShadowSide {
        let share = |sum: f64, n: usize| (n > 0).then(|| sum / n as f64);
        wire::ShadowSide {
            n_decided: count(self.n_decided),
            n_decided_wrongly: count(self.n_decided_wrongly),
            touches: share(self.touches as f64, self.n_decided),
            accuracy: share(self.n_right as f64, n_with_truth),
            unknown: share(self.unknown, self.n_sessions).unwrap_or_default(),
            touch_ms: share(1e3 * self.time.as_secs_f64(), self.n_touches).unwrap_or_default(),
        }
    }
}

/// Replays a session by a version. `truth` is the index of its object in the version, inside `None`
/// for one that the version lacks.
fn replayed(
    model: &Model,
    session: &Session,
    felt: &[(&Felt, &SensorDescription)],
    risk: f64,
    truth: Option<Option<usize>>,
    tally: &mut Tally,
) -> Result<wire::ShadowAnswer, ShadowError> {
    let (surfaces, options) = (model.surface()?, options(session));
    let mut belief = begun(surfaces, &options, prior(session, model), model)?;
    let (rule, told) = (surfaces.calibration.stop, untold_unknown_prior(&options));
    let is_right = |answer: &Answer| truth.map(|truth| likeliest(answer) == truth);
    let mut decided_after = None;
    let mut last = belief.answer(0);
    for (n, (felt, sensor)) in felt.iter().enumerate() {
        let began = Instant::now();
        match felt {
            Felt::Press(reading) => belief.add(reading, sensor),
            Felt::Contact(contact) => belief.add_contact(contact),
        }
        last = belief.answer(0);
        tally.time += began.elapsed();
        if decided_after.is_none() && last.risk(told, rule) <= risk {
            decided_after = Some(count(n + 1));
            tally.n_decided += 1;
            tally.touches += n + 1;
            tally.n_decided_wrongly += usize::from(is_right(&last) == Some(false));
        }
    }
    tally.n_sessions += 1;
    tally.n_touches += felt.len();
    tally.unknown += last.unknown;
    tally.n_right += usize::from(is_right(&last) == Some(true));
    let best = likeliest(&last);
    let probability = best.map_or(last.unknown, |object| last.probabilities[object]);
    let name = best.map(|object| model.objects[object].name.clone());
    Ok(wire::ShadowAnswer { name, probability, decided_after })
}

fn begun(
    surfaces: &Arc<SurfaceModel>,
    options: &Options,
    prior: Option<Vec<f64>>,
    model: &Model,
) -> Result<SurfaceBelief, Cause> {
    let new = SurfaceBelief::new(Arc::clone(surfaces), surface_options(options), prior.as_deref());
    let belief = new.map_err(|error| Cause::field("/sessions", error))?;
    seen(belief, options, model).map_err(|error| Cause::field("/sessions", error))
}

/// The likeliest answer: the index of an object, or `None` for "none of these".
fn likeliest(answer: &Answer) -> Option<usize> {
    let ObjectIdx(best) = answer.best_object()?;
    let best = best as usize;
    (answer.probabilities[best] >= answer.unknown).then_some(best)
}

/// The session's prior for the objects of another version; without one that it does not name, all
/// objects are equally probable.
fn prior(session: &Session, model: &Model) -> Option<Vec<f64>> {
    let of = |id: Uuid| session.prior.iter().find(|(known, _)| *known == id).map(|it| it.1);
    let weights: Option<Vec<f64>> = model.objects.iter().map(|object| of(object.id)).collect();
    weights.filter(|weights| weights.iter().sum::<f64>() > 0.0)
}
