//! Fifty and a hundred objects, and on demand a thousand, by the surface recogniser.
//!
//! Without given meshes the objects are ours (`own`): the public benchmark, then capital letters
//! as solids and procedural objects. Otherwise they are the given meshes, then those of the
//! pool, the built-in objects and the given letters. All but the first come in an order drawn
//! once for all seeds, and all are scaled to one size. Objects that the sampler cannot touch
//! often enough are left out and named in a row. Only the letters [`LETTERS`] are taken: solids
//! can be turned over, so that lower-case b, d, p and q, n and u are (nearly) one, as are M and
//! W, N and Z, and in round fonts C and U, A and V. In the same run the printed method
//! (`literal`) plays a few sessions. In a few more sessions of the largest the planner chooses
//! the touches (`chosen`). Time is processor time of one thread per reading, answer included.

mod chosen;
mod figures;
mod learnt;
mod oracle;
mod own;
mod thousand;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_dissertation::sva::SvaOptions;
use palpate_dissertation::sva::train::TrainingConfig;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::shapes;
use serde::Serialize;

use crate::arguments::{ObjectSet, TouchSet, count};
use crate::disturbance::Disturbance;
use crate::families::Families;
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects::{self, TestObject};
use crate::played::Played;
use crate::report::{Outcome, Progress, Report};
use crate::trained::{train_surface, train_sva};
use figures::{InCatalogue, report_catalogue, report_late_wrong, report_letters};
use oracle::Examined;
use thousand::Growth;

/// The letters that differ as solids: capitals without U, V, W and Z.
pub const LETTERS: &str = "ABCDEFGHIJKLMNOPQRSTXY";

/// Prefix of the names of letters.
const LETTER: &str = "upper_";

/// Objects that families begin with, beside procedural ones.
const PARENTS: usize = 100;

/// Seed of the order of objects: the selection for a catalogue of fifty does not depend on the
/// seed of the trials.
const ORDER_SEED: u64 = 0;

/// Arguments of `surface-scale`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct SurfaceScale {
    /// The objects that every catalogue begins with.
    #[command(flatten)]
    #[serde(flatten)]
    pub first: ObjectSet,
    /// A folder of further meshes.
    #[arg(long, value_name = "DIR")]
    pub pool: Option<PathBuf>,
    /// A folder of letters as solids, upper_A to upper_Z.
    #[arg(long, value_name = "DIR")]
    pub letters: Option<PathBuf>,
    /// Sizes of catalogues.
    #[arg(default_values_t = [50, 100], value_delimiter = ',', value_parser = count, long = "objects")]
    #[serde(rename = "objects")]
    pub counts: Vec<usize>,
    /// Also a thousand: these objects but the letters, procedural ones, and families of both.
    /// Takes long.
    #[arg(long)]
    pub thousand: bool,
    /// Size of the largest catalogue with `--thousand`. Ten thousand take an estimated 5 GB, and
    /// hours: keep their touches (`--kept`).
    #[arg(long, default_value_t = 1_000, value_parser = count)]
    pub largest: usize,
    /// A folder that keeps the touches of the objects of `--thousand`: a run that was interrupted
    /// goes on from there, and so does one with a larger catalogue.
    #[arg(long, value_name = "DIR")]
    #[serde(skip)]
    pub kept: Option<PathBuf>,
    /// Most sessions with each catalogue of `--thousand`; without it there is one an object, and
    /// at least 500.
    #[arg(long, value_parser = count)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sessions_max: Option<usize>,
    /// Wrong sessions per number of touches whose cause is looked for (`oracle`), with the
    /// largest catalogue and with those of `--thousand` from a hundred objects on; 0 for none.
    #[arg(long, default_value_t = 0)]
    pub oracle: usize,
    /// Of these, sessions that the search did not lose and that are repeated on finer maps, which
    /// take seconds each.
    #[arg(long, default_value_t = 40)]
    pub finer: usize,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials per object.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub trials: usize,
    /// Sessions of the printed method with each catalogue, which is slow; 0 for none.
    #[arg(long, default_value_t = 20)]
    pub literal_sessions: usize,
    /// Trials per object of the largest catalogue whose touches the recogniser chooses from
    /// the third on; 0 for none.
    #[arg(long, default_value_t = 2)]
    pub chosen_trials: usize,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
    /// Readings per trial.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub readings: usize,
}

