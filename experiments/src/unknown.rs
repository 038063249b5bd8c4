//! Objects that are not in the catalogue: their detection, and the calibration of stated
//! probabilities.
//!
//! The objects are divided into folds; each fold in turn is left out, and the catalogue learns
//! the rest as the service does: surfaces from nine readings in ten, the calibration from the
//! tenth. Sessions touch known and left-out objects in a given proportion. The answer after a
//! touch is the likeliest of all objects and "none of these"; the calibration error is taken
//! over 15 bins of equal width of its probability. The prior of "none of these" is the share of
//! sessions with unknown objects; the same sessions are also played with the service's default
//! prior (`default_prior`). Objects are given ones, or procedural ones of the seed, so that
//! every seed has new ones. The stop rule is fitted to the rows with a `doubt`, on a seed that
//! is not reported. The printed method (`literal`) has no answer "none of these": its score is 1
//! − its best probability. `oracle` tells why sessions with known objects end wrong.

mod oracle;
mod tables;

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context as _;
use clap::Args;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::symmetry::Symmetry;
use palpate_core::units::MM;
use palpate_dissertation::sva::SvaOptions;
use palpate_dissertation::sva::train::TrainingConfig;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::svg;
use palpate_sim::shapes::assembled;
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, count, share};
use crate::disturbance::Disturbance;
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects::{self, TestObject};
use crate::report::{Outcome, Progress, Report};
use crate::stated::Stated;
use crate::trained::{train_calibrated, train_sva};
use oracle::Examined;

/// Arguments of `unknown`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Unknown {
    /// Procedural objects, new ones for every seed.
    #[arg(long, default_value_t = 48)]
    pub procedural: usize,
    /// Objects beside them. The built-in ones count only if there are no procedural ones.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// A folder of further meshes.
    #[arg(long, value_name = "DIR")]
    pub pool: Option<PathBuf>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of folds. Each is left out once.
    #[arg(long, default_value_t = 4, value_parser = count)]
    pub folds: usize,
    /// Sessions of all folds together.
    #[arg(long, default_value_t = 2_400, value_parser = count)]
    pub sessions: usize,
    /// Share of sessions with unknown objects.
    #[arg(long, default_value_t = 0.5, value_parser = share)]
    pub unknown_share: f64,
    /// Probability of "none of these" before any touch.
    #[arg(long, default_value_t = 0.5, value_parser = share)]
    pub prior: f64,
    /// Sessions of the printed method, all in the first fold; 0 for none. It is slow.
    #[arg(long, default_value_t = 4)]
    pub literal_sessions: usize,
    /// Training readings per object.
    #[arg(long, default_value_t = 600, value_parser = count)]
    pub train_readings: usize,
    /// Test readings per object.
    #[arg(long, default_value_t = 100, value_parser = count)]
    pub test_readings: usize,
    /// Readings per session.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub readings: usize,
    /// Wrong sessions with known objects, per number of touches, whose cause is looked for
    /// (`oracle`); 0 for none.
    #[arg(long, default_value_t = 0)]
    pub oracle: usize,
    /// Of these, sessions that the search did not lose and that are repeated on finer maps, which
    /// take seconds each.
    #[arg(long, default_value_t = 12)]
    pub finer: usize,
    /// Distance (mm) at which every touch comes twice when the sessions are played once more; 0 for
    /// not at all.
    #[arg(long, default_value_t = 0.0)]
    #[serde(skip_serializing_if = "is_zero")]
    pub doubled_mm: f64,
    /// The sensor.
    #[arg(skip = SensorDescription::digitacts_6x6())]
    #[serde(skip)]
    pub sensor: SensorDescription,
}

/// Left out of a record that does not ask for it.
fn is_zero(distance: &f64) -> bool {
    *distance <= 0.0
}

/// One session's answers, touch by touch.
struct Verdict {
    object: usize,
    trial: usize,
    is_known: bool,
    /// The catalogue's objects, among all.
    known: Arc<[usize]>,
    /// Per touch: the probability of each known object, then of none of them.
    probabilities: Vec<Vec<f64>>,
    /// Index of the truth among these probabilities.
    truth: usize,
    /// The prior of "none of these" if it is the service's default and not the true share.
    untold_prior: Option<f64>,
}

impl Verdict {
    fn stated(&self, readings: usize) -> Stated {
        Stated::new(&self.probabilities[readings - 1], self.truth, self.untold_prior)
    }

    /// The object (among all) named after this many touches; `None` for none of these.
    fn named(&self, readings: usize) -> Option<usize> {
        let probabilities = &self.probabilities[readings - 1];
        let best = (0..probabilities.len())
            .max_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]).then(b.cmp(a)));
        self.known.get(best?).copied()
    }
}

/// Method of a set of sessions, and the names of its figures.
#[derive(Clone, Copy)]
struct Kind {
    method: &'static str,
    /// Prefix of the names of its figures.
    prefix: &'static str,
    /// Part of the names before the number of touches or the risk.
    infix: &'static str,
}

