//! Letters mapped on the rig and pressed elsewhere.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_core::units::MM;
use palpate_dissertation::geometric::train::{GeometricConfig, map_geometry};
use palpate_dissertation::geometric::{
    AdaptiveOptions, GeometricBelief, GeometricFilter, GeometricOptions, PosePrior,
    PreparedGeometry, PrintedFilter,
};
use palpate_sim::letters::Letter;
use palpate_sim::press::{CoveringConfig, Physics, PressConfig, PressSimulator};
use palpate_sim::rig::{Rig, RigNoise, plan, rig_sensor};
use rayon::prelude::*;

use super::{GeometricElsewhere, Step};
use crate::covering_thickness::sensor_under;
use crate::letter_presses::{LetterShape, RaisedLetters, font_of};
use crate::report::Progress;

/// Maximum offset of the letter from its trained place along x and y, metres.
const REACH: f64 = 10.0 * MM;

/// Height of a raised letter, metres: more than any covering is thick.
const HEIGHT: f64 = 6.0 * MM;

/// Where test presses come from. Maps are of the rig's presses under physical noise.
const PLACES: [&str; 9] = [
    "rig",
    "unmatched",
    "harsh",
    "jittered",
    "covering",
    "covering_untold",
    "mesh",
    "layer",
    "half_space",
];

const METHODS: [&str; 2] = ["adaptive", "histogram"];

/// Number of rows: places times methods.
#[cfg(test)]
pub(super) const N_ROWS: usize = PLACES.len() * METHODS.len();

/// Test presses of every letter, and the description of the sensor that the recogniser receives.
struct Place {
    test: Vec<Vec<Reading>>,
    told: SensorDescription,
}

/// The names of the rows and the answers of all trials.
pub(super) fn run(
    config: &GeometricElsewhere,
    progress: Progress<'_>,
) -> anyhow::Result<(Vec<String>, Vec<Step>)> {
    let letters = RaisedLetters::of_font(&config.letters, &font_of(config.font.as_deref())?)?;
    let shapes: Vec<LetterShape> = letters.letters().iter().map(LetterShape::of).collect();
    let name = |place: &str| METHODS.map(|method| format!("{place}_{method}"));
    let names: Vec<String> = PLACES.into_iter().flat_map(name).collect();
    let mut steps = Vec::new();
    for (done, seed) in (0..config.seeds as u64).map(|idx| config.seed + idx).enumerate() {
        let rig = Rig::new(SensorId(0), &rig_sensor(), RigNoise::physical(), seed);
        let train = letters.session(&rig, 0);
        let sets: Vec<TrainingSet<'_>> =
            train.iter().map(|readings| TrainingSet { readings, sensor: rig.sensor() }).collect();
        let origins = vec![DVec3::ZERO; sets.len()];
        let model = map_geometry(&sets, &origins, &GeometricConfig::planar())?;
        let prepared = PreparedGeometry::new(Arc::new(model));
        for (place_idx, place) in PLACES.into_iter().enumerate() {
            progress(&format!("letters, {place}"), done * PLACES.len() + place_idx, {
                config.seeds * PLACES.len()
            });
            let place = pressed(place, &letters, &rig, seed)?;
            for method in 0..METHODS.len() {
                let row = place_idx * METHODS.len() + method;
                let trials = (0..shapes.len() * config.trials).into_par_iter();
                let played: anyhow::Result<Vec<Vec<Step>>> = trials
                    .map(|trial| {
                        play(config, &prepared, &place, &shapes, (row, method, seed), trial)
                    })
                    .collect();
                steps.extend(played?.into_iter().flatten());
            }
        }
    }
    Ok((names, steps))
}

