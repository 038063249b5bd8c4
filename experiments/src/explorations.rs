//! Readings of blind explorations and trials on them, shared by figures 4.11 to 4.13.
//!
//! Objects are trained with the sampler of section 4.4.1.2 (`object_trials`) and tested with the
//! readings of the planner of section 4.2. Every run of the planner has its own place of the
//! object, course and noise, the same for all strategies and sensors.

use std::ops::ControlFlow;

use clap::Args;
use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_dissertation::appearance::model::{AppearanceModel, AppearanceRule};
use palpate_sim::controller::RecenterConfig;
use palpate_sim::explore::{
    Exploration, ExploreConfig, Perturbation, PressAgain, Touch, covered_share, explore,
};
use palpate_sim::press::{PressConfig, PressSimulator};
use rayon::prelude::*;
use serde::Serialize;

use crate::appearance_trials::{Evidence, Point, accuracy_at, mean_of};
use crate::arguments::count;
use crate::object_trials::{ObjectTrials, Setting};
use crate::objects::TestObject;
use crate::report::Report;
use crate::statistics::mean;

/// Counts of readings after which accuracy is measured.
pub const COUNTS: [usize; 15] = [1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 40, 50, 60, 80, 100];

/// Counts that the summary states.
const STATED_AT: [usize; 5] = [5, 10, 20, 60, 100];

/// Maximum distance of the object's centre from that of the arm's workspace along each axis.
const PLACE_MAX: f64 = 20.0 * MM;

/// A point of the surface counts as touched when a reading is this near.
const COVERED_WITHIN: f64 = 10.0 * MM;

/// Number of links of the arm.
const N_LINKS: usize = 8;

/// Arguments of `exploration` and `perturbation`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct ExplorationTrials {
    /// Objects and training. The test readings are those of the sampler.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectTrials,
    /// Explorations per object, of 100 readings each.
    #[arg(long, default_value_t = 3, value_parser = count)]
    pub runs: usize,
}

/// A strategy of exploration.
#[derive(Clone, Debug)]
pub struct Strategy {
    /// Name in rows and plots.
    pub name: String,
    /// Part of the summary's keys.
    pub key: String,
    /// The probability L of the local strategy.
    pub local: f64,
    /// Whether the arm presses every contact, as printed, instead of moving on from places that
    /// it has pressed.
    pub as_printed: bool,
    /// Whether contacts that rest weakly are centred and pressed again.
    pub centred: bool,
    /// Whether the object moves after each reading, by up to the amounts of section 4.4.2.4.
    pub perturb: bool,
}

impl Strategy {
    /// The printed strategy: it presses each place that it meets, also one that it has pressed before.
    #[must_use]
    pub fn printed(local: f64) -> Self {
        let key = format!("l{local}").replace('.', "_");
        let (name, perturb) = (format!("L = {local}"), false);
        Self { name, key, local, as_printed: true, centred: false, perturb }
    }

    /// Rarely presses where it has pressed before.
    #[must_use]
    pub fn moving_on(local: f64) -> Self {
        let printed = Self::printed(local);
        let (name, key) = (format!("{}, moves on", printed.name), printed.key + "_moves_on");
        Self { name, key, as_printed: false, ..printed }
    }

    /// Moves on, and centres contacts that rest weakly.
    #[must_use]
    pub fn centring(local: f64) -> Self {
        let moving = Self::moving_on(local);
        let (name, key) = (format!("{}, centres", moving.name), moving.key + "_centres");
        Self { name, key, centred: true, ..moving }
    }
}

/// One exploration of every object.
pub struct Run {
    pub(crate) simulators: Vec<PressSimulator>,
    pub(crate) explorations: Vec<Exploration>,
}

impl Run {
    /// The readings, one list an object.
    #[must_use]
    pub fn readings(&self) -> Vec<Vec<Reading>> {
        let of = |found: &Exploration| -> Vec<Reading> {
            found.touches.iter().map(|touch| touch.reading.clone()).collect()
        };
        self.explorations.iter().map(of).collect()
    }