/// Objects with readings of them.
struct Touched {
    objects: Vec<TestObject>,
    train: Vec<Vec<Reading>>,
    test: Vec<Vec<Reading>>,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When there are too few objects, they cannot be loaded, or training fails.
pub fn run(config: &SurfaceScale, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let wanted = config.counts.iter().copied().max().unwrap_or(0);
    let touched = touch(config, candidates(config, wanted)?, wanted, &mut report, progress)?;
    let mut panels = Vec::new();
    for count in &config.counts {
        panels.push(one_catalogue(config, *count, &touched, &mut report, progress)?);
    }
    if config.thousand {
        let Touched { objects, train, test } = touched;
        // Memory is measured, so that only the meshes are kept.
        drop((train, test));
        let growth = Growth::up_to(config.largest);
        panels.extend(thousand::run(config, &growth, objects, &mut report, progress)?);
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// All candidate objects, in the order in which catalogues take them.
fn candidates(config: &SurfaceScale, wanted: usize) -> anyhow::Result<Vec<TestObject>> {
    let size = config.first.size();
    let is_given =
        config.first.meshes.is_some() || config.pool.is_some() || config.letters.is_some();
    if !is_given {
        let first = objects::generated(&shapes::PUBLIC_NAMES, size)?;
        let n_procedural = wanted.saturating_sub(first.len());
        return Ok(in_order(first, own::letters(size)?, own::procedural(n_procedural, size)?));
    }
    let load = |folder: &Option<PathBuf>| {
        folder.as_ref().map_or(Ok(Vec::new()), |folder| config.first.load_folder(folder))
    };
    let first = if config.first.is_named() { config.first.load()? } else { Vec::new() };
    let mut pool = load(&config.pool)?;
    pool.extend(
        objects::generated(&shapes::NAMES, size)?.into_iter().map(|object| TestObject {
            name: format!("built-in {}", object.name),
            mesh: object.mesh,
        }),
    );
    let is_taken = |object: &TestObject| {
        let symbol = object.name.strip_prefix(LETTER);
        symbol.is_some_and(|symbol| symbol.len() == 1 && LETTERS.contains(symbol))
    };
    let letters = load(&config.letters)?.into_iter().filter(is_taken).collect();
    Ok(in_order(first, pool, letters))
}

/// More than `n` objects of our own in the order in which catalogues take them, so that some may
/// be left out: the public benchmark, letters and procedural ones.
///
/// # Errors
/// When an object cannot be made.
pub(crate) fn own_objects(n: usize, size: f64) -> anyhow::Result<Vec<TestObject>> {
    let first = objects::generated(&shapes::PUBLIC_NAMES, size)?;
    Ok(in_order(first, own::letters(size)?, own::procedural(n, size)?))
}

/// A catalogue of this many objects as that of `--thousand`, with test readings and symmetries of
/// its objects: procedural ones and families, none of them letters.
///
/// # Errors
/// When an object cannot be made, or too few can be touched.
pub(crate) fn families(
    n: usize,
    seed: u64,
    touches: &TouchSet,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<learnt::Learnt> {
    let config = SurfaceScale { seed, touches: touches.clone(), ..crate::arguments::defaults() };
    let parents = candidates(&config, PARENTS)?;
    let growth = Growth::up_to(n);
    let parents = thousand::with_assembled(parents, &config, &growth)?;
    let mut objects = Families::new(parents, seed)?;
    learnt::learn(&config, &growth, &mut objects, report, progress)
}

/// The first objects, then the others in an order drawn once for all seeds.
fn in_order(
    mut first: Vec<TestObject>,
    mut rest: Vec<TestObject>,
    more: Vec<TestObject>,
) -> Vec<TestObject> {
    rest.extend(more);
    let mut stream = Stream::new(ORDER_SEED, Purpose::Shape, 0);
    while !rest.is_empty() {
        first.push(rest.swap_remove(stream.index(rest.len())));
    }
    first
}

/// Touches candidates until `wanted` are touched often enough.
fn touch(
    config: &SurfaceScale,
    candidates: Vec<TestObject>,
    wanted: usize,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<Touched> {
    let found = candidates.len();
    anyhow::ensure!(found >= wanted, "{found} objects, expected at least {wanted}");
    let mut touched = Touched { objects: Vec::new(), train: Vec::new(), test: Vec::new() };
    for object in candidates {
        if touched.objects.len() == wanted {
            break;
        }
        progress("touching objects", touched.objects.len(), wanted);
        let touch = |n: usize, seed: u64| objects::touch(&object, &config.touches.sensor, n, seed);
        let both = touch(config.touches.train_readings, 2 * config.seed).and_then(|train| {
            Ok((train, touch(config.touches.test_readings, 2 * config.seed + 1)?))
        });
        match both {
            Ok((train, test)) => {
                touched.train.push(train);
                touched.test.push(test);
                touched.objects.push(object);
            }
            Err(error) => report_left_out(report, &object, &error),
        }
    }
    let found = touched.objects.len();
    anyhow::ensure!(found == wanted, "{found} objects can be touched, expected {wanted}");
    Ok(touched)
}

/// Adds a row for an object that cannot be touched often enough.
fn report_left_out(report: &mut Report, object: &TestObject, error: &anyhow::Error) {
    report.labelled(&[("left_out", &object.name), ("because", &format!("{error:#}"))], ());
}

/// Trains and tests with the first `count` objects; returns a panel of accuracy.
fn one_catalogue(
    config: &SurfaceScale,
    count: usize,
    touched: &Touched,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<Panel> {
    let train = &touched.train[..count];
    progress("training", 0, 1);
    let symmetries = objects::symmetries(&touched.objects[..count]);
    let started = Instant::now();
    let surface = SurfaceConfig::default();
    let model = train_surface(train, &symmetries, &config.touches.sensor, &surface, config.seed)?;
    report.summarise(&format!("train_seconds_{count}"), started.elapsed().as_secs_f64());
    let sessions = Sessions {
        sensor: &config.touches.sensor,
        test: &touched.test[..count],
        symmetries: &symmetries,
        seed: config.seed,
        readings: config.readings,
        threads: 1,
        disturbance: Disturbance::None,
    };
    let is_largest = config.counts.iter().all(|other| *other <= count);
    if config.chosen_trials > 0 && is_largest {
        let objects = &touched.objects[..count];
        chosen::run(config, &model, objects, &sessions, report, progress)?;
    }
    let options = SurfaceOptions::default();
    let surface = Recogniser::Surface { model: model.clone(), options };
    let played = sessions.play(&surface, count, config.trials * count, progress)?;
    report_catalogue(report, "", count, &surface, &played);
    report_letters(report, count, &touched.objects, &played);
    report_late_wrong(report, "surface", count, &touched.objects, &played);
    if config.oracle > 0 && is_largest {
        let (train_readings, sessions) = (config.touches.train_readings, &sessions);
        let examined = Examined::new(config, train_readings, &model, sessions, &played);
        let these = |wanted: &BTreeSet<usize>| {
            Ok(wanted.iter().map(|at| (*at, touched.objects[*at].clone())).collect())
        };
        oracle::run(&examined, these, report, progress)?;
    }
    let mut lines = vec![line("surface", config.readings, &played)];
    if config.literal_sessions > 0 {
        progress("training the printed method", 0, 1);
        let (training, options) = (TrainingConfig::literal(), SvaOptions::literal());
        let literal = train_sva(train, &config.touches.sensor, &training, options, config.seed)?;
        let played = sessions.play(&literal, count, config.literal_sessions, progress)?;
        report_catalogue(report, "literal_", count, &literal, &played);
        report_late_wrong(report, "literal", count, &touched.objects, &played);
        lines.push(line("literal", config.readings, &played));
    }
    let (x, y) = ("readings".to_owned(), "share right".to_owned());
    Ok(Panel { title: format!("{count} objects"), x, y, lines })
}

fn line(name: &str, readings: usize, played: &Played) -> Line {
    let points = (1..=readings).map(|n| (n as f64, played.accuracy(n))).collect();
    Line { name: name.to_owned(), points }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    /// The built-in objects alone, touched rarely.
    fn small() -> SurfaceScale {
        SurfaceScale {
            counts: vec![4, 6],
            seed: 101,
            trials: 2,
            literal_sessions: 2,
            chosen_trials: 1,
            touches: TouchSet { train_readings: 250, test_readings: 20, ..defaults() },
            readings: 6,
            ..defaults()
        }
    }

    #[test]
    fn a_small_run_reports_every_key_of_both_catalogues() {
        let outcome = run(&small(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for count in [4, 6] {
            assert!(summary[&format!("accuracy_{count}_at_6")] > 0.8, "{summary:?}");
            for key in ["wall_ms_per_touch", "literal_bytes", "literal_trials"] {
                assert!(summary.contains_key(&format!("{key}_{count}")), "{key}");
            }
        }
        assert!((summary["trials_6"] - 12.0).abs() < 1e-9);
        assert!(summary["accuracy_6_at_6_chosen"] > 0.8, "{summary:?}");
        assert!(summary["presses_per_touch_6_chosen"] >= 1.0, "{summary:?}");
        assert!(!summary.contains_key("accuracy_4_at_6_chosen"), "the largest only");
        // No letters were given.
        assert_eq!(
            summary["others_accuracy_6_at_4"].to_bits(),
            summary["accuracy_6_at_4"].to_bits()
        );
        assert!(!summary.contains_key("letters_accuracy_6_at_4"));
        assert!(summary["bytes_4"] < summary["bytes_6"]);
        assert_eq!(outcome.plot.matches("polyline").count(), 4);
    }

    #[test]
    fn more_objects_than_there_are_is_an_error() {
        let folder = std::env::temp_dir().join(format!("palpate-scale-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let mesh = shapes::example("mug").unwrap();
        std::fs::write(folder.join("mug.stl"), mesh.to_stl_bytes()).unwrap();
        let pool = Some(folder.clone());
        let config = SurfaceScale { counts: vec![12], pool, ..small() };
        let error = run(&config, &|_, _, _| ()).err().unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(error.to_string(), "11 objects, expected at least 12");
    }

    #[test]
    fn the_letters_are_distinct_capitals() {
        let mut letters: Vec<char> = LETTERS.chars().collect();
        letters.dedup();
        assert_eq!(letters.len(), 22);
        assert!(letters.iter().all(|letter| letter.is_ascii_uppercase()));
    }
}
