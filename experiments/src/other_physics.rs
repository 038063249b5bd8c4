//! Training on the point spread, tests on an elastic covering: dependence on our model of blur.
//!
//! Tests take the readings of a covering whose contact is solved (`sim::press::Physics`), with
//! its own gains, noise and converter, which also affect its controllers. To attribute the loss,
//! one aspect at a time comes from the point-spread simulator: its images at the elastic poses
//! (which leaves the difference in the poses where the controllers come to rest), and elastic
//! images at its poses. Ablations leave one aspect of the touch out of the score. Rows give the
//! differences of touches at the same poses (`differences`). In the same run the printed method
//! (`literal`) plays a few sessions.

mod differences;

use clap::Args;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, MM};
use palpate_dissertation::sva::SvaOptions;
use palpate_dissertation::sva::train::TrainingConfig;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::press::{CoveringConfig, Physics};
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, TouchSet, count};
use crate::disturbance::Disturbance;
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects::{self, TestObject};
use crate::played::{Played, report_wrong};
use crate::report::{Outcome, Progress, Report};
use crate::sensing::Sensing;
use crate::statistics::median;
use crate::trained::{train_surface, train_sva};

/// Numbers of readings whose figures the summary states.
const STATED_AT: [usize; 5] = [2, 3, 4, 6, 10];

/// Arguments of `other-physics`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct OtherPhysics {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials per object.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub trials: usize,
    /// Sessions of the printed method in each world, which is slow; 0 for none.
    #[arg(long, default_value_t = 10)]
    pub literal_sessions: usize,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
    /// Readings per trial.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub readings: usize,
}

/// Readings of every object in one simulated world, and its key.
struct World {
    key: &'static str,
    test: Vec<Vec<Reading>>,
}

