//! Ten objects under conditions that training did not have: robustness of the surface recogniser.
//!
//! Taxel noise (section 4.4.2.7: in training and in tests), errors of the arm's pose, an object
//! that moves between touches (section 4.4.2.4), sensors other than in training, and training
//! from ideal presses of the CAD model with tests on the shifted simulator of section 4.4.4.3:
//! squared response, gains, noise and steps of another array. The recogniser knows the
//! sensor's taxels and no disturbance; in conditions that end in `_told` it also knows the range
//! of the object's motion, the time of a motion, or the errors of the bases. In the same run the
//! printed method (`literal`) plays a few shorter sessions of each condition.

mod conditions;

use std::sync::Arc;

use clap::Args;
use palpate_core::reading::Reading;
use palpate_core::symmetry::Symmetry;
use palpate_core::units::MM;
use palpate_dissertation::sva::SvaOptions;
use palpate_dissertation::sva::train::TrainingConfig;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::train::SurfaceConfig;
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects::{self, TestObject};
use crate::played::{Played, report_wrong};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::median;
use crate::trained::{train_surface, train_sva};
pub use conditions::{Condition, Trained, conditions};
use palpate_sim::plot::{Line, Panel, svg};

/// Arguments of `surface-noise`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct SurfaceNoise {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Only conditions whose keys begin with this; all when empty.
    #[arg(long, default_value = "", value_name = "KEY")]
    pub only: String,
    /// Trials per object and condition.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub trials: usize,
    /// Sessions of the printed method in each condition, which is slow; 0 for none.
    #[arg(long, default_value_t = 10)]
    pub literal_sessions: usize,
    /// Readings of these sessions.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub literal_readings: usize,
    /// Training readings per object.
    #[arg(long, default_value_t = 1_000, value_parser = count)]
    pub train_readings: usize,
    /// Test readings per object.
    #[arg(long, default_value_t = 100, value_parser = count)]
    pub test_readings: usize,
    /// Readings per trial.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub readings: usize,
}