    /// Share of the surface that `n` readings touch, mean over the objects.
    fn covered_share(&self, n: usize) -> f64 {
        let shares = self.simulators.iter().zip(&self.explorations).map(|(simulator, found)| {
            let places: Vec<DVec3> =
                found.touches.iter().take(n).map(|touch| touch.place_in_object()).collect();
            covered_share(simulator, &places, COVERED_WITHIN)
        });
        mean(&shares.collect::<Vec<_>>())
    }

    /// One-sidedness of the readings: length of the sensor's mean viewing direction in the arm's
    /// frame, 1 when all directions are equal.
    fn one_sidedness(&self) -> f64 {
        let lengths = self.explorations.iter().map(|found| {
            let facing = |touch: &Touch| touch.reading.session_from_sensor().turn(DVec3::Z);
            let sum: DVec3 = found.touches.iter().map(facing).sum();
            sum.length() / found.touches.len().max(1) as f64
        });
        mean(&lengths.collect::<Vec<_>>())
    }

    /// Steps of the planner per reading.
    fn steps_per_reading(&self) -> f64 {
        let of = |found: &Exploration| {
            found.statistics.iterations as f64 / found.statistics.readings.max(1) as f64
        };
        mean(&self.explorations.iter().map(of).collect::<Vec<_>>())
    }

    /// Share of the contacts that the controllers or the arm abandoned.
    fn given_up_share(&self) -> f64 {
        let of = |found: &Exploration| {
            let lost = found.statistics.rejected + found.statistics.unreachable;
            lost as f64 / found.statistics.contacts.max(1) as f64
        };
        mean(&self.explorations.iter().map(of).collect::<Vec<_>>())
    }
}

impl ExplorationTrials {
    /// Explores every object `runs` times.
    ///
    /// # Errors
    /// When the planner does not obtain enough readings.
    pub fn explore(
        &self,
        objects: &[TestObject],
        setting: &Setting,
        strategy: &Strategy,
    ) -> anyhow::Result<Vec<Run>> {
        (0..self.runs).map(|run| self.run(objects, setting, strategy, run)).collect()
    }

    fn run(
        &self,
        objects: &[TestObject],
        setting: &Setting,
        strategy: &Strategy,
        run: usize,
    ) -> anyhow::Result<Run> {
        let press = PressConfig {
            noise_level: setting.noise_level,
            ..PressConfig::for_sensor(&setting.sensor)
        };
        let explored = objects.par_iter().enumerate().map(|(object_idx, object)| {
            let (mesh, sensor) = (object.mesh.clone(), setting.sensor.clone());
            let simulator = PressSimulator::with_config(mesh, sensor, press);
            let seed = self.objects.seed + ((run * objects.len() + object_idx) as u64) * 1_000_000;
            let usual = ExploreConfig::for_simulator(&simulator, N_LINKS);
            let moves_on = usual.press_again;
            let config = ExploreConfig {
                local: strategy.local,
                perturbation: strategy.perturb.then(|| Perturbation::printed(simulator.mesh())),
                press_again: if strategy.as_printed { PressAgain::AsPrinted } else { moves_on },
                touch: if strategy.centred {
                    RecenterConfig::for_sensor(&setting.sensor, setting.noise_level)
                } else {
                    usual.touch
                },
                ..usual
            };
            let n = self.objects.test_readings;
            let mut go_on = |_: &_, _: Option<&_>| ControlFlow::Continue(());
            let found = explore(&simulator, place(&simulator, seed), n, seed, &config, &mut go_on)?;
            let n_found = found.touches.len();
            anyhow::ensure!(n_found == n, "only {n_found} of {n} readings of {}", object.name);
            Ok((simulator, found))
        });
        let (simulators, explorations) =
            explored.collect::<anyhow::Result<Vec<_>>>()?.into_iter().unzip();
        Ok(Run { simulators, explorations })
    }

    /// Curves of a model on explorations: on readings drawn from each exploration, as in the
    /// dissertation's figures, and on readings in the order in which they were taken.
    #[must_use]
    pub fn curves(&self, model: &AppearanceModel, setting: &Setting, runs: &[Run]) -> Curves {
        self.weighed_curves(model, setting, runs, |_| 1.0)
    }

