//! Thinning (section 5.6.3): loss of accuracy when an object keeps fewer training touches.
//!
//! Every object is trained once; some touches of its map are kept, farthest first or drawn at
//! random; the appearance space and the statistics of each touch stay. The printed method
//! (`literal`) learns from equally many readings in the order in which they were taken. Time is
//! processor time of one thread per reading, answer included.

use std::sync::Arc;

use clap::Args;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_dissertation::sva::SvaOptions;
use palpate_dissertation::sva::train::TrainingConfig;
use palpate_recogniser::model::SurfaceMap;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use crate::arguments::{ObjectSet, TouchSet, count};
use crate::disturbance::Disturbance;
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects;
use crate::played::{Figures, Played};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::median;
use crate::trained::{train_surface, train_sva};

/// Numbers of readings whose accuracy the summary states.
const STATED_AT: [usize; 4] = [2, 3, 4, 10];

/// Arguments of `thinning`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Thinning {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Touches that an object keeps.
    #[arg(long, default_values_t = [1_000, 700, 500, 250, 100, 50], value_delimiter = ',', value_parser = count)]
    pub kept: Vec<usize>,
    /// Trials per object.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub trials: usize,
    /// Sessions of the printed method at each of `--literal-kept`; 0 for none. It is slow.
    #[arg(long, default_value_t = 10)]
    pub literal_sessions: usize,
    /// Readings that the printed method learns from.
    #[arg(long, default_values_t = [1_000, 250], value_delimiter = ',', value_parser = count)]
    pub literal_kept: Vec<usize>,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
    /// Readings per trial.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub readings: usize,
}

/// Order in which touches are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    FarthestFirst,
    Random,
}

/// One thinned catalogue and its trials.
struct Tested {
    name: &'static str,
    kept: usize,
    bytes: usize,
    played: Played,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, or training fails.
pub fn run(config: &Thinning, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let objects = config.objects.load()?;
    let touch_all =
        |n, seed| objects::touch_all(&objects, &config.touches.sensor, n, seed, progress);
    let train = touch_all(config.touches.train_readings, 2 * config.seed)?;
    let test = touch_all(config.touches.test_readings, 2 * config.seed + 1)?;
    progress("training", 0, 1);
    let symmetries = objects::symmetries(&objects);
    let surface = SurfaceConfig::default();
    let whole = train_surface(&train, &symmetries, &config.touches.sensor, &surface, config.seed)?;
    let sessions = Sessions {
        sensor: &config.touches.sensor,
        test: &test,
        symmetries: &symmetries,
        seed: config.seed,
        readings: config.readings,
        threads: 1,
        disturbance: Disturbance::None,
    };
    let mut tested = Vec::new();
    for (name, order) in [("farthest", Order::FarthestFirst), ("random", Order::Random)] {
        for kept in &config.kept {
            let model = thinned(&whole, *kept, order, config.seed);
            let surface = Recogniser::Surface { model, options: SurfaceOptions::default() };
            let n = config.trials * objects.len();
            let played = sessions.play(&surface, objects.len(), n, progress)?;
            tested.push(Tested { name, kept: *kept, bytes: surface.bytes(), played });
        }
    }
    for kept in config.literal_kept.iter().filter(|_| config.literal_sessions > 0) {
        progress("training the printed method", 0, 1);
        let few: Vec<Vec<Reading>> =
            train.iter().map(|all| all.iter().take(*kept).cloned().collect()).collect();
        let (training, options) = (TrainingConfig::literal(), SvaOptions::literal());
        let literal = train_sva(&few, &config.touches.sensor, &training, options, config.seed)?;
        let played = sessions.play(&literal, objects.len(), config.literal_sessions, progress)?;
        tested.push(Tested { name: "literal", kept: *kept, bytes: literal.bytes(), played });
    }
    for one in &tested {
        report_one(&mut report, config, one);
    }
    report_loss(&mut report, config, &tested);
    Ok(Outcome { report, plot: plot(config, &tested), pictures: Vec::new() })
}

/// A copy of the catalogue with at most `kept` touches per object.
fn thinned(whole: &SurfaceModel, kept: usize, order: Order, seed: u64) -> Arc<SurfaceModel> {
    let thin = |(object, map): (usize, &Arc<SurfaceMap>)| {
        let mut patches = map.patches().to_vec();
        if order == Order::Random {
            let mut stream = Stream::new(seed, Purpose::Sampling, object as u64);
            for place in (1..patches.len()).rev() {
                patches.swap(place, stream.index(place + 1));
            }
        }
        patches.truncate(kept);
        Arc::new(SurfaceMap::new(map.origin_in_training(), patches, map.layout()))
    };
    let maps = whole.maps().iter().enumerate().map(thin).collect();
    Arc::new(whole.with_maps(maps))
}

#[derive(Serialize)]
struct OfKept {
    touches_per_object: usize,
    cpu_ms_per_touch: Option<f64>,
    bytes: usize,
    #[serde(flatten)]
    figures: Figures,
}

fn report_one(report: &mut Report, config: &Thinning, one: &Tested) {
    let Tested { name, kept, bytes, played } = one;
    for readings in 1..=config.readings {
        report.labelled(
            &[("kept", name)],
            OfKept {
                touches_per_object: *kept,
                cpu_ms_per_touch: played.cpu_ms,
                bytes: *bytes,
                figures: played.figures(readings),
            },
        );
    }
    let mut state =
        |key: &str, value: f64| report.summarise(&format!("{name}_{kept}_{key}"), value);
    for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
        state(&format!("accuracy_at_{readings}"), played.accuracy(readings));
    }
    let moved = median(&played.errors(config.readings, |e| e.translation / MM));
    state(&format!("position_error_mm_median_at_{}", config.readings), moved);
    state("bytes", *bytes as f64);
    if let Some(cpu_ms) = played.cpu_ms {
        state("ms_per_touch", cpu_ms);
    }
}

