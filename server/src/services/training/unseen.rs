//! Held-out readings of the objects of an extended version, for its new calibration.
//!
//! The calibration depends on the similarity of all objects, so it is learnt again. For an
//! object trained by robots these are the tenth that its training held out, and later
//! readings; the mesh of another is touched again.

use std::ops::ControlFlow;

use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_recogniser::belief::calibrate::{HELD_BACK_MIN, READINGS};
use palpate_recogniser::belief::hold_out::is_held_back;
use palpate_recogniser::model::SurfaceModel;
use palpate_schemas::ObjectReport;
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::family::sample_runs;
use palpate_sim::sampler::{SampleError, SamplerConfig, sample};
use palpate_store::catalogue::VersionObject;
use rayon::prelude::*;

use super::base::Base;
use super::material::{mesh, own_readings};
use super::{Plan, Sources, TrainingFailure};

/// Maximum number of objects of the extended version that provide readings. Chosen such that
/// an extension costs about as much for any size of the version.
const OBJECTS_MAX: usize = 40;

/// Number of touches of a mesh. Chosen: twice those of a trial.
const TOUCHES: usize = 16;

/// Tolerance of a mesh's centroid against its value in training, metres: rounding.
const SAME_MESH: f64 = 1e-6;

/// Readings of one object, possibly none.
pub(super) struct Unseen {
    pub(super) readings: Vec<Reading>,
    pub(super) sensor: SensorDescription,
    /// Number of consecutive readings by one sensor of a family; `None` if one took them all.
    pub(super) run: Option<usize>,
}

/// Held-out readings of the objects of a version, in its order; none for those at `places`,
/// which are trained again, and only for some of very many.
pub(super) fn gather(
    plan: &Plan,
    base: &Base,
    places: &[Option<usize>],
    known: &SurfaceModel,
    sources: &Sources<'_>,
    stop: &(dyn Fn() -> ControlFlow<()> + Sync),
) -> Result<Vec<Unseen>, TrainingFailure> {
    let stays = |place: &usize| !places.contains(&Some(*place));
    let staying: Vec<usize> = (0..base.model.objects.len()).filter(stays).collect();
    let stride = staying.len().div_ceil(OBJECTS_MAX).max(1);
    let of = |(place, object): (usize, &VersionObject)| {
        let turn = staying.iter().position(|other| *other == place);
        let is_asked = turn.is_some_and(|turn| turn.is_multiple_of(stride));
        let (report, map) = (base.reports.get(place), known.maps().get(place));
        match (report, map) {
            (Some(report), Some(map)) if is_asked => {
                let origin = map.origin_in_training();
                one(plan, place, object, report, origin, sources, stop)
            }
            _ => Ok(nothing(plan)),
        }
    };
    base.model.objects.par_iter().enumerate().map(of).collect()
}

fn nothing(plan: &Plan) -> Unseen {
    Unseen { readings: Vec::new(), sensor: plan.sensor.description.clone(), run: None }
}

fn one(
    plan: &Plan,
    place: usize,
    object: &VersionObject,
    report: &ObjectReport,
    origin_in_training: glam::DVec3,
    sources: &Sources<'_>,
    stop: &(dyn Fn() -> ControlFlow<()> + Sync),
) -> Result<Unseen, TrainingFailure> {
    match own_readings(plan, object, sources) {
        Ok(Some(material)) => {
            let n_trained = report.n_readings as usize;
            let TrainingSet { readings, sensor } = material.set();
            // If an object lost readings, those of its surface are unknown.
            let is_whole = readings.len() >= n_trained;
            let is_unseen =
                |at: &usize| is_whole && (*at >= n_trained || is_held_back(*at, n_trained));
            let unseen: Vec<Reading> =
                (0..readings.len()).filter(is_unseen).map(|at| readings[at].clone()).collect();
            let is_enough = unseen.len() >= HELD_BACK_MIN;
            let readings = if is_enough { unseen } else { Vec::new() };
            return Ok(Unseen { readings, sensor: sensor.clone(), run: None });
        }
        // Later readings do not fit its surface.
        Err(
            TrainingFailure::NoPoses { .. }
            | TrainingFailure::Sensors { .. }
            | TrainingFailure::Reading { .. },
        ) => return Ok(nothing(plan)),
        Err(failure) => return Err(failure),
        Ok(None) => {}
    }
    let name = || object.name.clone();
    let mesh = match mesh(object.id, sources, &name) {
        Ok(mesh) if mesh.centroid().distance(origin_in_training) < SAME_MESH => mesh,
        // The mesh was removed, or replaced by another one.
        Ok(_) | Err(TrainingFailure::NoData { .. }) => return Ok(nothing(plan)),
        Err(failure) => return Err(failure),
    };
    let sensor = plan.sensor.description.clone();
    let simulator = PressSimulator::new(mesh, sensor.clone());
    let config = SamplerConfig::for_simulator(&simulator);
    let id = SensorId(plan.sensor.id.as_u128());
    // Different from the seeds of all trainings.
    let seed = !plan.seed.wrapping_add(place as u64);
    let mut hear = |_: usize, _: usize| stop();
    let family = plan.family();
    let (taken, run) = if family.is_single() {
        (sample(&simulator, id, TOUCHES, seed, &config, &mut hear), None)
    } else {
        // Runs of this seed are other touches than those of any map.
        let (runs, seed) = ((TOUCHES / READINGS, READINGS), !seed);
        let taken = sample_runs(&simulator, &family, id, runs, seed, &config, &mut hear);
        (taken, Some(READINGS))
    };
    match taken {
        Ok(readings) => Ok(Unseen { readings, sensor, run }),
        Err(SampleError::Stopped { .. }) => Err(TrainingFailure::Stopped),
        // This sensor cannot touch it often enough; that of its training could.
        Err(_) => Ok(nothing(plan)),
    }
}
