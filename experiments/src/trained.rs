//! Training of recognisers from readings of test objects.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::symmetry::Symmetry;
use palpate_core::training::{TrainingError, TrainingSet};
use palpate_dissertation::sva::SvaOptions;
use palpate_dissertation::sva::model::SvaModel;
use palpate_dissertation::sva::train::{TrainingConfig, learn_vocabulary, map_object};
use palpate_recogniser::belief::calibrate::{HeldBack, calibrate};
use palpate_recogniser::model::{EvidenceCalibration, SurfaceModel};
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::{SurfaceConfig, learn_space, map_surface};
use rayon::prelude::*;

use crate::object_sessions::Recogniser;

/// Trains spatially varying appearance; the objects' frames are those of their meshes.
///
/// # Errors
/// When the readings cannot be learnt from.
pub fn train_sva(
    readings: &[Vec<Reading>],
    sensor: &SensorDescription,
    training: &TrainingConfig,
    options: SvaOptions,
    seed: u64,
) -> anyhow::Result<Recogniser> {
    let sets: Vec<TrainingSet<'_>> =
        readings.iter().map(|readings| TrainingSet { readings, sensor }).collect();
    let vocabulary = learn_vocabulary(&sets, training, seed)?;
    let map = |set| map_object(set, &vocabulary, training, Some(DVec3::ZERO)).map(Arc::new);
    let objects: Result<Vec<_>, _> = sets.par_iter().map(map).collect();
    let catalogue = SvaModel { vocabulary, association: training.association, objects: objects? };
    Ok(Recogniser::Sva { catalogue: Arc::new(catalogue), options })
}

/// Trains the surface recogniser without calibration (the named object does not depend on it);
/// the objects' frames and symmetries are those of their meshes.
///
/// # Errors
/// When the readings cannot be learnt from.
pub fn train_surface(
    readings: &[Vec<Reading>],
    symmetries: &[Symmetry],
    sensor: &SensorDescription,
    surface: &SurfaceConfig,
    seed: u64,
) -> anyhow::Result<Arc<SurfaceModel>> {
    let sets: Vec<TrainingSet<'_>> =
        readings.iter().map(|readings| TrainingSet { readings, sensor }).collect();
    let space = learn_space(&sets, seed)?;
    let map = |(set, symmetry): (&TrainingSet<'_>, &Symmetry)| {
        let map = map_surface(set, &space, surface, Some(DVec3::ZERO))?;
        Ok::<_, TrainingError>(Arc::new(map.with_symmetry(symmetry.clone())))
    };
    let maps: Result<Vec<_>, _> = sets.par_iter().zip(symmetries).map(map).collect();
    let calibration = EvidenceCalibration::default();
    Ok(Arc::new(SurfaceModel::new(space, calibration, maps?)))
}

/// Trains the surface recogniser as the service does: every tenth reading is held back, and the
/// calibration is learnt from these.
///
/// # Errors
/// When the readings cannot be learnt from.
pub fn train_calibrated(
    readings: &[Vec<Reading>],
    symmetries: &[Symmetry],
    sensor: &SensorDescription,
    surface: &SurfaceConfig,
    seed: u64,
) -> anyhow::Result<Arc<SurfaceModel>> {
    let part = |held_back: bool| -> Vec<Vec<Reading>> {
        let of = |readings: &Vec<Reading>| {
            let every = readings.iter().enumerate();
            every.filter(|(at, _)| (at % 10 == 9) == held_back).map(|(_, r)| r.clone()).collect()
        };
        readings.iter().map(of).collect()
    };
    let model = train_surface(&part(false), symmetries, sensor, surface, seed)?;
    let held_back = part(true);
    let sets: Vec<HeldBack<'_>> =
        held_back.iter().map(|readings| HeldBack { readings, sensor, run: None }).collect();
    let calibration = calibrate(&model, &sets, SurfaceOptions::default(), seed);
    Ok(Arc::new(Arc::unwrap_or_clone(model).with_calibration(calibration)))
}
