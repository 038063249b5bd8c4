//! Ten objects by the surface recogniser, beside spatially varying appearance on equal readings.
//!
//! Section 5.5.1 with the recogniser of `palpate_recogniser::belief`; in the same run the
//! service's `sva` and the printed method (`literal`, slow, hence fewer trials). Time is
//! processor time of one thread per reading, answer included, mean over all readings of the
//! trials; other load on the machine hardly affects it. Angles are taken modulo the symmetry of
//! the mesh.

use std::time::Instant;

use clap::Args;
use palpate_core::symmetry::{AxisOrder, Symmetry};
use palpate_core::units::{DEG, MM};
use palpate_dissertation::sva::SvaOptions;
use palpate_dissertation::sva::train::TrainingConfig;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use crate::arguments::{ObjectSet, TouchSet, count, millimetres};
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects::{self, TestObject};
use crate::played::{Played, PoseError, Step, report_wrong};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::{mean, median};
use crate::trained::{train_surface, train_sva};

/// Numbers of readings whose accuracy the summary states.
const STATED_AT: [usize; 6] = [1, 2, 3, 4, 6, 10];

/// Arguments of `surface-objects`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct SurfaceObjects {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Every object in each of these sizes (largest dimension in millimetres), all in one catalogue,
    /// instead of one size.
    #[arg(long, value_delimiter = ',', conflicts_with = "size_mm", value_parser = millimetres)]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sizes_mm: Vec<f64>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials per object.
    #[arg(long, default_value_t = 50, value_parser = count)]
    pub trials: usize,
    /// Trials per object of the printed method, which is slow.
    #[arg(long, default_value_t = 10)]
    pub literal_trials: usize,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
    /// Readings per trial.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub readings: usize,
}

/// A trained method and its trials.
struct Tested {
    /// Name in rows and plots.
    name: &'static str,
    /// Prefix of its keys in the summary; empty for the method that the experiment is about.
    prefix: &'static str,
    bytes: usize,
    train_seconds: f64,
    played: Played,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, or training fails.
pub fn run(config: &SurfaceObjects, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let objects = objects_of_sizes(config)?;
    let touch = |n, seed| objects::touch_all(&objects, &config.touches.sensor, n, seed, progress);
    let train = touch(config.touches.train_readings, 2 * config.seed)?;
    let test = touch(config.touches.test_readings, 2 * config.seed + 1)?;
    progress("training", 0, 1);
    let started = Instant::now();
    let symmetries = objects::symmetries(&objects);
    let surface = SurfaceConfig::default();
    let model = train_surface(&train, &symmetries, &config.touches.sensor, &surface, config.seed)?;
    let seconds = started.elapsed().as_secs_f64();
    let sessions = Sessions::undisturbed(
        &config.touches.sensor,
        &test,
        &symmetries,
        config.seed,
        config.readings,
    );
    let play = |name, prefix, recogniser: &Recogniser, trials, train_seconds| {
        let played = sessions.play(recogniser, objects.len(), trials * objects.len(), progress)?;
        anyhow::Ok(Tested { name, prefix, bytes: recogniser.bytes(), train_seconds, played })
    };
    let surface = Recogniser::Surface { model, options: SurfaceOptions::default() };
    let mut tested = vec![play("surface", "", &surface, config.trials, seconds)?];
    let literal = (TrainingConfig::literal(), SvaOptions::literal(), config.literal_trials);
    let default = (TrainingConfig::default(), SvaOptions::default(), config.trials);
    for (name, prefix, (training, options, trials)) in
        [("sva", "sva_", default), ("literal", "literal_", literal)]
    {
        if trials == 0 {
            continue;
        }
        let started = Instant::now();
        let sva = train_sva(&train, &config.touches.sensor, &training, options, config.seed)?;
        tested.push(play(name, prefix, &sva, trials, started.elapsed().as_secs_f64())?);
    }
    for method in &tested {
        report_method(&mut report, config, method);
        let late = STATED_AT.into_iter().filter(|n| (2..=config.readings).contains(n));
        let steps = late.flat_map(|readings| method.played.after(readings));
        report_wrong(&mut report, &[("method", method.name)], &objects, steps);
    }
    report_sizes(&mut report, config, &tested[0]);
    report_objects(&mut report, config, &objects, &symmetries, &tested[0]);
    Ok(Outcome { report, plot: plot(config, &tested), pictures: Vec::new() })
}

/// The objects, size after size if there are several.
fn objects_of_sizes(config: &SurfaceObjects) -> anyhow::Result<Vec<TestObject>> {
    if config.sizes_mm.is_empty() {
        return config.objects.load();
    }
    let mut all = Vec::new();
    for &size_mm in &config.sizes_mm {
        let objects = ObjectSet { size_mm, ..config.objects.clone() }.load()?;
        all.extend(objects.into_iter().map(|object| {
            let name = format!("{} {size_mm} mm", object.name);
            TestObject { name, ..object }
        }));
    }
    Ok(all)
}

/// States the accuracy and the errors of poses of each size.
fn report_sizes(report: &mut Report, config: &SurfaceObjects, method: &Tested) {
    let n_sizes = config.sizes_mm.len();
    let Some(largest) = method.played.steps.iter().map(|step| step.object).max() else { return };
    for (index, size_mm) in config.sizes_mm.iter().enumerate() {
        let is_of_size = |step: &&Step| step.object * n_sizes / (largest + 1) == index;
        for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
            let steps: Vec<&Step> = method.played.after(readings).filter(is_of_size).collect();
            let right: Vec<f64> = steps.iter().map(|step| f64::from(step.is_right())).collect();
            report.summarise(&format!("accuracy_{size_mm}_mm_at_{readings}"), mean(&right));
            let errors: Vec<f64> =
                steps.iter().filter_map(|step| Some(step.error?.translation / MM)).collect();
            let key = format!("position_error_mm_median_{size_mm}_mm_at_{readings}");
            report.summarise(&key, median(&errors));
        }
    }
}

