//! Where to touch next: presses until the object is recognised for good, by how they are
//! chosen, on a robot that comes from outside and may miss.
//!
//! A trial is an object in a drawn pose and up to `readings` presses; trials are paired: equal
//! objects, poses, noise and first ray for every policy. A press counts one whether it touches
//! or misses, and so does one that is centred; how often the sensor went out in all is reported
//! beside it. The count is of the presses from which on the right object has 95 % or more
//! until the trial's end; a trial that never gets there counts one more than it has.

pub mod robot;
mod figures;
mod causes;

use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use glam::DVec3;
use palpate_core::log_prob::entropy_bits;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::press::PressSimulator;
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::objects::{self, TestObject};
use crate::report::{Outcome, Progress, Report};
use crate::trained::train_surface;
use figures::{plot, report_objects, report_policy, report_ratios};
use robot::{Met, Policy, Robot};

/// The probability at which an object is recognised.
const SURE: f64 = 0.95;

/// How far from the session's origin objects are placed along each axis, metres.
const PLACE: f64 = 200.0 * MM;

/// Arguments of `next-touch`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct NextTouch {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials of all objects together.
    #[arg(long, default_value_t = 300, value_parser = count)]
    pub trials: usize,
    /// Training readings per object.
    #[arg(long, default_value_t = 1_000, value_parser = count)]
    pub train_readings: usize,
    /// Most presses per trial.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub readings: usize,
    /// Report where the planner's presses are lost, beside choices that know the truth.
    #[arg(long)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub causes: bool,
}

impl NextTouch {
    /// The policies that are played.
    fn policies(&self) -> &'static [Policy] {
        if self.causes { &Policy::CAUSES } else { &Policy::ALL }
    }
}

/// One press of a trial.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Whether the right object was named.
    right: bool,
    /// Whether it had 95 % or more.
    sure: bool,
    met: Met,
    approaches: usize,
    /// The likeliest object; `None` for "none of these".
    likeliest: Option<usize>,
    /// The probability of the right object.
    truth: f64,
    /// Uncertainty about the identity, bits.
    entropy: f64,
    /// Distance of a contact from the nearest earlier one, metres.
    apart: Option<f64>,
    /// Time of the choice of this press, milliseconds.
    choice_ms: f64,
    /// Expected probability of a contact and bits on the identity.
    expected: Option<[f64; 2]>,
}

/// All trials of a policy.
struct Played {
    policy: Policy,
    /// Trials take the objects in turn.
    n_objects: usize,
    trials: Vec<Vec<Step>>,
}

