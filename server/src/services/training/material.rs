//! Training data of objects: robots' readings, or simulated touches of meshes.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::TaxelGrid;
use palpate_core::symmetry::Symmetry;
use palpate_core::training::TrainingSet;
use palpate_recogniser::belief::calibrate::READINGS;
use palpate_recogniser::belief::hold_out;
use palpate_schemas::JobStage;
use palpate_sim::form::Form;
use palpate_sim::kept::Cause;
use palpate_sim::mesh::Mesh;
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::family::{sample_runs, sample_training};
use palpate_sim::sampler::{SampleError, SamplerConfig};
use palpate_sim::symmetry;
use palpate_store::catalogue::VersionObject;
use palpate_store::entity::Sensor;
use palpate_store::journal::Event;
use rayon::prelude::*;
use uuid::Uuid;

use super::{Plan, Progress, Sources, TrainingFailure, geometry, step};
use crate::hints::Touched;
use crate::wire::felt::press_from_store;
use crate::wire::object::{read_format, unit_metres};

/// The readings of one object.
pub(super) struct Material {
    pub(super) object: VersionObject,
    /// All readings; those after the first `n_common` are for the surface alone.
    pub(super) readings: Vec<Reading>,
    n_common: usize,
    /// The client's own feature of each reading, if sent.
    pub(super) features: Vec<Vec<f64>>,
    /// Statistics of the object's readings.
    pub(super) touched: Touched,
    sensor: Arc<Sensor>,
    pub(super) origin: Option<DVec3>,
    /// Symmetry of the touched mesh about `origin`, if needed.
    pub(super) symmetry: Option<Symmetry>,
    /// Further touches of the mesh for the calibration, in runs of [`READINGS`] by one sensor of
    /// a family each; `None` if a part of `readings` is held out instead.
    pub(super) held_back: Option<Vec<Reading>>,
    /// Vertical presses of a mesh for a planar map; otherwise maps of contact are trained
    /// from the readings.
    planar: Option<Vec<Reading>>,
    /// Form of the touched mesh.
    pub(super) form: Option<Form>,
}

impl Material {
    pub(super) fn set(&self) -> TrainingSet<'_> {
        let readings = &self.readings[..self.n_common];
        TrainingSet { readings, sensor: &self.sensor.description }
    }

    /// The sensor that took the readings.
    pub(super) fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// Whether the readings are touches of a mesh.
    pub(super) fn has_mesh(&self) -> bool {
        self.origin.is_some()
    }

    /// The taxels of the sensor.
    pub(super) fn grid(&self) -> &TaxelGrid {
        self.sensor.description.grid()
    }

    /// The readings for the surface alone.
    pub(super) fn for_surface(&self) -> &[Reading] {
        &self.readings[self.n_common..]
    }

    /// The readings for maps of contact.
    pub(super) fn pressed(&self) -> TrainingSet<'_> {
        let set = self.set();
        TrainingSet { readings: self.planar.as_deref().unwrap_or(set.readings), ..set }
    }
}