/// Objects and their readings.
struct Touched {
    objects: Vec<TestObject>,
    train: Vec<Vec<Reading>>,
    test: Vec<Vec<Reading>>,
}

impl Touched {
    /// Sessions with these objects. Errors of poses are not asked for.
    fn sessions<'a>(&'a self, config: &'a Unknown, symmetries: &'a [Symmetry]) -> Sessions<'a> {
        let Unknown { sensor, seed, readings, .. } = config;
        Sessions::undisturbed(sensor, &self.test, symmetries, *seed, *readings)
    }
}

/// What doubling every touch of a session adds to the probability of the truth and of "none of
/// these", touch by touch; the truth is an object of the catalogue or none of them.
struct Doubled {
    is_known: bool,
    gains: Vec<[f64; 2]>,
}

fn doubled_once(one: &Verdict, two: &Verdict) -> Doubled {
    let twice = two.probabilities.iter().skip(1).step_by(2);
    let gain = |(once, twice): (&Vec<f64>, &Vec<f64>)| {
        [one.truth, one.known.len()].map(|index| twice[index] - once[index])
    };
    let gains = one.probabilities.iter().zip(twice).map(gain).collect();
    Doubled { is_known: one.is_known, gains }
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, training fails, or there are too few objects.
pub fn run(config: &Unknown, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let touched = touch(config, progress)?;
    let n = touched.objects.len();
    anyhow::ensure!(
        config.folds > 1 && n >= 2 * config.folds,
        "{n} objects in {} folds, expected at least 2 folds and 2 objects a fold",
        config.folds
    );
    let symmetries = objects::symmetries(&touched.objects);
    let (mut verdicts, mut untold) = (Vec::new(), Vec::new());
    let (mut literal, mut lost, mut doubled) = (Vec::new(), Vec::new(), Vec::new());
    for fold in 0..config.folds {
        progress("folds", fold, config.folds);
        let known: Arc<[usize]> = (0..n).filter(|at| at % config.folds != fold).collect();
        let train: Vec<Vec<Reading>> = known.iter().map(|at| touched.train[*at].clone()).collect();
        let of_known: Vec<Symmetry> = known.iter().map(|at| symmetries[*at].clone()).collect();
        let (sensor, surface) = (&config.sensor, SurfaceConfig::default());
        let model = train_calibrated(&train, &of_known, sensor, &surface, config.seed)?;
        tables::report_calibration(&mut report, fold, &model);
        let share = |all: usize| all * (fold + 1) / config.folds - all * fold / config.folds;
        let options = SurfaceOptions { unknown: config.prior, ..SurfaceOptions::default() };
        let surface = Recogniser::Surface { model: model.clone(), options };
        let n_sessions = share(config.sessions);
        let play = |recogniser: &Recogniser, n, disturbance| {
            play(config, &touched, &known, (recogniser, disturbance), fold, n)
        };
        let played = play(&surface, n_sessions, Disturbance::None)?;
        if config.oracle > 0 {
            progress("the causes of wrong sessions", fold, config.folds);
            let examined = Examined { config, touched: &touched, model: &model, options };
            let (oracle, finer) = (share(config.oracle), share(config.finer));
            lost.extend(examined.lost(&played, oracle, finer)?);
        }
        verdicts.extend(played);
        let surface = Recogniser::Surface { model, options: SurfaceOptions::default() };
        let default_prior = play(&surface, n_sessions, Disturbance::None)?;
        if config.doubled_mm > 0.0 {
            let distance = config.doubled_mm * MM;
            let again = play(&surface, n_sessions, Disturbance::Doubled { distance })?;
            doubled
                .extend(default_prior.iter().zip(again).map(|(one, two)| doubled_once(one, &two)));
        }
        let untold_prior = Some(SurfaceOptions::default().unknown);
        untold.extend(default_prior.into_iter().map(|v| Verdict { untold_prior, ..v }));
        if fold == 0 && config.literal_sessions > 0 {
            progress("the printed method", fold, config.folds);
            let (training, options) = (TrainingConfig::literal(), SvaOptions::literal());
            let sva = train_sva(&train, &config.sensor, &training, options, config.seed)?;
            literal = play(&sva, config.literal_sessions, Disturbance::None)?;
        }
    }
    if config.oracle > 0 {
        oracle::report_lost(&mut report, config, &lost);
    }
    let played = [
        (Kind { method: "surface", prefix: "", infix: "" }, &verdicts),
        (Kind { method: "surface, default prior", prefix: "", infix: "default_prior_" }, &untold),
        (Kind { method: "literal", prefix: "literal_", infix: "" }, &literal),
    ];
    for (kind, verdicts) in played.iter().filter(|(_, verdicts)| !verdicts.is_empty()) {
        tables::report_sessions(&mut report, config, *kind, verdicts);
    }
    tables::report_doubled(&mut report, &doubled);
    tables::report_confused(&mut report, config, &touched.objects, &verdicts);
    let panels = tables::panels(&mut report, config, &verdicts, &literal);
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// The procedural objects of the seed.
fn procedural(config: &Unknown) -> anyhow::Result<Vec<TestObject>> {
    let of = |index: usize| {
        let mesh = assembled(config.seed, index as u64)
            .with_context(|| format!("procedural object {index} never hangs together"))?;
        let mesh = mesh.scaled_to_largest_dimension(config.objects.size());
        Ok(TestObject { name: format!("assembled {index}"), mesh })
    };
    (0..config.procedural).map(of).collect()
}

fn touch(config: &Unknown, progress: Progress<'_>) -> anyhow::Result<Touched> {
    let mut objects = procedural(config)?;
    if config.objects.is_named() || objects.is_empty() {
        objects.extend(config.objects.load()?);
    }
    if let Some(pool) = &config.pool {
        objects.extend(config.objects.load_folder(pool)?);
    }
    let touch = |n, seed| objects::touch_all(&objects, &config.sensor, n, seed, progress);
    let train = touch(config.train_readings, 2 * config.seed)?;
    let test = touch(config.test_readings, 2 * config.seed + 1)?;
    Ok(Touched { objects, train, test })
}

/// Plays `n` sessions in turn with the known objects and with the others, in the stated share.
fn play(
    config: &Unknown,
    touched: &Touched,
    known: &Arc<[usize]>,
    (recogniser, disturbance): (&Recogniser, Disturbance),
    fold: usize,
    n: usize,
) -> anyhow::Result<Vec<Verdict>> {
    let n_objects = touched.objects.len();
    let unknown: Vec<usize> = (0..n_objects).filter(|at| at % config.folds == fold).collect();
    let n_unknown = (n as f64 * config.unknown_share).round() as usize;
    let of = |objects: &[usize], session: usize| {
        (objects[session % objects.len()], session / objects.len())
    };
    let plan = (0..n).map(|at| match at.checked_sub(n_unknown) {
        None => of(&unknown, at),
        Some(at) => of(known, at),
    });
    let symmetries = vec![Symmetry::NONE; n_objects];
    let sessions = Sessions { disturbance, ..touched.sessions(config, &symmetries) };
    let one = |(object, trial): (usize, usize)| {
        let probabilities = sessions.probabilities(recogniser, object, trial)?;
        let place = known.iter().position(|at| *at == object);
        let truth = place.unwrap_or(known.len());
        let (known, is_known) = (Arc::clone(known), place.is_some());
        Ok(Verdict { object, trial, is_known, known, probabilities, truth, untold_prior: None })
    };
    plan.collect::<Vec<_>>().into_par_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_states_every_figure() {
        let config = Unknown {
            procedural: 0,
            seed: 101,
            folds: 2,
            sessions: 40,
            literal_sessions: 4,
            train_readings: 200,
            test_readings: 30,
            readings: 6,
            oracle: 6,
            finer: 2,
            doubled_mm: 0.3,
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        assert!(summary["auroc_at_6"] > 0.8, "{summary:?}");
        assert!(summary["known_accuracy_at_6"] > 0.8, "{summary:?}");
        assert!((0.0..0.35).contains(&summary["expected_calibration_error"]), "{summary:?}");
        assert!((summary["sessions"] - 40.0).abs() < 1e-9);
        assert!(summary["never_stopped_at_risk_0_1"] <= summary["never_stopped_at_risk_0_001"]);
        assert!(summary["doubled_known_gain_at_6"] > -0.02, "{summary:?}");
        for key in [
            "literal_auroc_at_6",
            "wrong_stops_high_at_risk_0_05",
            "called_known_at_4",
            "wrong_stops_default_prior_at_risk_0_01",
            "calibration_error_default_prior_at_6",
        ] {
            assert!(summary.contains_key(key), "{key}");
        }
        let causes =
            summary.iter().filter(|(key, _)| key.starts_with("lost_by_") && key.ends_with("_at_4"));
        let shares: f64 = causes.map(|(_, share)| share).sum();
        assert!(summary["examined_at_4"] > 0.0, "{summary:?}");
        assert!((shares - 1.0).abs() < 1e-9, "every cause is told: {summary:?}");
        // The diagonal and 2, 4, 6 touches; surface and literal; three and one of the stop rule.
        assert_eq!(outcome.plot.matches("polyline").count(), 4 + 2 + 3 + 1);
    }

    #[test]
    fn too_few_objects_for_the_folds_are_an_error() {
        let small = Unknown { train_readings: 20, test_readings: 5, ..defaults() };
        let config = Unknown { procedural: 10, folds: 6, ..small };
        let error = run(&config, &|_, _, _| ()).err().unwrap();
        let expected = "10 objects in 6 folds, expected at least 2 folds and 2 objects a fold";
        assert_eq!(error.to_string(), expected);
    }
}
