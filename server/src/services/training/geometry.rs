//! Training of maps of contact and pressure.
//!
//! The maps of all objects together are limited, so that a version fits into memory: a grid's
//! size is known before its cells are.

use glam::DVec3;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::training::TrainingSet;
use palpate_dissertation::geometric::model::GeometricModel;
use palpate_dissertation::geometric::train::GeometricTrainError;
use palpate_dissertation::geometric::train::{Dimensions, GeometricConfig, map_geometry};
use palpate_dissertation::occupancy::grid::CELLS_MAX;
use palpate_dissertation::occupancy::mapping::shape_around;
use palpate_dissertation::sva::model::ObjectMap;
use palpate_schemas::JobStage;
use palpate_sim::press::PressSimulator;
use palpate_sim::rig::{self, PlanarPlan};
use palpate_store::catalogue::VersionObject;

use super::material::Material;
use super::{Plan, Progress, TrainingFailure, step};

/// Presses an object's mesh straight down if planar maps are requested.
pub(super) fn planar_presses(
    plan: &Plan,
    index: usize,
    object: &VersionObject,
    simulator: &PressSimulator,
) -> Result<Option<Vec<Reading>>, TrainingFailure> {
    let is_planar = plan.geometric.is_some_and(|config| config.dimensions == Dimensions::Planar);
    if !is_planar {
        return Ok(None);
    }
    let sensor = SensorId(plan.sensor.id.as_u128());
    let seed = plan.seed.wrapping_add(index as u64);
    rig::planar_presses(simulator, sensor, &PlanarPlan::default(), seed)
        .map(Some)
        .map_err(|source| TrainingFailure::Planar { object: object.name.clone(), source })
}

/// Trains the geometry of all objects, in the frames of their `maps`.
pub(super) fn learn(
    config: &GeometricConfig,
    materials: &[Material],
    maps: &[ObjectMap],
    progress: &Progress<'_>,
) -> Result<GeometricModel, TrainingFailure> {
    let total = materials.len();
    step(progress, JobStage::Geometric, 0, total)?;
    check_size(config, materials)?;
    let sets: Vec<TrainingSet<'_>> = materials.iter().map(Material::pressed).collect();
    let origins: Vec<DVec3> = maps.iter().map(ObjectMap::origin_in_training).collect();
    let model = map_geometry(&sets, &origins, config).map_err(|error| named(error, materials))?;
    step(progress, JobStage::Geometric, total, total)?;
    Ok(model)
}

/// Refuses too large maps before any is built.
fn check_size(config: &GeometricConfig, materials: &[Material]) -> Result<(), TrainingFailure> {
    let cell = config.cell;
    let plane = match config.dimensions {
        Dimensions::Planar => Some(0.0),
        Dimensions::Solid => None,
    };
    let mut n_cells = 0;
    for material in materials {
        let object = || material.object.name.clone();
        let set = material.pressed();
        let margin = set.sensor.parameters().point_spread;
        let shape = shape_around(set.readings, set.sensor, cell, margin, plane)
            .map_err(|source| TrainingFailure::Grid { object: object(), cell, source })?;
        // A mosaic has four cells for each of a planar map.
        n_cells += shape.n_cells() * if plane.is_some() { 5 } else { 1 };
        if n_cells > CELLS_MAX {
            return Err(TrainingFailure::Cells { object: object(), cell, found: n_cells });
        }
    }
    Ok(())
}

/// The failure of a training whose object core knows by its index.
fn named(error: GeometricTrainError, materials: &[Material]) -> TrainingFailure {
    match error {
        GeometricTrainError::NotPlanar { object, .. } => {
            let object = materials[object].object.name.clone();
            TrainingFailure::Geometric { object, source: error }
        }
        other => TrainingFailure::Maps(other),
    }
}