/// Collects the readings of all objects: their own, or touches of their meshes. A failure of
/// one object takes its place.
pub(super) fn gather(
    plan: &Plan,
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<Vec<Result<Material, TrainingFailure>>, TrainingFailure> {
    let total = plan.objects.len() * n_touches(plan);
    let done = AtomicUsize::new(0);
    step(progress, JobStage::Sampling, 0, total)?;
    let gather_one = |(index, object): (usize, &VersionObject)| {
        let material = match own_readings(plan, object, sources)? {
            Some(material) => {
                done.fetch_add(n_touches(plan), Ordering::Relaxed);
                material
            }
            None => touch(plan, index, object, sources, &done, progress)?,
        };
        step(progress, JobStage::Sampling, done.load(Ordering::Relaxed), total)?;
        Ok(material)
    };
    Ok(plan.objects.par_iter().enumerate().map(gather_one).collect())
}

/// Robots' readings of an object; `None` without any.
pub(super) fn own_readings(
    plan: &Plan,
    object: &VersionObject,
    sources: &Sources<'_>,
) -> Result<Option<Material>, TrainingFailure> {
    let name = || object.name.clone();
    let entries = sources.store.training().entries(object.id, 0, usize::MAX)?;
    let mut readings = Vec::with_capacity(entries.len());
    let mut features = Vec::new();
    let mut sensor: Option<Arc<Sensor>> = None;
    for entry in &entries {
        let Event::Reading(stored) = &entry.event else { continue };
        if (plan.sva || plan.surface) && stored.session_from_sensor.is_none() {
            return Err(TrainingFailure::NoPoses { object: name() });
        }
        let used = match &sensor {
            Some(sensor) if sensor.id == stored.sensor => Arc::clone(sensor),
            Some(_) => return Err(TrainingFailure::Sensors { object: name() }),
            None => sources.sensors.get(&stored.sensor.to_string())?,
        };
        let correction = sources.sensors.known().correction(stored)?;
        let reading = press_from_store(stored, &used, correction.as_deref())
            .map_err(|source| TrainingFailure::Reading { object: name(), source })?;
        readings.push(reading);
        features.extend(stored.feature.clone());
        sensor = Some(used);
    }
    let object = object.clone();
    let are_placed = plan.sva || plan.surface;
    let sensor = sensor.map(|sensor| sources.sensors.known().interpreted(sensor)).transpose()?;
    Ok(sensor.map(|sensor| Material {
        object,
        touched: Touched::of(&readings, &sensor.description, are_placed),
        n_common: readings.len(),
        readings,
        features,
        sensor,
        origin: None,
        symmetry: None,
        held_back: None,
        planar: None,
        form: None,
    }))
}

/// Number of runs by one sensor of the family each that are held back of an object.
fn n_runs(plan: &Plan) -> usize {
    if !plan.surface || plan.family().is_single() {
        return 0;
    }
    hold_out::n_runs(plan.objects.len(), plan.readings_per_object)
}

/// Number of simulated touches of an object for everything, and of further ones for its surface.
fn n_trained(plan: &Plan) -> [usize; 2] {
    let [n, n_of_surface] = [plan.readings_per_object, plan.surface_readings_per_object];
    [n, if plan.surface { n_of_surface.saturating_sub(n) } else { 0 }]
}

/// Number of simulated touches of an object.
fn n_touches(plan: &Plan) -> usize {
    n_trained(plan).iter().sum::<usize>() + n_runs(plan) * READINGS
}

/// Touches an object's mesh in simulation, or reads the touches that were kept.
fn touch(
    plan: &Plan,
    index: usize,
    object: &VersionObject,
    sources: &Sources<'_>,
    done: &AtomicUsize,
    progress: &Progress<'_>,
) -> Result<Material, TrainingFailure> {
    let mesh = mesh(object.id, sources, &|| object.name.clone())?;
    let (origin, size, form) = (mesh.centroid(), mesh.largest_dimension(), Some(Form::of(&mesh)));
    let symmetry = plan.surface.then(|| symmetry::of_mesh(&mesh).seen_from(origin));
    let simulator = PressSimulator::new(mesh, plan.sensor.description.clone());
    let planar = geometry::planar_presses(plan, index, object, &simulator)?;
    let config = SamplerConfig::for_simulator(&simulator);
    let id = SensorId(plan.sensor.id.as_u128());
    let seed = plan.seed.wrapping_add(index as u64);
    let (family, [n, further], runs) = (plan.family(), n_trained(plan), n_runs(plan));
    let kept = sources.keeping.map(|keeping| {
        (keeping, Cause::new(&simulator, &config, &(id, seed, &family, [n, further], runs)))
    });
    let read = kept.as_ref().and_then(|(keeping, cause)| {
        let lists = keeping.read(cause, &plan.sensor.description)?;
        <[Vec<Reading>; 3]>::try_from(lists).ok()
    });
    let [mut readings, more, held_back] = match read {
        Some(lists) => {
            done.fetch_add(n_touches(plan), Ordering::Relaxed);
            lists
        }
        None => {
            let total = plan.objects.len() * n_touches(plan);
            let mut counted = 0;
            let mut hear = |taken: usize| {
                let now = done.fetch_add(taken - counted, Ordering::Relaxed) + (taken - counted);
                counted = taken;
                progress(JobStage::Sampling, now, total)
            };
            let failed = |source| failure(object, size, source);
            let (numbers, mut trained) = ([n, further], |taken: usize, _: usize| hear(taken));
            let sampled =
                sample_training(&simulator, &family, id, numbers, seed, &config, &mut trained);
            let [readings, more] = sampled.map_err(failed)?;
            let mut held = |taken: usize, _: usize| hear(n + further + taken);
            let runs = (runs, READINGS);
            let taken = sample_runs(&simulator, &family, id, runs, seed, &config, &mut held);
            let lists = [readings, more, taken.map_err(failed)?];
            if let Some((keeping, cause)) = kept {
                keeping.write(&cause, &[&lists[0], &lists[1], &lists[2]]);
            }
            lists
        }
    };
    let sensor = Arc::clone(&plan.sensor);
    let (object, origin, features) = (object.clone(), Some(origin), Vec::new());
    let touched = Touched { size, ..Touched::of(&readings, &sensor.description, true) };
    let n_common = readings.len();
    readings.extend(more);
    let held_back = (runs > 0).then_some(held_back);
    Ok(Material {
        object,
        readings,
        n_common,
        features,
        touched,
        sensor,
        origin,
        symmetry,
        held_back,
        planar,
        form,
    })
}

fn failure(object: &VersionObject, size: f64, source: SampleError) -> TrainingFailure {
    match source {
        SampleError::Stopped { .. } => TrainingFailure::Stopped,
        source => TrainingFailure::Sampling { object: object.name.clone(), size, source },
    }
}

/// The mesh of an object, metres.
pub(super) fn mesh(
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
