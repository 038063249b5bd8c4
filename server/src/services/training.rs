//! Work of a training job: readings of each object, a vocabulary, maps of each object.
//!
//! The result is determined by the stored data, the request and its seed. It runs on the
//! training pool's threads and checks between steps whether to stop. Not here: queueing jobs
//! and storing results.

mod appearance;
mod base;
mod check;
mod failure;
mod geometry;
mod keeping;
mod material;
mod skipping;
mod surface;
mod twins;
mod unseen;
mod weight;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use palpate_core::pose::Pose;
use palpate_core::sensor::SensorFamily;
use palpate_core::training::TrainingSet;
use palpate_core::vocabulary::Vocabulary;
use palpate_dissertation::geometric::train::GeometricConfig;
use palpate_dissertation::sva::model::{ObjectMap, SvaModel};
use palpate_dissertation::sva::train::{TrainingConfig, learn_vocabulary, map_object};
use palpate_schemas::{
    JobStage, ObjectReport, SensorKnowledge, SkippedObject, SymmetryBy, Warning,
};
use palpate_store::catalogue::VersionObject;
use palpate_store::database::Database;
use palpate_store::entity::Sensor;
use palpate_store::model::TrainedModel;
use rayon::prelude::*;

use crate::hints::{of_catalogue, of_kept_knowledge, of_object, of_twins};
use crate::services::sensors::Sensors;
use crate::wire::symmetry::axes;
use crate::wire::{count, coupling, geometry as wire_geometry};
pub(crate) use appearance::AppearancePlan;
pub(crate) use base::Base;
pub(crate) use failure::TrainingFailure;
pub(crate) use keeping::Keeping;
use material::{Material, gather};
use skipping::Skipped;
use surface::Decided;
pub(crate) use weight::{Load, memory_bytes};

/// Plan of a training.
pub(crate) struct Plan {
    pub(crate) objects: Vec<VersionObject>,
    /// The sensor that touches meshes; as its passport measured it, if it is commissioned.
    pub(crate) sensor: Arc<Sensor>,
    /// Trust in its description.
    pub(crate) knowledge: SensorKnowledge,
    /// The version that had this trust in it too, where the sensor itself states another.
    pub(crate) kept_from: Option<u32>,
    pub(crate) readings_per_object: usize,
    /// Number of simulated touches for a surface, at least `readings_per_object`.
    pub(crate) surface_readings_per_object: usize,
    pub(crate) seed: u64,
    pub(crate) config: TrainingConfig,
    /// Configuration of maps of contact, if trained.
    pub(crate) geometric: Option<GeometricConfig>,
    /// Configuration of appearance, if trained.
    pub(crate) appearance: Option<AppearancePlan>,
    /// Whether maps of pairs of touches are trained.
    pub(crate) sva: bool,
    /// Whether surfaces are trained.
    pub(crate) surface: bool,
    /// The version to extend: its vocabularies and its other objects stay.
    pub(crate) base: Option<Base>,
    /// Whether an object that cannot be trained makes the training fail.
    pub(crate) strict: bool,
}

impl Plan {
    /// The sensors that press meshes.
    fn family(&self) -> SensorFamily {
        self.sensor.family(coupling::knowledge_of(self.knowledge))
    }
}

/// Results: objects of the extended version at their indices, then new ones in the plan's order.
pub(crate) struct Trained {
    pub(crate) model: TrainedModel,
    pub(crate) objects: Vec<ObjectReport>,
    pub(crate) skipped: Vec<SkippedObject>,
    pub(crate) warnings: Vec<Warning>,
}

/// Sources of training data.
pub(crate) struct Sources<'a> {
    pub(crate) store: &'a Database,
    pub(crate) sensors: &'a Sensors,
    /// What keeps simulated touches.
    pub(crate) keeping: Option<&'a Keeping>,
}

/// Progress function: receives stage, done and total, and may stop the training.
pub(crate) type Progress<'a> = dyn Fn(JobStage, usize, usize) -> ControlFlow<()> + Sync + 'a;