    /// Curves as by [`ExplorationTrials::curves`], with a weight for each reading.
    pub fn weighed_curves(
        &self,
        model: &AppearanceModel,
        setting: &Setting,
        runs: &[Run],
        weight: impl Fn(&Reading) -> f64 + Sync,
    ) -> Curves {
        let of = |(run_idx, run): (usize, &Run)| {
            let rule = AppearanceRule::Divergence;
            let readings = run.readings();
            let evidence = Evidence::weighed(model, &readings, &setting.sensor, rule, &weight);
            let trials = self.objects.trials.div_ceil(self.runs);
            let seed = self.objects.seed + run_idx as u64;
            (evidence.drawn(&COUNTS, trials, seed), evidence.in_order(&COUNTS))
        };
        let (drawn, in_order): (Vec<_>, Vec<_>) = runs.iter().enumerate().map(of).unzip();
        Curves { drawn: mean_of(&drawn), in_order: mean_of(&in_order) }
    }
}

/// A random pose of the object, its centre near that of the workspace.
fn place(simulator: &PressSimulator, seed: u64) -> Pose {
    let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
    let turned = Pose::from_parts(stream.rotation(), DVec3::ZERO);
    let mut along = || stream.uniform(-PLACE_MAX, PLACE_MAX);
    let middle_in_session = DVec3::new(along(), along(), along());
    let (low, high) = simulator.mesh().bounds();
    let offset = turned * (0.5 * (low + high));
    Pose::from_parts(turned.rotation, middle_in_session - offset)
}

/// Accuracy against readings, mean over all explorations.
pub struct Curves {
    /// On readings drawn from an exploration.
    pub drawn: Vec<Point>,
    /// On the first readings of an exploration.
    pub in_order: Vec<Point>,
}

/// Adds rows and summary of a model on explorations.
pub fn report_curves(
    report: &mut Report,
    setting: &Setting,
    method: &str,
    strategy: &Strategy,
    curves: &Curves,
) {
    for (order, curve) in [("drawn", &curves.drawn), ("in_order", &curves.in_order)] {
        report_curve(report, setting, method, (&strategy.name, &strategy.key), order, curve);
    }
}

/// Adds rows and summary of one curve; `source` is the origin of its readings and its key.
pub fn report_curve(
    report: &mut Report,
    setting: &Setting,
    method: &str,
    source: (&str, &str),
    order: &str,
    curve: &[Point],
) {
    let (name, key) = source;
    for point in curve {
        report.labelled(
            &[
                ("setting", &setting.name),
                ("readings_from", name),
                ("order", order),
                ("method", method),
            ],
            point,
        );
    }
    let order_key = if order == "drawn" { "" } else { "in_order_" };
    for readings in STATED_AT {
        if let Some(accuracy) = accuracy_at(curve, readings) {
            let part = format!("{method}_{}{key}_{order_key}accuracy_at_{readings}", setting.key);
            report.summarise(&part, accuracy);
        }
    }
}

#[derive(Serialize)]
struct Explored {
    readings: usize,
    covered_share: f64,
    one_sidedness: f64,
    steps_per_reading: f64,
    given_up_share: f64,
}

/// Adds rows and summary of the coverage and the effort of explorations.
pub fn report_runs(report: &mut Report, setting: &Setting, strategy: &Strategy, runs: &[Run]) {
    let of = |value: &dyn Fn(&Run) -> f64| mean(&runs.iter().map(value).collect::<Vec<_>>());
    let (one_sidedness, steps_per_reading, given_up_share) =
        (of(&Run::one_sidedness), of(&Run::steps_per_reading), of(&Run::given_up_share));
    for n in [20, 50, 100] {
        let covered_share = of(&|run| run.covered_share(n));
        report.labelled(
            &[("setting", &setting.name), ("readings_from", &strategy.name)],
            Explored {
                readings: n,
                covered_share,
                one_sidedness,
                steps_per_reading,
                given_up_share,
            },
        );
        report.summarise(&format!("{}{}_covered_at_{n}", setting.key, strategy.key), covered_share);
    }
    let key = |figure: &str| format!("{}{}_{figure}", setting.key, strategy.key);
    report.summarise(&key("one_sidedness"), one_sidedness);
    report.summarise(&key("steps_per_reading"), steps_per_reading);
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::object_trials;

    /// A run small enough for a test: one exploration of each of ten objects.
    pub(crate) fn small() -> ExplorationTrials {
        ExplorationTrials { objects: object_trials::tests::small(), runs: 1 }
    }
}
