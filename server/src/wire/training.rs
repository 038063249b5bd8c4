//! Conversion of catalogues, trainings and jobs.

use palpate_core::object::MapPatch;
use palpate_core::vocabulary::ClassIdx;
use palpate_core::vocabulary::MAX_CLASSES;
use palpate_dissertation::patch_pair::DistanceBins;
use palpate_dissertation::sva::model::ObjectMap;
use palpate_dissertation::sva::train::{DistanceRange, TrainingConfig};
use palpate_recogniser::train::mesh_touches;
use palpate_schemas as wire;
use palpate_schemas::{Descriptor, JobState, StartTraining};
use palpate_store::catalogue::{Catalogue, Manifest, Switch, VersionObject};
use palpate_store::entity as stored;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::wire::recalibration::JobRequest;
use crate::wire::{INTEGER_MAX, Invalid, count, descriptor, outside, time};

/// Maximum number of switches of the current version in an answer.
const HISTORY_MAX: usize = 100;
/// Maximum number of simulated readings of an object.
const READINGS_MAX: u64 = 20_000;
/// Number of steps of a range of distances.
const DISTANCE_STEPS: u16 = 40;
/// Largest distance between two touches, in metres.
const DISTANCE_MAX: f64 = 10.0;

/// Content of a version's manifest beside its objects and blocks.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct VersionParameters {
    pub(crate) training: StartTraining,
    pub(crate) report: wire::TrainingReport,
    /// The versions whose maps were merged, unless it was trained.
    #[serde(default)]
    pub(crate) merged_from: Vec<wire::VersionReference>,
}

/// A catalogue in its wire form.
pub(crate) fn catalogue(catalogue: &Catalogue) -> wire::Catalogue {
    let mut history = history(catalogue);
    history.truncate(HISTORY_MAX);
    wire::Catalogue {
        name: catalogue.name.clone(),
        current: history.first().cloned(),
        latest_version: catalogue.latest,
        aliases: catalogue.aliases.clone(),
        labels: catalogue.labels.clone(),
        history,
    }
}

/// The switches, newest first.
fn history(catalogue: &Catalogue) -> Vec<wire::CurrentVersion> {
    let revisions = (0..=catalogue.revision).rev();
    let entry = |(switch, revision): (&Switch, u64)| wire::CurrentVersion {
        version: switch.version,
        revision: count(revision),
        changed_at: time(switch.at_ms),
    };
    catalogue.history.iter().rev().zip(revisions).map(entry).collect()
}

/// A version whose stored parameters cannot be read.
#[derive(Debug, Error)]
#[error("what is stored of version {catalogue}/{version} cannot be used: {source}")]
pub(crate) struct Unreadable {
    catalogue: String,
    version: u32,
    source: serde_json::Error,
}

/// A version in its wire form.
pub(crate) fn version(
    catalogue: &Catalogue,
    manifest: &Manifest,
) -> Result<wire::CatalogueVersion, Unreadable> {
    let parameters = parameters(catalogue, manifest)?;
    Ok(wire::CatalogueVersion {
        catalogue: catalogue.name.clone(),
        version: manifest.version,
        is_current: catalogue.current == Some(manifest.version),
        created_at: time(manifest.created_at_ms),
        job: manifest.job,
        merged_from: parameters.merged_from,
        training: parameters.training,
        report: parameters.report,
        damage: None,
    })
}

/// The content of a version's manifest beside its objects and blocks.
pub(crate) fn parameters(
    catalogue: &Catalogue,
    manifest: &Manifest,
) -> Result<VersionParameters, Unreadable> {
    serde_json::from_str(&manifest.parameters).map_err(|source| Unreadable {
        catalogue: catalogue.name.clone(),
        version: manifest.version,
        source,
    })
}

/// An object's map in its wire form, with up to `limit` patches from number `from` on.
pub(crate) fn object_map(
    object: &VersionObject,
    map: &ObjectMap,
    from: usize,
    limit: usize,
) -> wire::ObjectMap {
    let (patches, distances) = (map.patches(), map.index().distances());
    let from = from.min(patches.len());
    let end = from.saturating_add(limit).min(patches.len());
    let classes = map.index().likeliest_classes(from..end);
    wire::ObjectMap {
        id: object.id,
        name: object.name.clone(),
        origin_in_mesh: map.origin_in_training().to_array(),
        distances: wire::MapDistances {
            min: distances.min(),
            max: distances.max(),
            n_bins: u32::from(distances.n()),
        },
        n_postings: map.index().postings().len() as u64,
        index_bytes: map.index().bytes() as u64,
        n_patches: count(patches.len()),
        patches: patches[from..end].iter().zip(classes).map(patch).collect(),
        next_cursor: (end < patches.len()).then(|| end.to_string()),
    }
}