/// The test presses of a place.
fn pressed(place: &str, letters: &RaisedLetters, rig: &Rig, seed: u64) -> anyhow::Result<Place> {
    let own = rig.sensor().clone();
    // The same taxels: gains come from the seed, whatever the covering or the other noise.
    let noisy = |noise: RigNoise| Rig::new(SensorId(0), &own, noise, seed);
    let physics = |covering: CoveringConfig| {
        Physics::ElasticCovering(CoveringConfig { gain_seed: seed, ..covering })
    };
    let meshes = |physics: Physics| in_mesh_simulator(letters.letters(), &own, physics, seed);
    let thick = sensor_under(0.14)?;
    let under_thick = || {
        let rig = Rig::new(SensorId(0), &thick, RigNoise::physical(), seed);
        RaisedLetters::of_letters(letters.letters().to_vec(), &thick).session(&rig, 1)
    };
    let (test, told) = match place {
        "unmatched" => (letters.session(&noisy(RigNoise::unmatched()), 1), own),
        "harsh" => (letters.session(&noisy(RigNoise::harsh()), 1), own),
        "jittered" => (letters.jittered(rig, seed, 1), own),
        "covering" => (under_thick(), thick.clone()),
        "covering_untold" => (under_thick(), own),
        "mesh" => (meshes(Physics::PointSpread), own),
        "layer" => (meshes(physics(CoveringConfig::bonded_layer(&own))), own),
        "half_space" => (meshes(physics(CoveringConfig::half_space(&own))), own),
        _ => (letters.session(rig, 1), own),
    };
    Ok(Place { test, told })
}

/// The planned presses of solid letters by the simulator of meshes.
fn in_mesh_simulator(
    letters: &[Letter],
    sensor: &SensorDescription,
    physics: Physics,
    seed: u64,
) -> Vec<Vec<Reading>> {
    let config = PressConfig { physics, ..PressConfig::for_sensor(sensor) };
    let depth = palpate_sim::rig::INDENTATION * sensor.parameters().covering_thickness;
    let presses = |letter: &Letter| {
        // The face of a solid letter is lifted to z = 0, as on the rig.
        let mesh = letter.solid(HEIGHT);
        let top = mesh.bounds().1.z;
        let mesh = mesh.translated(DVec3::new(0.0, 0.0, -top));
        let simulator = PressSimulator::with_config(mesh, sensor.clone(), config);
        let press = |(idx, at): (usize, palpate_sim::rig::PlanarPose)| {
            let index = u64::from(u32::from(letter.symbol())) << 32 | idx as u64;
            let mut stream = Stream::new(seed, Purpose::SensorNoise, index);
            simulator.read(SensorId(0), at.object_from_sensor(depth), &mut stream)
        };
        plan().into_par_iter().enumerate().map(press).collect()
    };
    letters.iter().map(presses).collect()
}

fn play(
    config: &GeometricElsewhere,
    prepared: &PreparedGeometry,
    place: &Place,
    shapes: &[LetterShape],
    (row, method, seed): (usize, usize, u64),
    trial: usize,
) -> anyhow::Result<Vec<Step>> {
    let letter = trial / config.trials;
    let mut poses = Stream::new(seed, Purpose::ObjectPose, trial as u64);
    let at = DVec3::new(poses.uniform(-REACH, REACH), poses.uniform(-REACH, REACH), 0.0);
    let truth = Pose::from_parts(DQuat::from_rotation_z(poses.uniform(0.0, TAU)), at);
    let pose = PosePrior::Planar {
        session_from_plane: Pose::IDENTITY,
        center: [0.0; 2],
        half_extent: REACH,
        angle: 0.0,
        half_angle: PI,
    };
    let filter = match METHODS[method] {
        "histogram" => GeometricFilter::Printed(PrintedFilter::Histogram { n: [25, 25, 16] }),
        _ => GeometricFilter::Adaptive(AdaptiveOptions::default()),
    };
    let mut belief = GeometricBelief::new(prepared, GeometricOptions { pose, filter, seed }, None)?;
    let mut choice = Stream::new(seed, Purpose::ReadingChoice, trial as u64);
    let mut left: Vec<&Reading> = place.test[letter].iter().collect();
    let mut steps = Vec::new();
    for readings in 1..=config.readings.min(left.len()) {
        let reading = left.swap_remove(choice.index(left.len()));
        belief.add(&reading.moved_by(truth), &place.told)?;
        let answer = belief.answer(4);
        let named = answer.best_object().map_or(usize::MAX, |object| object.0 as usize);
        let is_right = named == letter;
        let mode = answer.modes.iter().find(|mode| mode.object.0 as usize == letter);
        let error = mode.filter(|_| is_right).map(|mode| {
            // The dissertation's poses are planar, and so are its errors.
            let found = mode.session_from_object;
            let found = Pose { translation: found.translation.with_z(0.0), ..found };
            shapes[letter].error(&found, &truth)
        });
        let stated = answer.probabilities.get(named).copied().unwrap_or(0.0);
        steps.push(Step { row, group: seed, readings, is_right, stated, error });
    }
    Ok(steps)
}