/// Trains a plan. Object i of the plan is touched with seed + i. Objects that cannot be
/// trained are left out as if they had not been requested, unless the plan is strict.
pub(crate) fn train(
    plan: &Plan,
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<Trained, TrainingFailure> {
    let mut skipped = Skipped::new(plan);
    let gathered = skipped.keep(gather(plan, sources, progress)?)?;
    let mut materials = skipped.keep(check::usable(plan, gathered))?;
    loop {
        skipped.expect_some(&materials)?;
        match learn(plan, &materials, sources, progress) {
            Ok((model, objects)) => {
                let sizes: Vec<(&ObjectReport, f64)> =
                    objects.iter().zip(materials.iter().map(|one| one.touched.size)).collect();
                let skipped = skipped.reported();
                let mut warnings = of_catalogue(&sizes, &skipped);
                warnings.extend(twins::twins(plan, &materials, sources)?.map(of_twins));
                if let Some(version) = plan.kept_from
                    && objects.iter().any(|object| object.sensor_knowledge.is_some())
                {
                    let stated = coupling::knowledge(plan.sensor.knowledge);
                    let sensor = (plan.sensor.name.as_str(), stated);
                    warnings.push(of_kept_knowledge(plan.knowledge, version, sensor));
                }
                let objects = with_base(plan, &materials, objects);
                return Ok(Trained { model, objects, skipped, warnings });
            }
            Err(failure) => materials = skipped.without(failure, materials)?,
        }
    }
}

/// Trains a model from all materials, and reports on their objects.
fn learn(
    plan: &Plan,
    materials: &[Material],
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<(TrainedModel, Vec<ObjectReport>), TrainingFailure> {
    let vocabulary = vocabulary(plan, materials, progress)?;
    let maps = if plan.sva { map_all(plan, materials, &vocabulary, progress)? } else { Vec::new() };
    let geometry = match &plan.geometric {
        Some(config) => Some(geometry::learn(config, materials, &maps, progress)?),
        None => None,
    };
    let surface = if plan.surface {
        Some(surface::learn(plan, materials, &maps, sources, progress)?)
    } else {
        None
    };
    let appearance = match &plan.appearance {
        Some(settings) => Some(appearance::learn(plan, settings, materials, progress)?),
        None => None,
    };
    let mut objects: Vec<ObjectReport> =
        materials.iter().enumerate().map(|(n, one)| report(plan, one, maps.get(n))).collect();
    for (object, map) in objects.iter_mut().zip(geometry.iter().flat_map(|model| &model.maps)) {
        object.geometric = Some(wire_geometry::report(map));
    }
    if let Some(learnt) = &surface {
        for (object, map) in objects.iter_mut().zip(&learnt.new) {
            object.origin_in_mesh = map.origin_in_training().to_array();
            object.surface = Some(surface::report(map));
            object.symmetry = Some(axes(map.symmetry(), &Pose::IDENTITY));
        }
        for (object, decided) in objects.iter_mut().zip(&learnt.decided) {
            object.symmetry_by = Some(symmetry_by(*decided));
            if let Decided::Not { touches_needed } = decided {
                object.symmetry_touches_needed = Some(count(*touches_needed));
            }
        }
    }
    let maps: Vec<Arc<ObjectMap>> = maps.into_iter().map(Arc::new).collect();
    let maps = match &plan.base {
        Some(base) if plan.sva => {
            base::extended(&base.model.core.sva.objects, &base.places(materials), maps)
        }
        _ => maps,
    };
    let sva = SvaModel { vocabulary, association: plan.config.association, objects: maps };
    let model = TrainedModel {
        sva: Arc::new(sva),
        geometric: geometry.map(Arc::new),
        appearance: appearance.map(Arc::new),
        surface: surface.map(|learnt| learnt.model),
    };
    Ok((model, objects))
}

/// The reports of all objects of the new version.
fn with_base(plan: &Plan, materials: &[Material], objects: Vec<ObjectReport>) -> Vec<ObjectReport> {
    match &plan.base {
        None => objects,
        Some(base) => base::extended(&base.reports, &base.places(materials), objects),
    }
}

/// The vocabulary of pair maps: the extended version's, or a learnt one; without pair maps
/// one without classes.
fn vocabulary(
    plan: &Plan,
    materials: &[Material],
    progress: &Progress<'_>,
) -> Result<Vocabulary, TrainingFailure> {
    if let Some(base) = &plan.base {
        return Ok(base.model.core.sva.vocabulary.clone());
    }
    if !plan.sva {
        let grid = materials.first().map_or(plan.sensor.description.grid(), Material::grid);
        let (rows, cols, descriptor) = (grid.rows, grid.cols, plan.config.descriptor);
        let (mean, medoids, spreads) = (Vec::new(), Vec::new(), Vec::new());
        return Ok(Vocabulary { descriptor, rows, cols, mean, medoids, spreads });
    }
    step(progress, JobStage::Vocabulary, 0, 1)?;
    let sets: Vec<TrainingSet<'_>> = materials.iter().map(Material::set).collect();
    let vocabulary = learn_vocabulary(&sets, &plan.config, plan.seed)?;
    step(progress, JobStage::Vocabulary, 1, 1)?;
    Ok(vocabulary)
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

fn report(plan: &Plan, material: &Material, map: Option<&ObjectMap>) -> ObjectReport {
    ObjectReport {
        id: material.object.id,
        name: material.object.name.clone(),
        n_readings: count(material.readings.len()),
        sensor_knowledge: material.has_mesh().then_some(plan.knowledge),
        n_patches: map.map_or(0, |map| count(map.patches().len())),
        index_bytes: map.map_or(0, |map| map.index().bytes() as u64),
        origin_in_mesh: map.map_or([0.0; 3], |map| map.origin_in_training().to_array()),
        surface: None,
        geometric: None,
        symmetry: None,
        symmetry_by: None,
        symmetry_touches_needed: None,
        warnings: of_object(&material.touched, material.has_mesh()),
    }
}

fn symmetry_by(decided: Decided) -> SymmetryBy {
    match decided {
        Decided::ByMesh => SymmetryBy::Mesh,
        Decided::ByTouches => SymmetryBy::Touches,
        Decided::Not { .. } => SymmetryBy::Undetermined,
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
