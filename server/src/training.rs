//! What a training job does: readings of each object, a vocabulary, maps of each object.
//!
//! Everything is decided by the stored material, the request and its seed. It runs on the
//! training pool's threads and asks between steps whether it is to stop. Not here: queueing
//! jobs and storing what comes out.

mod geometry;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use palpate_core::model::{Catalogue, ObjectMap};
use palpate_core::occupancy::GridError;
use palpate_core::occupancy::grid::CELLS_MAX;
use palpate_core::reading::{Reading, ReadingError, SensorId};
use palpate_core::train::geometry::GeometryConfig;
use palpate_core::train::{TrainError, TrainingConfig, TrainingSet, learn_vocabulary, map_object};
use palpate_core::vocabulary::Vocabulary;
use palpate_schemas::{JobStage, ObjectReport};
use palpate_sim::mesh::{Mesh, MeshError};
use palpate_sim::press::PressSimulator;
use palpate_sim::rig::PlanarError;
use palpate_sim::sampler::{SampleError, SamplerConfig, sample};
use palpate_store::catalogue::VersionObject;
use palpate_store::database::Database;
use palpate_store::entity::Sensor;
use palpate_store::error::StoreError;
use palpate_store::journal::Event;
use rayon::prelude::*;
use thiserror::Error;
use uuid::Uuid;

use crate::refusal::Refusal;
use crate::sensors::Sensors;
use crate::wire::object::{read_format, unit_metres};
use crate::wire::reading::from_store;
use crate::wire::{count, geometry as wire_geometry};

/// What is to be trained.
pub(crate) struct Plan {
    pub(crate) objects: Vec<VersionObject>,
    /// The sensor that touches meshes.
    pub(crate) sensor: Arc<Sensor>,
    pub(crate) readings_per_object: usize,
    pub(crate) seed: u64,
    pub(crate) config: TrainingConfig,
    /// How maps of contact are trained, if they are.
    pub(crate) geometry: Option<GeometryConfig>,
}

/// What came out, object by object in the plan's order.
pub(crate) struct Trained {
    pub(crate) model: Catalogue,
    pub(crate) objects: Vec<ObjectReport>,
}

/// Where trainings read their material.
pub(crate) struct Sources<'a> {
    pub(crate) store: &'a Database,
    pub(crate) sensors: &'a Sensors,
}

/// Hears how far a training is (stage, done, total) and may stop it.
pub(crate) type Progress<'a> = dyn Fn(JobStage, usize, usize) -> ControlFlow<()> + Sync + 'a;

/// Why a training came to nothing.
#[derive(Debug, Error)]
pub(crate) enum TrainingFailure {
    #[error("it was told to stop")]
    Stopped,
    #[error("object {object:?} has no data: upload a mesh or readings")]
    NoData { object: String },
    #[error("object {object:?} has readings of several sensors, expected one")]
    Sensors { object: String },
    #[error("object {object:?}: {source}")]
    Mesh { object: String, source: MeshError },
    #[error("object {object:?}: {source}")]
    Reading { object: String, source: ReadingError },
    #[error("object {object:?}: {source}")]
    Sampling { object: String, source: SampleError },
    #[error("object {object:?}: {source}")]
    Mapping { object: String, source: TrainError },
    #[error("object {object:?}: {source}")]
    Planar { object: String, source: PlanarError },
    #[error("object {object:?}: {source} with cells of {} mm", cell * 1e3)]
    Grid { object: String, cell: f64, source: GridError },
    #[error(
        "object {object:?} brings the maps to {found} cells of {} mm, expected at most \
         {CELLS_MAX} for all objects: choose larger cells", cell * 1e3
    )]
    Cells { object: String, cell: f64, found: usize },
    #[error(transparent)]
    Vocabulary(#[from] TrainError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Refused(#[from] Refusal),
}

/// The readings of one object.
struct Material {
    object: VersionObject,
    readings: Vec<Reading>,
    sensor: Arc<Sensor>,
    origin: Option<DVec3>,
    /// Presses straight down, of a mesh whose planar map is to be learnt; else the maps of
    /// contact are learnt from the readings.
    planar: Option<Vec<Reading>>,
}

/// Trains. The object at place i of the plan is touched with seed + i.
pub(crate) fn train(
    plan: &Plan,
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<Trained, TrainingFailure> {
    let materials = gather(plan, sources, progress)?;
    step(progress, JobStage::Vocabulary, 0, 1)?;
    let sets: Vec<TrainingSet<'_>> = materials.iter().map(Material::set).collect();
    let vocabulary = learn_vocabulary(&sets, &plan.config, plan.seed)?;
    step(progress, JobStage::Vocabulary, 1, 1)?;
    let maps = map_all(plan, &materials, &vocabulary, progress)?;
    let geometry = match &plan.geometry {
        Some(config) => Some(geometry::learn(config, &materials, &maps, progress)?),
        None => None,
    };
    let mut objects: Vec<ObjectReport> =
        materials.iter().zip(&maps).map(|(material, map)| report(material, map)).collect();
    for (object, map) in objects.iter_mut().zip(geometry.iter().flat_map(|model| &model.maps)) {
        object.geometry = Some(wire_geometry::report(map));
    }
    let model = Catalogue {
        vocabulary,
        association: plan.config.association,
        objects: maps.into_iter().map(Arc::new).collect(),
        geometry: geometry.map(Arc::new),
    };
    Ok(Trained { model, objects })
}

impl Material {
    fn set(&self) -> TrainingSet<'_> {
        TrainingSet { readings: &self.readings, sensor: &self.sensor.description }
    }

    /// The readings that maps of contact are learnt from.
    fn pressed(&self) -> TrainingSet<'_> {
        let readings = self.planar.as_deref().unwrap_or(&self.readings);
        TrainingSet { readings, ..self.set() }
    }
}