fn report_method(report: &mut Report, config: &SurfaceObjects, method: &Tested) {
    let Tested { name, prefix, played, .. } = method;
    for readings in 1..=config.readings {
        report.labelled(&[("method", name)], played.figures(readings));
    }
    let mut state = |key: &str, value: f64| report.summarise(&format!("{prefix}{key}"), value);
    for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
        state(&format!("accuracy_at_{readings}"), played.accuracy(readings));
    }
    let last = config.readings.min(10);
    let median_of = |value: fn(&PoseError) -> f64| median(&played.errors(last, value));
    state(&format!("position_error_mm_median_at_{last}"), median_of(|e| e.translation / MM));
    state(&format!("angle_error_deg_median_at_{last}"), median_of(|e| e.angle / DEG));
    state(&format!("plain_angle_error_deg_median_at_{last}"), median_of(|e| e.plain_angle / DEG));
    if let Some(cpu_ms) = played.cpu_ms {
        state("ms_per_touch", cpu_ms);
    }
    state("wall_ms_per_touch", mean(&played.wall_ms()));
    state("catalogue_bytes", method.bytes as f64);
    state("train_seconds", method.train_seconds);
}

#[derive(Serialize)]
struct OfObject {
    readings: usize,
    position_error_mm_median: f64,
    angle_error_deg_median: f64,
    plain_angle_error_deg_median: f64,
}

/// Adds a row per object: its symmetry and the errors of its final poses.
fn report_objects(
    report: &mut Report,
    config: &SurfaceObjects,
    objects: &[TestObject],
    symmetries: &[Symmetry],
    method: &Tested,
) {
    for (index, object) in objects.iter().enumerate() {
        let steps = || method.played.after(config.readings).filter(|step| step.object == index);
        let of = |value: fn(&PoseError) -> f64| {
            median(&steps().filter_map(|step| step.error.as_ref().map(value)).collect::<Vec<_>>())
        };
        let order = |axis: &palpate_core::symmetry::SymmetryAxis| match axis.order {
            AxisOrder::Finite(order) => order.to_string(),
            AxisOrder::Continuous => "continuous".to_owned(),
        };
        let axes: Vec<String> = symmetries[index].axes.iter().map(order).collect();
        report.labelled(
            &[("method", method.name), ("object", &object.name), ("symmetry", &axes.join(" "))],
            OfObject {
                readings: config.readings,
                position_error_mm_median: of(|e| e.translation / MM),
                angle_error_deg_median: of(|e| e.angle / DEG),
                plain_angle_error_deg_median: of(|e| e.plain_angle / DEG),
            },
        );
    }
}

