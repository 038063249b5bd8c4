//! Trained from meshes, tested with sensors whose covering, stiffness or tool centre differ from
//! the description.
//!
//! Catalogues of the same objects play the same sessions in every world, with known and foreign
//! objects: trained by the sensor exactly as described, by the family of sensors that one data
//! sheet may stand for, by the wider family of an unknown sensor, and, for each world and tool
//! centre, by the sensor that commissioning found there. Worlds whose contact another engine
//! computes are left out without it: rows and the figure `worlds_left_out` say so.

mod drake;
mod method;
mod touched;
mod worlds;
mod commissioned;

use std::ops::ControlFlow;
use std::sync::Arc;

use clap::Args;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::{SensorDescription, SensorFamily};
use palpate_core::symmetry::Symmetry;
use palpate_core::units::MM;
use palpate_recogniser::belief::calibrate::{self, HeldBack, calibrate};
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::SamplerConfig;
use palpate_sim::sampler::family::{sample_family, sample_runs};
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::disturbance::Disturbance;
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects::{self, TestObject};
use crate::played::Played;
use crate::report::{Outcome, Progress, Report};
use crate::stated::auroc;
use crate::statistics::median;
use crate::trained::train_surface;
use commissioned::Commissioned;
pub use drake::Drake;
pub use method::Method;
use worlds::World;

/// Numbers of readings whose figures the summary states.
const STATED_AT: [usize; 6] = [2, 3, 4, 6, 8, 10];

/// Arguments of `other-worlds`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct OtherWorlds {
    /// The objects of the catalogue.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Sessions per object in each world.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub trials: usize,
    /// A catalogue of this many objects of our own instead: the public benchmark, letters as
    /// solids, and procedural ones, as in `surface-scale`. A hundred take minutes of each world.
    #[arg(long, value_parser = count)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub own: Option<usize>,
    /// Objects that are touched but not in the catalogue.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub foreign: usize,
    /// Training readings per object.
    #[arg(long, default_value_t = 1_000, value_parser = count)]
    pub train_readings: usize,
    /// Test readings per object in each world.
    #[arg(long, default_value_t = 60, value_parser = count)]
    pub test_readings: usize,
    /// Readings per session.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub readings: usize,
    /// Errors of the tool centre, millimetres, beside none.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3")]
    pub tool_mm: Vec<f64>,
    /// Worlds to test in; all unless given.
    #[arg(long, value_delimiter = ',')]
    pub worlds: Vec<String>,
    /// How catalogues are trained.
    #[arg(
        long,
        value_delimiter = ',',
        value_enum,
        default_value = "as_described,data_sheet,commissioned"
    )]
    pub methods: Vec<Method>,
    /// The engine of two worlds. It is no part of the figures.
    #[command(flatten)]
    #[serde(flatten)]
    pub drake: Drake,
}

/// A catalogue for all worlds; `None` when each world has its own.
struct Trained {
    method: Method,
    recogniser: Option<Recogniser>,
}

