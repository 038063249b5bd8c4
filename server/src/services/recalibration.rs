//! Recalibration of a version from ended sessions: which sessions count, their replay, and the
//! calibration that is fitted to them.
//!
//! Not here: queueing jobs and storing versions (`jobs`, `catalogues`).

mod choice;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use palpate_recogniser::belief::recalibrate::{
    Recalibration, SESSIONS_MIN, recalibrate as fit_to_sessions,
};
use palpate_recogniser::belief::{PastSession, READINGS_MAX};
use palpate_recogniser::model::EvidenceCalibration;
use palpate_schemas::{JobStage, RecalibrationReport};
use palpate_store::catalogue::{Catalogue, Manifest};
use palpate_store::database::Database;
use palpate_store::model_codec::calibration_to_block;
use thiserror::Error;
use uuid::Uuid;

use crate::cause::Cause;
use crate::known_sensors::KnownSensors;
use crate::live::PastReadings;
use crate::model::{Model, NoPart};
use crate::wire::recalibration::{Used, report};
use crate::wire::session::{options, surface_options};
pub(crate) use choice::{Truths, choose};

/// Error of a recalibration.
#[derive(Debug, Error)]
pub(crate) enum RecalibrationError {
    #[error("it was told to stop")]
    Stopped,
    #[error(
        "catalogue {catalogue:?} has {found} sessions for a recalibration of version {version}, \
         expected at least {SESSIONS_MIN}: ended sessions with the method `surface`, at least \
         three readings, and an object of the version as their truth (close them with `object`)"
    )]
    FewSessions { catalogue: String, version: u32, found: usize },
    #[error(
        "all {found} sessions for a recalibration of version {version} of catalogue {catalogue:?} \
         touched one object, expected sessions of at least two objects"
    )]
    OneTouched { catalogue: String, version: u32, found: usize },
    #[error(
        "version {version} of catalogue {catalogue:?} has one object, expected at least two: \
         without it nothing is left to compare an unknown object with"
    )]
    OneObject { catalogue: String, version: u32 },
    #[error(transparent)]
    NoPart(#[from] NoPart),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for RecalibrationError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}

/// Where sessions and their readings are.
pub(crate) struct Sources<'a> {
    pub(crate) store: &'a Database,
    pub(crate) sensors: &'a Arc<KnownSensors>,
}

/// A version to recalibrate.
#[derive(Clone, Debug)]
pub(crate) struct Target {
    pub(crate) catalogue: Catalogue,
    pub(crate) manifest: Manifest,
}

/// The result: the block of the new calibration, and the report.
pub(crate) struct Recalibrated {
    pub(crate) block: Vec<u8>,
    pub(crate) report: RecalibrationReport,
}

/// Progress function: receives stage, done and total, and may stop the work.
type Progress<'a> = dyn Fn(JobStage, usize, usize) -> ControlFlow<()> + Sync + 'a;

/// A session of the replay.
struct Replayed {
    readings: PastReadings,
    truth: Option<usize>,
    motion: Option<palpate_core::reading::Looseness>,
}

/// Fits the calibration of a version's `model` to sessions. Blocks.
pub(crate) fn recalibrate(
    target: &Target,
    model: &Model,
    sessions: &[Uuid],
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<Recalibrated, RecalibrationError> {
    let began = Instant::now();
    let surfaces = model.surface()?;
    let replayed = read(target, sessions, sources, progress)?;
    let known: Vec<usize> = replayed.iter().filter_map(|session| session.truth).collect();
    enough(target, &known)?;
    let past: Vec<PastSession<'_>> = replayed
        .iter()
        .map(|session| PastSession {
            readings: session.readings.felt(),
            truth: session.truth,
            motion: session.motion,
        })
        .collect();
    let go_on = |done: usize, total: usize| progress(JobStage::Replaying, done, total);
    let found = fit_to_sessions(surfaces, &past, &go_on).ok_or(RecalibrationError::Stopped)?;
    let n_left_out = sessions.len() - replayed.len();
    let used = Used { n_known: known.len(), n_left_out };
    Ok(recalibrated(&found, &surfaces.calibration, target, used, began))
}

fn recalibrated(
    found: &Recalibration,
    before: &EvidenceCalibration,
    target: &Target,
    used: Used,
    began: Instant,
) -> Recalibrated {
    let seconds = began.elapsed().as_secs_f64();
    let block = calibration_to_block(&found.calibration);
    Recalibrated {
        block: block.expect("a recalibration rests on sessions"),
        report: report(found, before, target.manifest.version, used, seconds),
    }
}

/// Reads sessions; those that were deleted, or whose readings cannot be used, are left out.
fn read(
    target: &Target,
    sessions: &[Uuid],
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<Vec<Replayed>, RecalibrationError> {
    let mut truths = Truths::new(sources.store, target);
    let mut replayed = Vec::with_capacity(sessions.len());
    for (done, id) in sessions.iter().enumerate() {
        if progress(JobStage::Sampling, done, sessions.len()).is_break() {
            return Err(RecalibrationError::Stopped);
        }
        let Some(session) = sources.store.sessions().find(*id)? else { continue };
        let Some(truth) = truths.of(&session)? else { continue };
        let read = PastReadings::read(sources.store, sources.sensors, &session, READINGS_MAX);
        let readings = match read {
            Ok(readings) => readings,
            Err(error @ (Cause::Store(_) | Cause::Compute(_))) => return Err(error.into()),
            Err(error) => {
                tracing::warn!(session.id = %id, "Left session {id} out: {error}");
                continue;
            }
        };
        let motion = surface_options(&options(&session)).motion;
        replayed.push(Replayed { readings, truth, motion });
    }
    Ok(replayed)
}

/// Refuses sessions of known objects, by the objects' indices, that are too few.
fn enough(target: &Target, known: &[usize]) -> Result<(), RecalibrationError> {
    let (catalogue, version) = (target.catalogue.name.clone(), target.manifest.version);
    let found = known.len();
    if target.manifest.objects.len() < 2 {
        return Err(RecalibrationError::OneObject { catalogue, version });
    }
    if found < SESSIONS_MIN {
        return Err(RecalibrationError::FewSessions { catalogue, version, found });
    }
    if known.iter().all(|object| *object == known[0]) {
        return Err(RecalibrationError::OneTouched { catalogue, version, found });
    }
    Ok(())
}