fn patch((patch, class): (&MapPatch, Option<ClassIdx>)) -> wire::MapPatch {
    wire::MapPatch {
        position: patch.position.map(f64::from),
        normal: patch.normal.map(f64::from),
        normal_confidence: f64::from(patch.normal_confidence),
        class: class.map(|class| u32::from(class.0)),
    }
}

/// A stored job in its wire form.
pub(crate) fn job(job: &stored::Job) -> wire::Job {
    let state = state(job.state);
    let (mut training, mut recalibration, mut shadow) = (StartTraining::default(), None, None);
    match serde_json::from_str(&job.request) {
        Ok(JobRequest::Training(asked)) => training = *asked,
        Ok(JobRequest::Recalibration { recalibration: asked }) => recalibration = Some(asked),
        Ok(JobRequest::Shadow { shadow: asked, .. }) => shadow = Some(asked),
        Err(_) => {}
    }
    wire::Job {
        id: job.id,
        catalogue: job.catalogue.clone(),
        state,
        stage: serde_json::from_value(job.stage.as_str().into())
            .ok()
            .filter(|_| state == JobState::Running),
        // The progress is known to its worker alone.
        done: 0,
        total: 0,
        eta_s: None,
        training,
        recalibration,
        shadow,
        shadow_report: job.report.as_deref().and_then(|text| serde_json::from_str(text).ok()),
        version: job.version,
        reason: job.error.clone().filter(|_| state.is_final()),
        created_at: time(job.created_at_ms),
        started_at: job.started_at_ms.map(time),
        finished_at: job.finished_at_ms.map(time),
    }
}

/// A stored job's state in its wire form.
pub(crate) fn state(state: stored::JobState) -> JobState {
    match state {
        stored::JobState::Queued => JobState::Queued,
        stored::JobState::Running => JobState::Running,
        stored::JobState::Succeeded => JobState::Succeeded,
        stored::JobState::Failed => JobState::Failed,
        stored::JobState::Cancelled => JobState::Cancelled,
    }
}

/// A training with every default filled in, its numbers checked. Objects and sensor are still
/// named as in the request.
pub(crate) fn training(request: &StartTraining) -> Result<StartTraining, Invalid> {
    let asked = (request.readings_per_object, request.surface_readings_per_object);
    let [n_readings, n_of_surface] = mesh_touches(asked.0, asked.1).map(u64::from);
    super::within("/readings_per_object", n_readings, 20, READINGS_MAX)?;
    super::within("/surface_readings_per_object", n_of_surface, n_readings, READINGS_MAX)?;
    let seed = super::within("/seed", request.seed.unwrap_or(1), 0, INTEGER_MAX)?;
    let n_classes = u64::from(request.n_classes.unwrap_or(25));
    super::within("/n_classes", n_classes, 2, MAX_CLASSES as u64)?;
    if let Some(range) = request.distance_range {
        distances(range)?;
    }
    let chosen = request.descriptor.unwrap_or(Descriptor::Mnti);
    if !descriptor::from_wire(chosen).gives_one_feature() {
        let name = descriptor::from_wire(chosen).name();
        let detail = format!("came {name}, expected a descriptor with one feature a reading");
        return Err(Invalid::field("/descriptor", detail));
    }
    Ok(StartTraining {
        objects: request.objects.clone(),
        sensor: Some(request.sensor.clone().unwrap_or_else(|| "digitacts-6x6".to_owned())),
        sensor_knowledge: request.sensor_knowledge,
        readings_per_object: Some(count(n_readings)),
        surface_readings_per_object: Some(count(n_of_surface)),
        seed: Some(seed),
        n_classes: Some(count(n_classes)),
        descriptor: Some(chosen),
        distance_range: request.distance_range,
        geometric: request.geometric.map(super::geometry::training).transpose()?,
        appearance: request.appearance.as_ref().map(super::appearance::training).transpose()?,
        surface: Some(surface(request)),
        sva: Some(sva(request)?),
        extend: None,
        activate: Some(request.activate.unwrap_or(true)),
        strict: Some(request.strict.unwrap_or(false)),
    })
}