fn gather(
    plan: &Plan,
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<Vec<Material>, TrainingFailure> {
    let total = plan.objects.len() * plan.readings_per_object;
    let done = AtomicUsize::new(0);
    step(progress, JobStage::Sampling, 0, total)?;
    let gather_one = |(index, object): (usize, &VersionObject)| {
        let material = match own_readings(object, sources)? {
            Some((readings, sensor)) => {
                done.fetch_add(plan.readings_per_object, Ordering::Relaxed);
                Material { object: object.clone(), readings, sensor, origin: None, planar: None }
            }
            None => touch(plan, index, object, sources, &done, progress)?,
        };
        step(progress, JobStage::Sampling, done.load(Ordering::Relaxed), total)?;
        Ok(material)
    };
    plan.objects.par_iter().enumerate().map(gather_one).collect()
}

/// Readings that robots took, and their sensor.
type OwnReadings = (Vec<Reading>, Arc<Sensor>);

/// The readings that robots took of an object, and their sensor; `None` without any.
fn own_readings(
    object: &VersionObject,
    sources: &Sources<'_>,
) -> Result<Option<OwnReadings>, TrainingFailure> {
    let entries = sources.store.training().entries(object.id, 0, usize::MAX)?;
    let mut readings = Vec::with_capacity(entries.len());
    let mut sensor: Option<Arc<Sensor>> = None;
    for entry in &entries {
        let Event::Reading(stored) = &entry.event else { continue };
        let used = match &sensor {
            Some(sensor) if sensor.id == stored.sensor => Arc::clone(sensor),
            Some(_) => return Err(TrainingFailure::Sensors { object: object.name.clone() }),
            None => sources.sensors.get(&stored.sensor.to_string())?,
        };
        let calibration = sources.sensors.calibrations().of(used.id, stored.calibration)?;
        let reading = from_store(stored, &used, calibration.as_deref())
            .map_err(|source| TrainingFailure::Reading { object: object.name.clone(), source })?;
        readings.push(reading);
        sensor = Some(used);
    }
    Ok(sensor.map(|sensor| (readings, sensor)))
}

/// Touches an object's mesh in simulation.
fn touch(
    plan: &Plan,
    index: usize,
    object: &VersionObject,
    sources: &Sources<'_>,
    done: &AtomicUsize,
    progress: &Progress<'_>,
) -> Result<Material, TrainingFailure> {
    let name = || object.name.clone();
    let mesh = mesh(object.id, sources, &name)?;
    let origin = mesh.centroid();
    let simulator = PressSimulator::new(mesh, plan.sensor.description.clone());
    let planar = geometry::planar_presses(plan, index, object, &simulator)?;
    let config = SamplerConfig::for_simulator(&simulator);
    let total = plan.objects.len() * plan.readings_per_object;
    let mut counted = 0;
    let mut hear = |taken: usize, _: usize| {
        let now = done.fetch_add(taken - counted, Ordering::Relaxed) + (taken - counted);
        counted = taken;
        progress(JobStage::Sampling, now, total)
    };
    let id = SensorId(plan.sensor.id.as_u128());
    let seed = plan.seed.wrapping_add(index as u64);
    let readings = sample(&simulator, id, plan.readings_per_object, seed, &config, &mut hear)
        .map_err(|source| match source {
            SampleError::Stopped { .. } => TrainingFailure::Stopped,
            source => TrainingFailure::Sampling { object: name(), source },
        })?;
    let sensor = Arc::clone(&plan.sensor);
    Ok(Material { object: object.clone(), readings, sensor, origin: Some(origin), planar })
}

fn mesh(
    object: Uuid,
    sources: &Sources<'_>,
    name: &dyn Fn() -> String,
) -> Result<Mesh, TrainingFailure> {
    let (info, file) = sources
        .store
        .meshes()
        .get(object)?
        .ok_or_else(|| TrainingFailure::NoData { object: name() })?;
    Mesh::from_bytes(read_format(info.format), &file, unit_metres(info.unit))
        .map_err(|source| TrainingFailure::Mesh { object: name(), source })
}

fn map_all(
    plan: &Plan,
    materials: &[Material],
    vocabulary: &Vocabulary,
    progress: &Progress<'_>,
) -> Result<Vec<ObjectMap>, TrainingFailure> {
    let total = materials.len();
    let done = AtomicUsize::new(0);
    step(progress, JobStage::Mapping, 0, total)?;
    let map_one = |material: &Material| {
        let map = map_object(&material.set(), vocabulary, &plan.config, material.origin).map_err(
            |source| TrainingFailure::Mapping { object: material.object.name.clone(), source },
        )?;
        let now = done.fetch_add(1, Ordering::Relaxed) + 1;
        step(progress, JobStage::Mapping, now, total)?;
        Ok(map)
    };
    materials.par_iter().map(map_one).collect()
}

fn report(material: &Material, map: &ObjectMap) -> ObjectReport {
    ObjectReport {
        id: material.object.id,
        name: material.object.name.clone(),
        n_readings: count(material.readings.len()),
        n_patches: count(map.patches().len()),
        index_bytes: map.index().bytes() as u64,
        origin_in_mesh: map.origin_in_training().to_array(),
        geometry: None,
    }
}

fn step(
    progress: &Progress<'_>,
    stage: JobStage,
    done: usize,
    total: usize,
) -> Result<(), TrainingFailure> {
    match progress(stage, done, total) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(TrainingFailure::Stopped),
    }
}