/// Models from one kind of training readings.
struct Learnt {
    model: Arc<SurfaceModel>,
    literal: Option<Recogniser>,
    symmetries: Vec<Symmetry>,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, training fails, or no condition has the key.
pub fn run(config: &SurfaceNoise, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let objects = config.objects.load()?;
    let chosen: Vec<Condition> = conditions(config.objects.size())?
        .into_iter()
        .filter(|c| c.key.starts_with(&config.only))
        .collect();
    anyhow::ensure!(!chosen.is_empty(), "no condition has a key that begins {}", config.only);
    let mut groups: Vec<(Trained, Vec<&Condition>)> = Vec::new();
    for condition in &chosen {
        match groups.iter_mut().find(|(trained, _)| *trained == condition.trained) {
            Some((_, group)) => group.push(condition),
            None => groups.push((condition.trained, vec![condition])),
        }
    }
    let mut lines = Vec::new();
    let mut least = f64::INFINITY;
    for (done, (trained, group)) in groups.into_iter().enumerate() {
        progress("training", done, chosen.len());
        let learnt = learn(config, trained, &objects)?;
        for condition in group {
            progress(condition.name, lines.len(), chosen.len());
            let test =
                condition.sensing.touch_all(&objects, config.test_readings, 2 * config.seed + 1)?;
            let played = play(config, condition, &learnt, &test, progress)?;
            report_condition(&mut report, config, condition, &objects, &played);
            least = least.min(played.0.accuracy(config.readings));
            let points = (1..=config.readings).map(|n| (n as f64, played.0.accuracy(n)));
            lines.push(Line { name: condition.name.to_owned(), points: points.collect() });
        }
    }
    report.summarise(&format!("accuracy_at_{}_min", config.readings), least);
    Ok(Outcome { report, plot: svg(&panels(lines)), pictures: Vec::new() })
}

fn learn(
    config: &SurfaceNoise,
    trained: Trained,
    objects: &[TestObject],
) -> anyhow::Result<Learnt> {
    let sensing = trained.sensing()?;
    let train = sensing.touch_all(objects, config.train_readings, 2 * config.seed)?;
    let surface = SurfaceConfig::default();
    let symmetries = objects::symmetries(objects);
    let model = train_surface(&train, &symmetries, &sensing.sensor, &surface, config.seed)?;
    let (training, options) = (TrainingConfig::literal(), SvaOptions::literal());
    let literal = if config.literal_sessions > 0 {
        Some(train_sva(&train, &sensing.sensor, &training, options, config.seed)?)
    } else {
        None
    };
    Ok(Learnt { model, literal, symmetries })
}

/// Plays a condition: by the surface recogniser, and by the printed method where it can.
fn play(
    config: &SurfaceNoise,
    condition: &Condition,
    learnt: &Learnt,
    test: &[Vec<Reading>],
    progress: Progress<'_>,
) -> anyhow::Result<(Played, Option<Played>)> {
    let mut sessions = Sessions {
        sensor: &condition.sensing.sensor,
        test,
        symmetries: &learnt.symmetries,
        seed: config.seed,
        readings: config.readings,
        threads: 1,
        disturbance: condition.disturbance,
    };
    let n = test.len();
    let surface = Recogniser::Surface { model: learnt.model.clone(), options: condition.options };
    let surface = sessions.play(&surface, n, config.trials * n, progress)?;
    // The printed method compares images taxel by taxel and cannot use another grid.
    let same_grid = condition.sensing.sensor.grid() == condition.trained.sensing()?.sensor.grid();
    sessions.readings = config.literal_readings.min(config.readings);
    let literal = match &learnt.literal {
        Some(literal) if same_grid => {
            Some(sessions.play(literal, n, config.literal_sessions, progress)?)
        }
        _ => None,
    };
    Ok((surface, literal))
}

fn report_condition(
    report: &mut Report,
    config: &SurfaceNoise,
    condition: &Condition,
    objects: &[TestObject],
    (surface, literal): &(Played, Option<Played>),
) {
    let methods = [("surface", Some(surface)), ("literal", literal.as_ref())];
    for (method, played) in methods.into_iter().filter_map(|(name, p)| Some((name, p?))) {
        let last = played.steps.iter().map(|step| step.readings).max().unwrap_or(0);
        for readings in 1..=last {
            report.labelled(
                &[("condition", condition.key), ("method", method)],
                played.figures(readings),
            );
        }
        let prefix = if method == "surface" { "" } else { "literal_" };
        let key = format!("{prefix}accuracy_at_{last}_{}", condition.key);
        report.summarise(&key, played.accuracy(last));
    }
    let at = config.readings.min(10);
    report.summarise(&format!("accuracy_at_{at}_{}", condition.key), surface.accuracy(at));
    let moved = median(&surface.errors(config.readings, |e| e.translation / MM));
    let key = format!("position_error_mm_median_at_{}_{}", config.readings, condition.key);
    report.summarise(&key, moved);
    let key = format!("unknown_at_{}_{}", config.readings, condition.key);
    report.summarise(&key, surface.unknown(config.readings));
    let wrong = surface.after(config.readings);
    report_wrong(report, &[("condition", condition.key)], objects, wrong);
}

/// Panels of at most six lines each.
fn panels(lines: Vec<Line>) -> Vec<Panel> {
    let mut panels = Vec::new();
    let mut lines = lines.into_iter().peekable();
    while lines.peek().is_some() {
        let (x, y) = ("readings".to_owned(), "share right".to_owned());
        let lines = lines.by_ref().take(6).collect();
        panels.push(Panel { title: "recognised".to_owned(), x, y, lines });
    }
    panels
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_bears_dead_taxels_and_a_finer_sensor() {
        for (only, literal) in [("dead", true), ("fine", false)] {
            let config = SurfaceNoise {
                seed: 101,
                only: only.to_owned(),
                trials: 1,
                literal_sessions: 2,
                literal_readings: 3,
                train_readings: 200,
                test_readings: 20,
                readings: 8,
                ..defaults()
            };
            let outcome = run(&config, &|_, _, _| ()).unwrap();
            let summary = &outcome.report.summary;
            assert!(summary["accuracy_at_8_min"] >= 0.8, "{summary:?}");
            let has_literal = summary.keys().any(|key| key.starts_with("literal_accuracy_at_3"));
            assert_eq!(has_literal, literal, "{only}");
            assert_eq!(outcome.plot.matches("polyline").count(), 1);
        }
    }

    /// Figures of fifteen touches per object under conditions whose keys begin with `only`.
    fn figures(only: &str) -> BTreeMap<String, f64> {
        let config = SurfaceNoise {
            seed: 101,
            only: only.to_owned(),
            trials: 1,
            literal_sessions: 0,
            train_readings: 200,
            test_readings: 20,
            readings: 15,
            ..defaults()
        };
        run(&config, &|_, _, _| ()).unwrap().report.summary
    }

    #[test]
    fn an_announced_jolt_is_recovered_from() {
        let summary = figures("jolt");
        let off = |key: &str| summary[&format!("position_error_mm_median_at_15_{key}")];
        let (told, untold) = (off("jolt_told"), off("jolt"));
        assert!(5.0 * told < untold, "{told} {untold} mm");
    }

    #[test]
    fn an_announced_motion_is_not_an_unknown_object() {
        let summary = figures("moving");
        assert!(summary["accuracy_at_15_moving"] >= 0.8, "{summary:?}");
        let (told, untold) =
            (summary["unknown_at_15_moving_told"], summary["unknown_at_15_moving"]);
        assert!(told < 0.5 && untold > told, "{told} {untold}");
    }

    #[test]
    fn a_condition_that_does_not_exist_is_an_error() {
        let config = SurfaceNoise { only: "none".to_owned(), ..defaults() };
        let error = run(&config, &|_, _, _| ()).err().unwrap();
        assert_eq!(error.to_string(), "no condition has a key that begins none");
    }
}
