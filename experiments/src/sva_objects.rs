//! Section 5.5.1 again: ten objects by spatially varying appearance, literal and default.
//!
//! Methods see the same readings: the service's default, the same without the refinement of
//! poses (`unrefined`), the default with the printed distance range of 30–160 mm
//! (`printed_range`), the printed filter on the service's patches (`literal`, as in a session of
//! `sva_literal`), and on request the printed filter on printed patches (`as_printed`, see
//! `printed_sva`). Each object is touched 1,000 times for training and 100 times for testing. A
//! trial draws a pose (any rotation, ±200 mm along each axis) and presents test readings in
//! random order; after each one both methods answer. Errors of pose count only when the identity
//! is right, as in the dissertation; angles are plain, not modulo symmetry. The inertial error
//! takes the mesh as a solid of uniform density.

mod figures;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use clap::Args;
use palpate_core::metric::Inertia;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::training::TrainingSet;
use palpate_core::units::{DEG, MM};
use palpate_dissertation::sva::model::SvaModel;
use palpate_dissertation::sva::train::{TrainingConfig, learn_vocabulary, map_object};
use palpate_dissertation::sva::{MatchPriors, SvaBelief, SvaOptions};
use palpate_sim::plot::svg;
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, TouchSet, count};
use crate::coverage;
use crate::objects::{self, TestObject};
use crate::printed_sva::{Printed, PrintedForm};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::{mean, median, quantile, standard_error_over_groups};
use figures::{panel, report_confusions};

/// Arguments of `sva-objects`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct SvaObjects {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials per object.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub trials: usize,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
    /// Readings per trial.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub readings: usize,
    /// Add the printed filter on features and patches as printed: plain inner products,
    /// the mask before the turn, all classes, patches at the sensor's centroid.
    #[arg(long)]
    pub as_printed: bool,
    /// Add the default and the printed filter with counted priors of classes, of distances, and of
    /// both (section 5.3.5).
    #[arg(long)]
    pub counted_priors: bool,
}

/// A trained method.
struct Method {
    name: &'static str,
    catalogue: Arc<SvaModel>,
    options: SvaOptions,
    train_seconds: f64,
    /// Features and patches as printed instead of the service's.
    printed: Option<Printed>,
}

/// A method's answer after one reading of one trial.
struct Step {
    method: usize,
    object: usize,
    trial: usize,
    readings: usize,
    named: usize,
    probability: f64,
    error: Option<PoseError>,
    seconds: f64,
}