/// Sessions of one method in one world.
struct Tried {
    method: Method,
    world: String,
    tool_mm: f64,
    known: Played,
    foreign: Played,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, or training fails.
pub fn run(config: &OtherWorlds, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let described = SensorDescription::digitacts_6x6();
    let (objects, foreign) = (touched::known(config, &described)?, touched::foreign(config)?);
    let wanted = worlds::wanted(&described, &config.worlds, &config.drake)?;
    for (world, reason) in &wanted.left_out {
        progress(&format!("{world} is left out: {reason}"), 0, 1);
    }
    let symmetries = objects::symmetries(&objects);
    let mut trained = Vec::new();
    for method in config.methods.iter().copied() {
        let train = |knowledge| {
            progress(method.name(), 0, 1);
            let family = SensorFamily::new(described.clone(), knowledge);
            train(config, &objects, &symmetries, &family)
        };
        let recogniser = method.knowledge().map(train).transpose()?;
        trained.push(Trained { method, recogniser });
    }
    let mut tried = Vec::new();
    for (done, world) in wanted.played.iter().enumerate() {
        progress("worlds", done, wanted.played.len());
        tried.extend(try_in(config, world, &objects, &foreign, &symmetries, &described, &trained)?);
    }
    let mut report = Report::default();
    for (world, reason) in &wanted.left_out {
        report.labelled(&[("world", world), ("left_out", reason)], ());
    }
    report.summarise("worlds_left_out", wanted.left_out.len() as f64);
    for one in &tried {
        report_one(&mut report, config, one);
    }
    for method in &trained {
        report_worst(&mut report, config, method.method, &tried);
    }
    Ok(Outcome { report, plot: svg(&panels(config, &tried)), pictures: Vec::new() })
}

/// A recogniser of all objects, trained by simulated presses of a family of sensors and
/// calibrated.
fn train(
    config: &OtherWorlds,
    objects: &[TestObject],
    symmetries: &[Symmetry],
    family: &SensorFamily,
) -> anyhow::Result<Recogniser> {
    let runs = calibrate::TRIALS.div_ceil(objects.len());
    let touched = |object: &TestObject| -> anyhow::Result<(Vec<Reading>, Vec<Reading>)> {
        let sensor = family.description().clone();
        let simulator = PressSimulator::new(object.mesh.clone(), sensor);
        let (sampler, seed, id) =
            (SamplerConfig::for_simulator(&simulator), 2 * config.seed, SensorId(0));
        let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
        let n = config.train_readings;
        let readings = sample_family(&simulator, family, id, n, seed, &sampler, &mut go_on)?;
        let runs = (runs, calibrate::READINGS);
        let held_back = sample_runs(&simulator, family, id, runs, seed, &sampler, &mut go_on)?;
        Ok((readings, held_back))
    };
    let both: Vec<(Vec<Reading>, Vec<Reading>)> =
        objects.par_iter().map(touched).collect::<anyhow::Result<_>>()?;
    let (training, held_back): (Vec<_>, Vec<_>) = both.into_iter().unzip();
    let sensor = family.description();
    let model =
        train_surface(&training, symmetries, sensor, &SurfaceConfig::default(), config.seed)?;
    let run = Some(calibrate::READINGS);
    let sets: Vec<HeldBack<'_>> =
        held_back.iter().map(|readings| HeldBack { readings, sensor, run }).collect();
    let calibration = calibrate(&model, &sets, SurfaceOptions::default(), config.seed);
    let model = Arc::new(Arc::unwrap_or_clone(model).with_calibration(calibration));
    Ok(Recogniser::Surface { model, options: SurfaceOptions::default() })
}

/// Plays the sessions of one world with every method and every error of the tool centre.
fn try_in(
    config: &OtherWorlds,
    world: &World,
    objects: &[TestObject],
    foreign: &[TestObject],
    symmetries: &[Symmetry],
    described: &SensorDescription,
    trained: &[Trained],
) -> anyhow::Result<Vec<Tried>> {
    let (n, seed) = (config.test_readings, 2 * config.seed + 1);
    let known = world.touch_all(&config.drake, objects, n, seed)?;
    let others = world.touch_all(&config.drake, foreign, n, seed)?;
    let is_commissioned = trained.iter().any(|one| one.recogniser.is_none());
    let body = is_commissioned.then(|| commissioned::touches(world, &config.drake, seed));
    let body = body.transpose()?.unwrap_or_default();
    let none = vec![Symmetry::NONE; foreign.len()];
    let tools = std::iter::once(0.0).chain(config.tool_mm.iter().copied());
    let cases: Vec<(f64, &Trained)> =
        tools.flat_map(|tool| trained.iter().map(move |one| (tool, one))).collect();
    let play = |(tool_mm, trained): &(f64, &Trained)| {
        let (method, offset) = (trained.method, tool_mm * MM);
        let play = |recogniser: &Recogniser, sensor, known: &[_], others: &[_], disturbance| {
            let sessions = |test, symmetries| Sessions {
                sensor,
                test,
                symmetries,
                seed: config.seed,
                readings: config.readings,
                threads: 1,
                disturbance,
            };
            let silent: Progress<'_> = &|_, _, _| ();
            let trials = config.trials * objects.len();
            let known = sessions(known, symmetries);
            let known = known.play(recogniser, objects.len(), trials, silent)?;
            let others = sessions(others, &none);
            let foreign = others.play(recogniser, foreign.len(), trials, silent)?;
            Ok(Tried { method, world: world.name.to_owned(), tool_mm: *tool_mm, known, foreign })
        };
        if let Some(recogniser) = &trained.recogniser {
            let tool = Disturbance::Tool { offset };
            return play(recogniser, described, &known, &others, tool);
        }
        let sensor = Commissioned::new(described, &body, offset, seed)?;
        let recogniser = train(config, objects, symmetries, &sensor.family())?;
        let (known, others) = (sensor.corrected(&known)?, sensor.corrected(&others)?);
        play(&recogniser, &sensor.measured, &known, &others, Disturbance::None)
    };
    cases.par_iter().map(play).collect()
}

/// The figures of one method in one world after some number of readings.
#[derive(Serialize)]
struct Row {
    tool_mm: f64,
    readings: usize,
    sessions: usize,
    accuracy: f64,
    unknown_mean: f64,
    foreign_unknown_mean: f64,
    auroc: f64,
    position_error_mm_median: f64,
}

impl Tried {
    fn row(&self, readings: usize) -> Row {
        let scored = |played: &Played, is_foreign| -> Vec<(f64, bool)> {
            played.after(readings).map(|step| (step.unknown, is_foreign)).collect()
        };
        let both = [scored(&self.known, false), scored(&self.foreign, true)].concat();
        Row {
            tool_mm: self.tool_mm,
            readings,
            sessions: self.known.after(readings).count(),
            accuracy: self.known.accuracy(readings),
            unknown_mean: self.known.unknown(readings),
            foreign_unknown_mean: self.foreign.unknown(readings),
            auroc: auroc(&both),
            position_error_mm_median: median(&self.known.errors(readings, |e| e.translation / MM)),
        }
    }
}

fn report_one(report: &mut Report, config: &OtherWorlds, one: &Tried) {
    for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
        let labels = [("world", one.world.as_str()), ("method", one.method.name())];
        report.labelled(&labels, one.row(readings));
    }
}

