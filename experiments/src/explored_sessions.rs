//! Recognisers that use poses, on the readings of explorations in the order they were taken.
//!
//! The session frame is the arm's. An object that moves between touches is not announced.

use palpate_core::object::ObjectIdx;
use palpate_core::reading::Reading;
use palpate_dissertation::sva::SvaOptions;
use palpate_dissertation::sva::train::TrainingConfig;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::Line;
use rayon::prelude::*;
use serde::Serialize;

use crate::explorations::{Run, Strategy};
use crate::object_sessions::Recogniser;
use crate::object_trials::Setting;
use crate::objects::{TestObject, symmetries};
use crate::report::Report;
use crate::statistics::mean;
use crate::trained::{train_surface, train_sva};

/// Counts of readings after which the recognisers answer.
const COUNTS: [usize; 9] = [1, 2, 3, 4, 5, 7, 10, 15, 20];

/// Counts that the summary states.
const STATED_AT: [usize; 4] = [4, 5, 10, 20];

/// The service's own recogniser and `sva` by their names in rows, learnt from `training`, one
/// list of readings an object.
///
/// # Errors
/// When the readings cannot be learnt from.
pub fn recognisers(
    objects: &[TestObject],
    training: &[Vec<Reading>],
    setting: &Setting,
    seed: u64,
) -> anyhow::Result<[(&'static str, Recogniser); 2]> {
    let (sensor, config) = (&setting.sensor, SurfaceConfig::default());
    let model = train_surface(training, &symmetries(objects), sensor, &config, seed)?;
    let surface = Recogniser::Surface { model, options: SurfaceOptions::default() };
    let printed = (TrainingConfig::default(), SvaOptions::default());
    let sva = train_sva(training, sensor, &printed.0, printed.1, seed)?;
    Ok([("surface", surface), ("sva", sva)])
}

#[derive(Serialize)]
struct Recognised {
    readings: usize,
    accuracy: f64,
}

/// Plays every exploration to a recogniser; adds rows and summary, and gives the line of a plot.
///
/// # Errors
/// When the sensor does not fit what was trained.
pub fn play(
    report: &mut Report,
    recogniser: (&str, &Recogniser),
    setting: &Setting,
    strategy: &Strategy,
    runs: &[Run],
) -> anyhow::Result<Line> {
    let (method, recogniser) = recogniser;
    let accuracies = accuracies(recogniser, setting, runs)?;
    for (readings, accuracy) in &accuracies {
        report.labelled(
            &[
                ("setting", &setting.name),
                ("readings_from", &strategy.name),
                ("order", "in_order"),
                ("method", method),
            ],
            Recognised { readings: *readings, accuracy: *accuracy },
        );
        if STATED_AT.contains(readings) {
            let (setting, strategy) = (&setting.key, &strategy.key);
            let key = format!("{method}_{setting}{strategy}_in_order_accuracy_at_{readings}");
            report.summarise(&key, *accuracy);
        }
    }
    let points = accuracies.iter().map(|(readings, share)| (*readings as f64, 100.0 * share));
    Ok(Line { name: format!("{method}, {}", strategy.name), points: points.collect() })
}

/// Share of the explorations whose object is named, after each of the counts that all reach.
fn accuracies(
    recogniser: &Recogniser,
    setting: &Setting,
    runs: &[Run],
) -> anyhow::Result<Vec<(usize, f64)>> {
    let explorations: Vec<(usize, Vec<Reading>)> =
        runs.iter().flat_map(|run| run.readings().into_iter().enumerate()).collect();
    let verdicts = explorations.par_iter().map(|(truth, readings)| {
        let names = recogniser.names(readings, &setting.sensor, &COUNTS)?;
        let is_right = |name: &Option<ObjectIdx>| *name == Some(ObjectIdx(*truth as u32));
        Ok(names.iter().map(|name| f64::from(u8::from(is_right(name)))).collect())
    });
    let verdicts = verdicts.collect::<anyhow::Result<Vec<Vec<f64>>>>()?;
    let of = |(at, readings): (usize, &usize)| {
        let right: Option<Vec<f64>> = verdicts.iter().map(|v| v.get(at).copied()).collect();
        right.map(|right| (*readings, mean(&right)))
    };
    Ok(COUNTS.iter().enumerate().filter_map(of).collect())
}