fn plot(config: &SurfaceObjects, tested: &[Tested]) -> String {
    let panel = |title: &str, y: &str, value: &dyn Fn(&Played, usize) -> f64| Panel {
        title: title.to_owned(),
        x: "readings".to_owned(),
        y: y.to_owned(),
        lines: tested
            .iter()
            .map(|method| Line {
                name: method.name.to_owned(),
                points: (1..=config.readings)
                    .map(|readings| (readings as f64, value(&method.played, readings)))
                    .collect(),
            })
            .collect(),
    };
    svg(&[
        panel("recognised", "share right", &|played, readings| played.accuracy(readings)),
        panel("position", "median error (mm)", &|played, readings| {
            median(&played.errors(readings, |e| e.translation / MM))
        }),
        panel("angle, modulo symmetry", "median error (deg)", &|played, readings| {
            median(&played.errors(readings, |e| e.angle / DEG))
        }),
        panel("time of a reading", "median wall time (ms)", &|played, readings| {
            median(&played.after(readings).map(|step| step.wall_ms).collect::<Vec<_>>())
        }),
    ])
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use palpate_sim::shapes;

    use super::*;
    use crate::arguments::defaults;

    /// A folder with meshes of these names.
    fn folder(of: &str, names: &[&str]) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("palpate-{of}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for name in names {
            let mesh = shapes::example(name).unwrap();
            std::fs::write(folder.join(format!("{name}.stl")), mesh.to_stl_bytes()).unwrap();
        }
        folder
    }

    #[test]
    fn objects_of_several_sizes_share_a_catalogue() {
        let folder = folder("sizes", &["hammer", "mug"]);
        let config = SurfaceObjects {
            objects: ObjectSet { meshes: Some(folder.clone()), ..defaults() },
            sizes_mm: vec![60.0, 120.0],
            seed: 101,
            trials: 2,
            literal_trials: 0,
            readings: 6,
            touches: TouchSet { train_readings: 200, test_readings: 20, ..defaults() },
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        let summary = &outcome.report.summary;
        let of_size = ["60", "120"].map(|size| summary[&format!("accuracy_{size}_mm_at_6")]);
        let mean = (of_size[0] + of_size[1]) / 2.0;
        assert!((mean - summary["accuracy_at_6"]).abs() < 1e-12 && mean > 0.7, "{summary:?}");
        assert!(!summary.keys().any(|key| key.starts_with("literal_")), "{summary:?}");
        let has_row = |name: &str| {
            outcome
                .report
                .rows
                .iter()
                .any(|row| row.get("object").is_some_and(|object| object == name))
        };
        assert!(has_row("mug 60 mm") && has_row("hammer 120 mm"));
    }

    #[test]
    fn a_small_run_on_a_folder_of_meshes_reports_every_key() {
        let folder = folder("one-size", &["hammer", "mug", "gear"]);
        let config = SurfaceObjects {
            objects: ObjectSet { meshes: Some(folder.clone()), ..defaults() },
            seed: 101,
            trials: 4,
            literal_trials: 2,
            touches: TouchSet { train_readings: 300, test_readings: 30, ..defaults() },
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        let summary = &outcome.report.summary;
        assert!(summary["accuracy_at_4"] > 0.9, "{summary:?}");
        assert!(summary["position_error_mm_median_at_10"] < 1.5, "{summary:?}");
        assert!(summary["angle_error_deg_median_at_10"] < 10.0, "{summary:?}");
        let plain = summary["plain_angle_error_deg_median_at_10"];
        assert!(plain >= summary["angle_error_deg_median_at_10"] - 1e-9, "{summary:?}");
        assert!(summary["catalogue_bytes"] < 3e6, "{summary:?}");
        for key in ["sva_accuracy_at_2", "literal_accuracy_at_2", "literal_catalogue_bytes"] {
            assert!(summary.contains_key(key), "{key}");
        }
        let trials = |name: &str| {
            let row = outcome.report.rows.iter().find(|row| row["method"] == name).unwrap();
            row["trials"].as_u64()
        };
        assert_eq!((trials("surface"), trials("literal")), (Some(12), Some(6)));
        assert_eq!(outcome.plot.matches("polyline").count(), 4 * 3);
    }
}