/// The worst world of a method, with a right tool centre and with each wrong one.
fn report_worst(report: &mut Report, config: &OtherWorlds, method: Method, tried: &[Tried]) {
    let is_data_sheet = method == Method::DataSheet;
    let prefix = if is_data_sheet { String::new() } else { format!("{}_", method.name()) };
    // The aims for commissioned sensors have shorter names.
    let of = if method == Method::Commissioned { "worst" } else { "worst_world" };
    let tools = std::iter::once(0.0).chain(config.tool_mm.iter().copied());
    for tool_mm in tools {
        let of_tool = |one: &&Tried| one.method == method && (one.tool_mm - tool_mm).abs() < 1e-9;
        let infix = if tool_mm > 0.0 { format!("tool_{tool_mm}_mm_") } else { String::new() };
        for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
            let rows: Vec<Row> = tried.iter().filter(of_tool).map(|o| o.row(readings)).collect();
            let mut state = |key: &str, values: &dyn Fn(&Row) -> f64, is_high_bad: bool| {
                let values = rows.iter().map(values);
                let worst = if is_high_bad {
                    values.fold(f64::NEG_INFINITY, f64::max)
                } else {
                    values.fold(f64::INFINITY, f64::min)
                };
                report.summarise(&format!("{prefix}{infix}{of}_{key}_at_{readings}"), worst);
            };
            state("accuracy", &|row| row.accuracy, false);
            state("unknown", &|row| row.unknown_mean, true);
            state("auroc", &|row| row.auroc, false);
            state("position_error_mm", &|row| row.position_error_mm_median, true);
        }
    }
    for one in tried.iter().filter(|one| one.method == method && one.world == "matched") {
        for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
            if one.tool_mm < 1e-9 {
                let key = format!("{prefix}matched_accuracy_at_{readings}");
                report.summarise(&key, one.known.accuracy(readings));
            }
        }
    }
}

fn panels(config: &OtherWorlds, tried: &[Tried]) -> Vec<Panel> {
    let panel = |title: String, y: &str, method: Method, value: &dyn Fn(&Row) -> f64| {
        let of = |one: &&Tried| one.method == method && one.tool_mm < 1e-9;
        let line = |one: &Tried| Line {
            name: one.world.replace('_', " "),
            points: (1..=config.readings).map(|n| (n as f64, value(&one.row(n)))).collect(),
        };
        let lines = tried.iter().filter(of).map(line).collect();
        Panel { title, x: "readings".to_owned(), y: y.to_owned(), lines }
    };
    let of_method = |method: &Method| {
        let name = method.name().replace('_', " ");
        let none = format!("{name}: none of these");
        [
            panel(format!("{name}: right"), "share", *method, &|row| row.accuracy),
            panel(none, "mean probability", *method, &|row| row.unknown_mean),
        ]
    };
    config.methods.iter().flat_map(of_method).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_states_the_worst_world() {
        let config = OtherWorlds {
            seed: 101,
            trials: 1,
            foreign: 3,
            train_readings: 200,
            test_readings: 8,
            readings: 4,
            tool_mm: vec![2.0],
            worlds: vec!["matched".to_owned(), "ends_normalised".to_owned()],
            methods: vec![Method::AsDescribed, Method::DataSheet],
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for key in [
            "worst_world_accuracy_at_4",
            "as_described_worst_world_unknown_at_4",
            "tool_2_mm_worst_world_auroc_at_4",
            "matched_accuracy_at_4",
        ] {
            assert!(summary.contains_key(key), "{key}: {summary:?}");
        }
        assert!(summary["as_described_matched_accuracy_at_4"] >= 0.7, "{summary:?}");
        let wrong = OtherWorlds { worlds: vec!["matched".to_owned(), "moon".to_owned()], ..config };
        assert!(run(&wrong, &|_, _, _| ()).err().unwrap().to_string().contains("moon"));
    }
}