/// Trials of one method in one world.
struct Tried {
    world: &'static str,
    method: &'static str,
    played: Played,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, or training fails.
pub fn run(config: &OtherPhysics, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let objects = config.objects.load()?;
    let preset = Sensing::with(config.touches.sensor.clone());
    progress("touching objects", 0, 2);
    let train = preset.touch_all(&objects, config.touches.train_readings, 2 * config.seed)?;
    let symmetries = objects::symmetries(&objects);
    let surface = SurfaceConfig::default();
    let model = train_surface(&train, &symmetries, &config.touches.sensor, &surface, config.seed)?;
    progress("pressing elastic coverings", 1, 2);
    let worlds = worlds(config, &objects, &preset, &model.space, &mut report)?;
    let play = |world: &World, method, recogniser: &Recogniser, n| {
        progress(world.key, 0, 1);
        let sessions = Sessions {
            sensor: &config.touches.sensor,
            test: &world.test,
            symmetries: &symmetries,
            seed: config.seed,
            readings: config.readings,
            threads: 1,
            disturbance: Disturbance::None,
        };
        let played = sessions.play(recogniser, objects.len(), n, progress)?;
        anyhow::Ok(Tried { world: world.key, method, played })
    };
    let surface = |options| Recogniser::Surface { model: model.clone(), options };
    let whole = surface(SurfaceOptions::default());
    let n = config.trials * objects.len();
    let mut tried = Vec::new();
    for world in &worlds {
        tried.push(play(world, "surface", &whole, n)?);
    }
    for (method, options) in ablations() {
        tried.push(play(&worlds[1], method, &surface(options), n)?);
    }
    if config.literal_sessions > 0 {
        let (training, options) = (TrainingConfig::literal(), SvaOptions::literal());
        let literal = train_sva(&train, &config.touches.sensor, &training, options, config.seed)?;
        for world in &worlds[..3] {
            tried.push(play(world, "literal", &literal, config.literal_sessions)?);
        }
    }
    for one in &tried {
        report_one(&mut report, config, one, &objects);
    }
    Ok(Outcome { report, plot: svg(&panels(config, &tried)), pictures: Vec::new() })
}

/// The point spread, both coverings, and the bonded layer with one aspect of the point spread.
fn worlds(
    config: &OtherPhysics,
    objects: &[TestObject],
    preset: &Sensing,
    space: &palpate_recogniser::model::AppearanceSpace,
    report: &mut Report,
) -> anyhow::Result<Vec<World>> {
    let (n, seed) = (config.touches.test_readings, 2 * config.seed + 1);
    let elastic =
        |covering| Sensing { physics: Physics::ElasticCovering(covering), ..preset.clone() };
    let layer = elastic(CoveringConfig::bonded_layer(&config.touches.sensor));
    let half_space = elastic(CoveringConfig::half_space(&config.touches.sensor));
    let same = preset.touch_all(objects, n, seed)?;
    let bonded = layer.touch_all(objects, n, seed)?;
    let unbounded = half_space.touch_all(objects, n, seed)?;
    let layer_at_same = pressed_at(&layer, objects, &same, seed);
    let half_space_at_same = pressed_at(&half_space, objects, &same, seed);
    let own_at_bonded = pressed_at(preset, objects, &bonded, seed);
    for (name, readings) in [("layer", &layer_at_same), ("half_space", &half_space_at_same)] {
        differences::report(report, name, &same, readings, &config.touches.sensor, space);
    }
    for (name, readings) in
        [("point_spread", &same), ("layer", &bonded), ("half_space", &unbounded)]
    {
        differences::report_heights(report, name, objects, readings, &config.touches.sensor, space);
    }
    let world = |key, test| World { key, test };
    Ok(vec![
        world("point_spread", same),
        world("layer", bonded),
        world("half_space", unbounded),
        world("layer_images_only", layer_at_same),
        world("layer_poses_only", own_at_bonded),
    ])
}

/// Presses a sensor at the poses of other readings.
fn pressed_at(
    sensing: &Sensing,
    objects: &[TestObject],
    readings: &[Vec<Reading>],
    seed: u64,
) -> Vec<Vec<Reading>> {
    let both = objects.par_iter().zip(readings).enumerate();
    both.map(|(at, (object, readings))| {
        let simulator = sensing.simulator(object);
        let mut stream = Stream::new(seed, Purpose::SensorNoise, at as u64);
        let press = |reading: &Reading| {
            simulator.read(SensorId(0), reading.session_from_sensor(), &mut stream)
        };
        readings.iter().map(press).collect()
    })
    .collect()
}

/// Ablations: the recogniser without one aspect of a touch each.
fn ablations() -> [(&'static str, SurfaceOptions); 3] {
    let whole = SurfaceOptions::default();
    let mut without_looks = whole;
    // At these scales all appearances are alike.
    (without_looks.scale.appearance, without_looks.scale.appearance_of_pose) = (1e6, 1e6);
    let mut without_stretch = whole;
    without_stretch.scale.direction = 0.0;
    let mut loose = whole;
    loose.scale.across *= 2.0;
    loose.refinement.across *= 2.0;
    [
        ("without_appearance", without_looks),
        ("without_stretch", without_stretch),
        ("height_loosened", loose),
    ]
}

fn report_one(report: &mut Report, config: &OtherPhysics, one: &Tried, objects: &[TestObject]) {
    let Tried { world, method, played } = one;
    for readings in 1..=config.readings {
        report.labelled(&[("world", world), ("method", method)], played.figures(readings));
    }
    // Goals are stated for the bonded layer and the unchanged recogniser.
    let prefix = match (*world, *method) {
        ("layer", "surface") => String::new(),
        (world, "surface") => format!("{world}_"),
        ("layer", method) => format!("{method}_"),
        (world, method) => format!("{method}_{world}_"),
    };
    for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
        let key = format!("{prefix}accuracy_at_{readings}");
        report.summarise(&key, played.accuracy(readings));
    }
    let last = config.readings.min(10);
    let moved = median(&played.errors(last, |e| e.translation / MM));
    report.summarise(&format!("{prefix}position_error_mm_median_at_{last}"), moved);
    report.summarise(&format!("{prefix}unknown_at_{last}"), played.unknown(last));
    let angle = median(&played.errors(last, |e| e.angle / DEG));
    report.summarise(&format!("{prefix}angle_error_deg_median_at_{last}"), angle);
    let labels = [("world", *world), ("method", *method)];
    report_wrong(report, &labels, objects, played.after(last));
}

fn panels(config: &OtherPhysics, tried: &[Tried]) -> Vec<Panel> {
    let panel = |title: &str,
                 y: &str,
                 keep: &dyn Fn(&&Tried) -> bool,
                 of: &dyn Fn(&Tried, usize) -> f64| {
        let line = |one: &Tried| {
            let name = match one.method {
                "surface" => one.world.to_owned(),
                method => format!("{method}, {}", one.world),
            };
            let points = (1..=config.readings).map(|n| (n as f64, of(one, n))).collect();
            Line { name: name.replace('_', " "), points }
        };
        let lines = tried.iter().filter(keep).map(line).collect();
        Panel { title: title.to_owned(), x: "readings".to_owned(), y: y.to_owned(), lines }
    };
    let accuracy = |one: &Tried, n: usize| one.played.accuracy(n);
    let position = |one: &Tried, n: usize| median(&one.played.errors(n, |e| e.translation / MM));
    let is_world = |one: &&Tried| {
        ["point_spread", "layer", "half_space"].contains(&one.world)
            && ["surface", "literal"].contains(&one.method)
    };
    let is_aspect = |one: &&Tried| one.world.starts_with("layer") && one.method != "literal";
    let is_surface = |one: &&Tried| one.method == "surface";
    vec![
        panel("recognised", "share right", &is_world, &accuracy),
        panel("what breaks, layer", "share right", &is_aspect, &accuracy),
        panel("position", "median error (mm)", &is_surface, &position),
        panel("position, layer", "median error (mm)", &is_aspect, &position),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_names_what_breaks() {
        let config = OtherPhysics {
            seed: 101,
            trials: 1,
            literal_sessions: 2,
            touches: TouchSet { train_readings: 200, test_readings: 8, ..defaults() },
            readings: 4,
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        assert!(summary["point_spread_accuracy_at_4"] >= 0.7, "{summary:?}");
        assert!(summary["accuracy_at_4"] >= 0.4, "{summary:?}");
        for key in [
            "half_space_accuracy_at_4",
            "without_appearance_accuracy_at_4",
            "layer_images_only_position_error_mm_median_at_4",
            "literal_accuracy_at_4",
            "layer_contact_shift_mm_median",
            "half_space_height_mm_mean",
            "unknown_at_4",
        ] {
            assert!(summary.contains_key(key), "{key}: {summary:?}");
        }
    }
}
