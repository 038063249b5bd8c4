//! Solid maps of ten objects, touched by other sensors than in training.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_core::units::{DEG, MM};
use palpate_dissertation::geometric::train::{GeometricConfig, map_geometry};
use palpate_dissertation::geometric::{
    AdaptiveOptions, GeometricBelief, GeometricFilter, GeometricOptions, PreparedGeometry,
};
use palpate_sim::noise::NoiseLevel;
use palpate_sim::press::{CoveringConfig, Physics};
use rayon::prelude::*;

use super::{GeometricElsewhere, Step};
use crate::covering_thickness::sensor_under;
use crate::report::Progress;
use crate::sensing::Sensing;
use crate::solid_geometry::placed;

/// Training and test readings per object.
const TRAIN: usize = 400;
const TEST: usize = 30;

/// Readings per trial.
const READINGS: usize = 10;

/// Half extent (m) and half angle (rad) of the box of poses.
const BOX: [f64; 2] = [10.0 * MM, 17.0 * DEG];

/// The names of the rows and the answers of all trials.
pub(super) fn run(
    config: &GeometricElsewhere,
    progress: Progress<'_>,
) -> anyhow::Result<(Vec<String>, Vec<Step>)> {
    let objects = config.objects.load()?;
    let own = SensorDescription::digitacts_6x6();
    let preset = Sensing::with(own.clone());
    progress("solid, training", 0, 1);
    let train = preset.touch_all(&objects, TRAIN, 2 * config.seed)?;
    let sets: Vec<TrainingSet<'_>> =
        train.iter().map(|readings| TrainingSet { readings, sensor: &own }).collect();
    let origins = vec![DVec3::ZERO; sets.len()];
    let model = map_geometry(&sets, &origins, &GeometricConfig::solid())?;
    let prepared = PreparedGeometry::new(Arc::new(model));
    let elsewhere = elsewhere(&preset)?;
    let mut steps = Vec::new();
    for (row, (name, sensing)) in elsewhere.iter().enumerate() {
        progress(&format!("solid, {name}"), row, elsewhere.len());
        let test = sensing.touch_all(&objects, TEST, 2 * config.seed + 1)?;
        let trials = (0..config.solid_trials * objects.len()).into_par_iter();
        let played: anyhow::Result<Vec<Vec<Step>>> = trials
            .map(|trial| play(config, &prepared, &sensing.sensor, &test, row, trial))
            .collect();
        steps.extend(played?.into_iter().flatten());
    }
    Ok((elsewhere.into_iter().map(|(name, _)| name.to_owned()).collect(), steps))
}

/// Names of the rows: what makes the test touches. The recogniser receives the sensor's description.
fn elsewhere(preset: &Sensing) -> anyhow::Result<Vec<(&'static str, Sensing)>> {
    let noise_level = NoiseLevel::new(0.1).unwrap_or(NoiseLevel::NONE);
    let elastic =
        |covering| Sensing { physics: Physics::ElasticCovering(covering), ..preset.clone() };
    Ok(vec![
        ("same", preset.clone()),
        ("noise_10", Sensing { noise_level, ..preset.clone() }),
        ("gains", Sensing { gain_spread: 0.2, relative_noise: 0.1, ..preset.clone() }),
        ("covering_0_20in", Sensing::with(sensor_under(0.20)?)),
        ("layer", elastic(CoveringConfig::bonded_layer(&preset.sensor))),
        ("half_space", elastic(CoveringConfig::half_space(&preset.sensor))),
    ])
}

/// One trial: the object lies somewhere in the box.
fn play(
    config: &GeometricElsewhere,
    prepared: &PreparedGeometry,
    sensor: &SensorDescription,
    test: &[Vec<Reading>],
    row: usize,
    trial: usize,
) -> anyhow::Result<Vec<Step>> {
    let object = trial % test.len();
    let (truth, pose) = placed(config.seed, BOX, trial);
    let filter = GeometricFilter::Adaptive(AdaptiveOptions::default());
    let options = GeometricOptions { pose, filter, seed: 1 };
    let mut belief = GeometricBelief::new(prepared, options, None)?;
    let mut choice = Stream::new(config.seed, Purpose::ReadingChoice, trial as u64);
    let mut steps = Vec::with_capacity(READINGS);
    for readings in 1..=READINGS {
        let reading = &test[object][choice.index(test[object].len())];
        belief.add(&reading.moved_by(truth), sensor)?;
        let answer = belief.answer(1);
        let named = answer.best_object().map_or(usize::MAX, |object| object.0 as usize);
        let is_right = named == object;
        let best = answer.modes.first().filter(|mode| mode.object.0 as usize == object);
        let error = best.map(|mode| mode.session_from_object.distance_to(&truth));
        let stated = answer.probabilities.get(named).copied().unwrap_or(0.0);
        steps.push(Step { row, group: object as u64, readings, is_right, stated, error });
    }
    Ok(steps)
}