impl Played {
    /// The object of a trial.
    fn object(&self, trial: usize) -> usize {
        trial % self.n_objects
    }
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, or training fails.
pub fn run(config: &NextTouch, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let objects = config.objects.load()?;
    let model = train(&objects, config, progress)?;
    let sensor = SensorDescription::digitacts_6x6();
    let simulators: Vec<PressSimulator> = objects
        .iter()
        .map(|object| PressSimulator::new(object.mesh.clone(), sensor.clone()))
        .collect();
    let policies = config.policies();
    let mut all = Vec::with_capacity(policies.len());
    for (done, policy) in policies.iter().copied().enumerate() {
        progress(policy.name(), done, policies.len());
        let play = |trial| play(config, &model, &simulators, policy, trial);
        // What is timed has a core for itself.
        let trials: anyhow::Result<Vec<_>> = match policy {
            Policy::Information if !config.causes => (0..config.trials).map(play).collect(),
            _ => (0..config.trials).into_par_iter().map(play).collect(),
        };
        all.push(Played { policy, n_objects: objects.len(), trials: trials? });
    }
    for played in &all {
        report_policy(&mut report, config, played);
        report_objects(&mut report, config, &objects, played);
    }
    report_ratios(&mut report, config, &all);
    if config.causes {
        all.iter().for_each(|played| causes::report(&mut report, &objects, played));
    }
    Ok(Outcome { report, plot: plot(config, &all), pictures: Vec::new() })
}

fn train(
    objects: &[TestObject],
    config: &NextTouch,
    progress: Progress<'_>,
) -> anyhow::Result<Arc<SurfaceModel>> {
    let sensor = SensorDescription::digitacts_6x6();
    let touch = |(done, object)| {
        progress("touching objects", done, objects.len());
        objects::touch(object, &sensor, config.train_readings, 2 * config.seed)
    };
    let readings: anyhow::Result<Vec<Vec<Reading>>> =
        objects.iter().enumerate().map(touch).collect();
    progress("training", 0, 1);
    let symmetries = objects::symmetries(objects);
    train_surface(&readings?, &symmetries, &sensor, &SurfaceConfig::default(), config.seed)
}

fn true_pose(seed: u64, trial: usize) -> Pose {
    let mut stream = Stream::new(seed, Purpose::ObjectPose, trial as u64);
    let position = DVec3::from_array([0; 3].map(|_| stream.uniform(-PLACE, PLACE)));
    Pose::from_parts(stream.rotation(), position)
}

/// Plays one trial.
fn play(
    config: &NextTouch,
    model: &Arc<SurfaceModel>,
    simulators: &[PressSimulator],
    policy: Policy,
    trial: usize,
) -> anyhow::Result<Vec<Step>> {
    let object = trial % simulators.len();
    let simulator = &simulators[object];
    let session_from_object = true_pose(config.seed, trial);
    let robot = Robot { simulator, object, session_from_object, policy, seed: config.seed, trial };
    let mut belief = SurfaceBelief::new(Arc::clone(model), SurfaceOptions::default(), None)?;
    let mut contacts: Vec<Reading> = Vec::new();
    let mut steps = Vec::with_capacity(config.readings);
    for press in 0..config.readings {
        let begun = Instant::now();
        let (approach, expected) = robot.choose(press, &belief, &contacts);
        let choice_ms = begun.elapsed().as_secs_f64() * 1e3;
        let pressed = robot.press(press, &approach);
        let mut apart = None;
        if let Some(reading) = pressed.reading {
            belief.add(&reading, simulator.sensor());
            if pressed.met == Met::Contact {
                let place = |reading: &Reading| reading.session_from_sensor().translation;
                let from = |earlier: &Reading| place(earlier).distance(place(&reading));
                apart = contacts.iter().map(from).reduce(f64::min);
                contacts.push(reading);
            }
        }
        let answer = belief.answer(0);
        let named = answer.best_object().map(|object| object.0 as usize);
        let (right, truth) = (named == Some(object), answer.probabilities[object]);
        let posterior = belief.posterior();
        let unknown = posterior[simulators.len()];
        let is_known = |named: &usize| posterior[*named] >= unknown;
        steps.push(Step {
            right,
            sure: right && truth >= SURE,
            met: pressed.met,
            approaches: pressed.approaches,
            likeliest: named.filter(is_known),
            truth,
            entropy: entropy_bits(&posterior),
            apart,
            choice_ms,
            expected: expected.map(|best| [best.contact_probability, best.identity_bits]),
        });
    }
    Ok(steps)
}

/// The presses from which on the trial is right and sure until its end.
fn touches_for_good(steps: &[Step]) -> usize {
    steps.iter().rposition(|step| !step.sure).map_or(1, |last| last + 2)
}

/// Number of approaches of the sensor until then.
fn approaches_for_good(steps: &[Step]) -> usize {
    let touches = touches_for_good(steps);
    steps.iter().take(touches).map(|step| step.approaches).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    fn step(sure: bool) -> Step {
        let (met, choice_ms) = (Met::Contact, 0.0);
        let (likeliest, truth, entropy, apart) = (None, 0.0, 0.0, None);
        Step {
            right: sure,
            sure,
            met,
            approaches: 2,
            likeliest,
            truth,
            entropy,
            apart,
            choice_ms,
            expected: None,
        }
    }

    #[test]
    fn what_was_sure_and_doubted_again_does_not_count() {
        let steps = |sure: [bool; 4]| sure.map(step).to_vec();
        assert_eq!(touches_for_good(&steps([true; 4])), 1);
        assert_eq!(touches_for_good(&steps([false, true, false, true])), 4);
        assert_eq!(touches_for_good(&steps([true, true, true, false])), 5, "never");
        assert_eq!(approaches_for_good(&steps([false, true, true, true])), 4);
    }

    #[test]
    fn information_needs_fewer_touches_than_chance() {
        let config =
            NextTouch { seed: 101, trials: 10, train_readings: 250, readings: 8, ..defaults() };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        assert!(summary["touches_ratio_to_random"] < 0.9, "{summary:?}");
        for key in ["touches_ratio_to_directed", "p99_ms", "sampler_touches_mean"] {
            assert!(summary[key] > 0.0, "{key}: {summary:?}");
        }
        assert_eq!(outcome.plot.matches("polyline").count(), 2 * Policy::ALL.len());
    }
}