#[derive(Serialize)]
struct Loss {
    touches_per_object: usize,
    readings: usize,
    accuracy_lost: f64,
    bytes_share: f64,
}

/// Adds the loss against the largest number of touches, farthest first.
fn report_loss(report: &mut Report, config: &Thinning, tested: &[Tested]) {
    let Some(whole) = tested.first() else { return };
    for one in tested.iter().filter(|one| one.name != "literal") {
        for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
            let lost = whole.played.accuracy(readings) - one.played.accuracy(readings);
            report.labelled(
                &[("kept", one.name)],
                Loss {
                    touches_per_object: one.kept,
                    readings,
                    accuracy_lost: lost,
                    bytes_share: one.bytes as f64 / whole.bytes as f64,
                },
            );
        }
    }
}

fn plot(config: &Thinning, tested: &[Tested]) -> String {
    let panel = |title: &str, y: &str, value: &dyn Fn(&Tested) -> f64| {
        let line = |name: &str| {
            let own = tested.iter().filter(|one| one.name == name);
            let points = own.map(|one| (one.kept as f64, value(one))).collect();
            Line { name: name.to_owned(), points }
        };
        let x = "touches kept of each object".to_owned();
        let lines = vec![line("farthest"), line("random"), line("literal")];
        Panel { title: title.to_owned(), x, y: y.to_owned(), lines }
    };
    let early = config.readings.min(3);
    svg(&[
        panel(&format!("after {early} readings"), "share right", &|one| one.played.accuracy(early)),
        panel("position at the end", "median error (mm)", &|one| {
            median(&one.played.errors(config.readings, |e| e.translation / MM))
        }),
        panel("catalogue", "megabytes", &|one| one.bytes as f64 / 1e6),
        panel("time of a reading", "mean (ms)", &|one| one.played.cpu_ms.unwrap_or(f64::NAN)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_states_what_thinning_saves() {
        let config = Thinning {
            seed: 101,
            kept: vec![200, 60],
            trials: 2,
            literal_sessions: 2,
            literal_kept: vec![100],
            touches: TouchSet { train_readings: 200, test_readings: 20, ..defaults() },
            readings: 4,
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        assert!(summary["farthest_200_accuracy_at_4"] >= 0.75, "{summary:?}");
        // Keeping all touches gives the same set in any order.
        assert!(summary["farthest_60_bytes"] < 0.5 * summary["farthest_200_bytes"]);
        assert!(summary.contains_key("random_60_accuracy_at_3"), "{summary:?}");
        assert!(summary.contains_key("literal_100_accuracy_at_4"), "{summary:?}");
        assert_eq!(outcome.plot.matches("polyline").count(), 4 * 3);
    }
}