#[derive(Clone, Copy)]
struct PoseError {
    translation: f64,
    angle: f64,
    inertial: f64,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, or training fails.
pub fn run(config: &SvaObjects, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let objects = config.objects.load()?;
    let started = Instant::now();
    let touch = |n, seed| objects::touch_all(&objects, &config.touches.sensor, n, seed, progress);
    let train = touch(config.touches.train_readings, 2 * config.seed)?;
    let touch_seconds = started.elapsed().as_secs_f64();
    let test = touch(config.touches.test_readings, 2 * config.seed + 1)?;
    let (ours, printed) = (TrainingConfig::default(), TrainingConfig::literal());
    let unrefined = SvaOptions { refinement: None, ..SvaOptions::default() };
    let mut methods = vec![
        train_method("default", &train, config, ours, SvaOptions::default())?,
        train_method("unrefined", &train, config, ours, unrefined)?,
        train_method("printed_range", &train, config, printed, SvaOptions::default())?,
        train_method("literal", &train, config, printed, SvaOptions::literal())?,
    ];
    if config.as_printed {
        methods.push(train_printed(&mut report, &train, config)?);
    }
    if config.counted_priors {
        with_counted_priors(&mut methods);
    }
    let steps = run_trials(config, &objects, &test, &methods, progress)?;
    for (index, method) in methods.iter().enumerate() {
        report_method(&mut report, config, index, method, &steps);
    }
    report_confusions(&mut report, config, &objects, &methods, &steps);
    let coverage = coverage::pictures(&mut report, &objects, &train);

    let n_readings: usize = train.iter().map(Vec::len).sum();
    let threads = rayon::current_num_threads() as f64;
    let rate = n_readings as f64 / touch_seconds / threads;
    report.summarise("converged_readings_per_second_and_core", rate);
    let panels = [
        panel(config, &methods, &steps, "recognised", "share right", |right, _| mean(right)),
        panel(config, &methods, &steps, "position", "median error (mm)", |_, errors| {
            median(&errors.iter().map(|e| e.translation / MM).collect::<Vec<_>>())
        }),
        panel(config, &methods, &steps, "inertial", "mean error (mm)", |_, errors| {
            mean(&errors.iter().map(|e| e.inertial / MM).collect::<Vec<_>>())
        }),
        panel(config, &methods, &steps, "angle", "mean error (deg)", |_, errors| {
            mean(&errors.iter().map(|e| e.angle / DEG).collect::<Vec<_>>())
        }),
    ];
    Ok(Outcome { report, plot: svg(&panels), pictures: coverage })
}

fn train_method(
    name: &'static str,
    readings: &[Vec<Reading>],
    config: &SvaObjects,
    training: TrainingConfig,
    options: SvaOptions,
) -> anyhow::Result<Method> {
    let started = Instant::now();
    let sets: Vec<TrainingSet<'_>> = readings
        .iter()
        .map(|readings| TrainingSet { readings, sensor: &config.touches.sensor })
        .collect();
    let vocabulary = learn_vocabulary(&sets, &training, config.seed)?;
    // The meshes' centroids are their origins already.
    let origin = Some(glam::DVec3::ZERO);
    let maps: Result<Vec<_>, _> = sets
        .par_iter()
        .map(|set| map_object(set, &vocabulary, &training, origin).map(Arc::new))
        .collect();
    let catalogue = SvaModel { vocabulary, association: training.association, objects: maps? };
    let train_seconds = started.elapsed().as_secs_f64();
    Ok(Method { name, catalogue: Arc::new(catalogue), options, train_seconds, printed: None })
}

/// The default and the printed filter, each with three more sets of priors, on the same maps.
fn with_counted_priors(methods: &mut Vec<Method>) {
    for (base, named) in [
        ("default", ["class_priors", "distance_priors", "both_priors"]),
        ("literal", ["literal_class_priors", "literal_distance_priors", "literal_both_priors"]),
    ] {
        let Some(at) = methods.iter().position(|method| method.name == base) else { continue };
        let kinds =
            [MatchPriors::Classes, MatchPriors::Distances, MatchPriors::ClassesAndDistances];
        for (name, priors) in named.into_iter().zip(kinds) {
            let method = &methods[at];
            let (catalogue, train_seconds) = (method.catalogue.clone(), method.train_seconds);
            let options = SvaOptions { priors, ..method.options };
            methods.push(Method { name, catalogue, options, train_seconds, printed: None });
        }
    }
}

/// The printed filter on features and patches as printed.
fn train_printed(
    report: &mut Report,
    readings: &[Vec<Reading>],
    config: &SvaObjects,
) -> anyhow::Result<Method> {
    let started = Instant::now();
    let sensor = &config.touches.sensor;
    let printed = Printed::learn(readings, sensor, PrintedForm::objects(), config.seed)?;
    let (catalogue, classes_kept) = printed.catalogue(readings, sensor)?;
    report.summarise("as_printed_classes_kept_mean", classes_kept);
    Ok(Method {
        name: "as_printed",
        catalogue: Arc::new(catalogue),
        options: SvaOptions::literal(),
        train_seconds: started.elapsed().as_secs_f64(),
        printed: Some(printed),
    })
}

fn run_trials(
    config: &SvaObjects,
    objects: &[TestObject],
    test: &[Vec<Reading>],
    methods: &[Method],
    progress: Progress<'_>,
) -> anyhow::Result<Vec<Step>> {
    let done = AtomicUsize::new(0);
    let inertias: Vec<Inertia> = objects.iter().map(|object| object.mesh.inertia()).collect();
    let trials: Vec<(usize, usize)> = (0..objects.len())
        .flat_map(|object| (0..config.trials).map(move |trial| (object, trial)))
        .collect();
    let per_trial: anyhow::Result<Vec<Vec<Step>>> = trials
        .par_iter()
        .map(|(object, trial)| {
            progress("trials", done.fetch_add(1, Ordering::Relaxed), trials.len());
            run_trial(config, (*object, *trial), &test[*object], &inertias[*object], methods)
        })
        .collect();
    Ok(per_trial?.into_iter().flatten().collect())
}

fn run_trial(
    config: &SvaObjects,
    (object, trial): (usize, usize),
    test: &[Reading],
    inertia: &Inertia,
    methods: &[Method],
) -> anyhow::Result<Vec<Step>> {
    let index = (object * config.trials + trial) as u64;
    let mut poses = Stream::new(config.seed, Purpose::ObjectPose, index);
    let reach = 200.0 * MM;
    let position = glam::DVec3::from_array([0; 3].map(|_| poses.uniform(-reach, reach)));
    let session_from_object = Pose::from_parts(poses.rotation(), position);
    let mut choice = Stream::new(config.seed, Purpose::ReadingChoice, index);
    let readings: Vec<Reading> = (0..config.readings)
        .map(|_| test[choice.index(test.len())].moved_by(session_from_object))
        .collect();

    let mut steps = Vec::new();
    for (method_index, method) in methods.iter().enumerate() {
        let mut belief = SvaBelief::new(method.catalogue.clone(), method.options, None)?;
        for (n, reading) in readings.iter().enumerate() {
            let started = Instant::now();
            match &method.printed {
                None => belief.add(reading, &config.touches.sensor)?,
                Some(printed) => {
                    printed.patch(reading, &config.touches.sensor).into_iter().for_each(|patch| {
                        belief.add_patch(patch);
                    });
                }
            }
            let answer = belief.answer(8);
            let seconds = started.elapsed().as_secs_f64();
            let named = answer.best_object().unwrap_or(ObjectIdx(0)).0 as usize;
            let mode = answer.modes.iter().find(|mode| mode.object.0 as usize == object);
            let error = mode.filter(|_| named == object).map(|mode| {
                let found = mode.session_from_object;
                PoseError {
                    translation: found.distance_to(&session_from_object),
                    angle: found.angle_to(&session_from_object),
                    inertial: inertia.distance(&found, &session_from_object),
                }
            });
            let probability = answer.probabilities[named];
            let readings = n + 1;
            let method = method_index;
            let step = Step { method, object, trial, readings, named, probability, error, seconds };
            steps.push(step);
        }
    }
    Ok(steps)
}

/// Figure 5.3 (b): the inertial distance of a solid sphere of 40 mm, which every object counts as.
fn sphere_distance(error: &PoseError) -> f64 {
    let radius = 40.0 * MM;
    let turned = 0.8 * radius * radius * (1.0 - error.angle.cos());
    (error.translation.powi(2) + turned).sqrt()
}

/// Whether each trial was right, and the pose errors of those that were.
fn at(steps: &[Step], method: usize, readings: usize) -> (Vec<f64>, Vec<PoseError>) {
    let chosen = || steps.iter().filter(|s| s.method == method && s.readings == readings);
    let right = chosen().map(|s| f64::from(u8::from(s.named == s.object))).collect();
    (right, chosen().filter_map(|s| s.error).collect())
}

#[derive(Serialize)]
struct AfterReadings {
    readings: usize,
    accuracy: f64,
    stated_probability_mean: f64,
    position_error_mm_mean: f64,
    position_error_mm_median: f64,
    angle_error_deg_mean: f64,
    angle_error_deg_median: f64,
    inertial_error_mm_mean: f64,
    ms_median: f64,
    ms_p90: f64,
}

fn report_method(
    report: &mut Report,
    config: &SvaObjects,
    index: usize,
    method: &Method,
    steps: &[Step],
) {
    for readings in 1..=config.readings {
        let (right, errors) = at(steps, index, readings);
        let of = |value: fn(&PoseError) -> f64| errors.iter().map(value).collect::<Vec<f64>>();
        let (moved, turned, inertial) =
            (of(|e| e.translation / MM), of(|e| e.angle / DEG), of(|e| e.inertial / MM));
        let times: Vec<f64> = steps
            .iter()
            .filter(|s| s.method == index && s.readings == readings)
            .map(|s| s.seconds * 1e3)
            .collect();
        let stated: Vec<f64> = steps
            .iter()
            .filter(|s| s.method == index && s.readings == readings)
            .map(|s| s.probability)
            .collect();
        report.labelled(
            &[("method", method.name)],
            AfterReadings {
                readings,
                accuracy: mean(&right),
                stated_probability_mean: mean(&stated),
                position_error_mm_mean: mean(&moved),
                position_error_mm_median: median(&moved),
                angle_error_deg_mean: mean(&turned),
                angle_error_deg_median: median(&turned),
                inertial_error_mm_mean: mean(&inertial),
                ms_median: median(&times),
                ms_p90: quantile(&times, 0.9),
            },
        );
    }
    let prefix = if method.name == "default" { String::new() } else { format!("{}_", method.name) };
    for readings in [2, 3, 4, 6, 8, 10, 12, 20] {
        let (right, errors) = at(steps, index, readings);
        if right.is_empty() {
            continue;
        }
        report.summarise(&format!("{prefix}accuracy_at_{readings}"), mean(&right));
        let by_object = steps.iter().filter(|s| s.method == index && s.readings == readings);
        let by_object =
            by_object.map(|s| (s.object as u64, f64::from(u8::from(s.named == s.object))));
        report.summarise(
            &format!("{prefix}standard_error_at_{readings}"),
            standard_error_over_groups(by_object),
        );
        if [10, 20].contains(&readings) {
            let moved: Vec<f64> = errors.iter().map(|e| e.translation / MM).collect();
            report.summarise(
                &format!("{prefix}position_error_mm_median_at_{readings}"),
                median(&moved),
            );
            let sphere: Vec<f64> = errors.iter().map(|e| sphere_distance(e) / MM).collect();
            report.summarise(
                &format!("{prefix}sphere_inertial_error_mm_mean_at_{readings}"),
                mean(&sphere),
            );
        }
    }
    let bytes: usize = method.catalogue.objects.iter().map(|o| o.index().bytes()).sum();
    report.summarise(&format!("{prefix}index_bytes"), bytes as f64);
    report.summarise(&format!("{prefix}train_seconds"), method.train_seconds);
}

#[cfg(test)]
mod tests;