/// Whether surfaces are to be trained; like pair maps they need poses.
fn surface(request: &StartTraining) -> bool {
    request.surface.or(request.sva).unwrap_or(true)
}

/// Whether pair maps are to be trained; without them another part is required.
fn sva(request: &StartTraining) -> Result<bool, Invalid> {
    let wanted = request.sva.unwrap_or(true);
    if !wanted && request.appearance.is_none() && !surface(request) {
        let detail = "came false without `appearance` or `surface`: nothing would be learnt";
        return Err(Invalid::field("/sva", detail));
    }
    if !wanted && request.geometric.is_some() {
        let detail = "came false with `geometric`, whose maps need the frames of pair maps";
        return Err(Invalid::field("/sva", detail));
    }
    Ok(wanted)
}

/// A training that extends a version: objects and readings of the request, settings of the
/// version. Settings in the request are refused.
pub(crate) fn extension(
    request: &StartTraining,
    version: u32,
    base: &StartTraining,
) -> Result<StartTraining, Invalid> {
    let given = [
        ("/sensor_knowledge", request.sensor_knowledge.is_some()),
        ("/n_classes", request.n_classes.is_some()),
        ("/descriptor", request.descriptor.is_some()),
        ("/distance_range", request.distance_range.is_some()),
        ("/geometric", request.geometric.is_some()),
        ("/appearance", request.appearance.is_some()),
        ("/surface", request.surface.is_some()),
        ("/sva", request.sva.is_some()),
    ];
    if let Some((field, _)) = given.iter().find(|(_, came)| *came) {
        let detail = format!("came with `extend`: it is as version {version} has it");
        return Err(Invalid::field(*field, detail));
    }
    if base.geometric.is_some() {
        let detail = format!(
            "version {version} has maps of contact, whose classes are learnt from all objects \
             together: train all objects anew"
        );
        return Err(Invalid::field("/extend", detail));
    }
    let settings = StartTraining {
        sensor_knowledge: Some(stated_knowledge(base)),
        n_classes: base.n_classes,
        descriptor: base.descriptor,
        distance_range: base.distance_range,
        appearance: base.appearance.clone(),
        // Versions older than surfaces do not state that they have none.
        surface: Some(base.surface.unwrap_or(false)),
        sva: base.sva,
        ..request.clone()
    };
    Ok(StartTraining { extend: Some(version), ..training(&settings)? })
}

/// Trust in the description of the sensor that presses meshes. Trainings that were requested
/// before there was a choice press exactly as described.
pub(crate) fn stated_knowledge(training: &StartTraining) -> wire::SensorKnowledge {
    training.sensor_knowledge.unwrap_or(wire::SensorKnowledge::Measured)
}

/// Core's configuration of a checked training.
pub(crate) fn config(training: &StartTraining) -> Result<TrainingConfig, Invalid> {
    let default = TrainingConfig::default();
    Ok(TrainingConfig {
        n_classes: training.n_classes.map_or(default.n_classes, |n| n as usize),
        descriptor: training.descriptor.map_or(default.descriptor, descriptor::from_wire),
        distances: training.distance_range.map_or(Ok(default.distances), distances)?,
        ..default
    })
}

fn distances(range: wire::DistanceRange) -> Result<DistanceRange, Invalid> {
    let fits = |value: f64| value.is_finite() && (0.0..=DISTANCE_MAX).contains(&value);
    let far = |pointer: &str, found: f64| {
        let expected = format!("0 to {DISTANCE_MAX} m");
        outside(pointer, found, [0.0, DISTANCE_MAX], &expected)
    };
    if !fits(range.min) {
        return Err(far("/distance_range/min", range.min));
    }
    let Some(max) = range.max else {
        return Ok(DistanceRange::ToLargest { min: range.min, n: DISTANCE_STEPS });
    };
    if !fits(max) {
        return Err(far("/distance_range/max", max));
    }
    DistanceBins::new(range.min, max, DISTANCE_STEPS)
        .map(DistanceRange::Fixed)
        .map_err(|error| Invalid::field("/distance_range", error))
}
