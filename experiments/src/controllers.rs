//! Figure 4.17: convergence of the contact controllers under noise of up to four times the forces.
//!
//! Touches of one object (the dragon) from random starts until 100 converge, at every level of
//! noise and once more on each of several seeds. A level is the whole width of a uniform
//! distribution as a part of the largest pressure observed without noise. Added: whether a
//! converged sensor touches the object, and the distance between its resting places with and
//! without noise.

use anyhow::Context as _;
use clap::Args;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::{DEG, MM};
use palpate_sim::controller::Idle;
use palpate_sim::convergence::{
    ContactRule, Convergence, ConvergenceConfig, convergence, observed_range,
};
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::press::PressSimulator;
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::{mean, median};

/// Levels of noise as a share of the observed range of forces.
const LEVELS: [f64; 12] = [0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0];

/// Prefix of the summary's keys, contact rule and end of a touch: as printed, the same with a
/// threshold above the noise, and the settings that all other experiments use.
const RULES: [(&str, ContactRule, Idle); 3] = [
    ("printed", ContactRule::Unaware, Idle::Consecutive),
    ("above_noise", ContactRule::AboveNoise, Idle::Consecutive),
    ("default", ContactRule::AboveNoise, Idle::OneReading),
];

/// Arguments of `controllers`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Controllers {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// The object that is touched.
    #[arg(long, default_value = "dragon", value_name = "NAME")]
    pub object: String,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of seeds.
    #[arg(long, default_value_t = 3, value_parser = count)]
    pub seeds: usize,
    /// Touches that must converge at each level of noise and seed.
    #[arg(long, default_value_t = 100, value_parser = count)]
    pub successes: usize,
}

/// Runs the experiment.
///
/// # Errors
/// When the object is not there or cannot be touched without noise.
pub fn run(config: &Controllers, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let objects = config.objects.load()?;
    let names: Vec<&str> = objects.iter().map(|object| object.name.as_str()).collect();
    let found = objects.iter().find(|object| object.name == config.object);
    let object = found.with_context(|| {
        format!("there is no object {}, expected one of {}", config.object, names.join(", "))
    })?;
    let simulator = PressSimulator::new(object.mesh.clone(), SensorDescription::digitacts_6x6());
    let mut curves = Vec::new();
    for (rule_idx, (name, rule, idle)) in RULES.into_iter().enumerate() {
        let touches = ConvergenceConfig {
            rule,
            idle,
            successes: config.successes,
            ..ConvergenceConfig::default()
        };
        let range = observed_range(&simulator, config.seed, &touches);
        anyhow::ensure!(range > 0.0, "no touch of {} converges without noise", object.name);
        report.summarise("observed_range_kpa", range / 1e3);
        let mut points = Vec::with_capacity(LEVELS.len());
        for (level_idx, level) in LEVELS.into_iter().enumerate() {
            let done = rule_idx * LEVELS.len() + level_idx;
            progress("touching under noise", done, RULES.len() * LEVELS.len());
            let seeds = config.seed..config.seed + config.seeds as u64;
            let runs = seeds.map(|seed| {
                convergence(&simulator, level, range, seed, &touches)
                    .with_context(|| format!("no sensor has noise of {level} of its forces"))
            });
            points.push(Point::of(level, &runs.collect::<anyhow::Result<Vec<_>>>()?));
        }
        points.iter().for_each(|point| point.report(name, &mut report));
        curves.push((name, points));
    }
    let plot = plot(&curves);
    Ok(Outcome { report, plot, pictures: Vec::new() })
}

/// One level of noise, all seeds together.
#[derive(Serialize)]
struct Point {
    noise_percent: f64,
    touches: usize,
    converged: usize,
    converged_share: f64,
    converged_on_object_share: f64,
    rounds_mean: f64,
    commands_mean: f64,
    angle_off_deg_median: f64,
    distance_off_mm_median: f64,
}

impl Point {
    fn of(level: f64, runs: &[Convergence]) -> Self {
        let all = |value: fn(&Convergence) -> f64| -> Vec<f64> { runs.iter().map(value).collect() };
        Self {
            noise_percent: 100.0 * level,
            touches: runs.iter().map(|run| run.attempts).sum(),
            converged: runs.iter().map(|run| run.converged).sum(),
            converged_share: mean(&all(Convergence::share)),
            converged_on_object_share: mean(&all(Convergence::touching_share)),
            rounds_mean: mean(&all(|run| run.rounds_mean)),
            commands_mean: mean(&all(|run| run.commands_mean)),
            angle_off_deg_median: median(&all(|run| run.angle_median / DEG)),
            distance_off_mm_median: median(&all(|run| run.distance_median / MM)),
        }
    }

    fn report(&self, rule: &str, report: &mut Report) {
        report.labelled(&[("rules", rule)], self);
        let percent = self.noise_percent.round();
        for (figure, value) in [
            ("converged", self.converged_share),
            ("converged_on_object", self.converged_on_object_share),
            ("rounds", self.rounds_mean),
            ("commands", self.commands_mean),
        ] {
            report.summarise(&format!("{rule}_{figure}_at_{percent}"), value);
        }
    }
}

fn plot(curves: &[(&str, Vec<Point>)]) -> String {
    let line = |name: &str, points: &[Point], value: fn(&Point) -> f64| Line {
        name: name.to_owned(),
        points: points.iter().map(|point| (point.noise_percent, value(point))).collect(),
    };
    let panel = |title: &str, y: &str, lines: Vec<Line>| Panel {
        title: title.to_owned(),
        x: "noise, % of observed range".to_owned(),
        y: y.to_owned(),
        lines,
    };
    let of = |value: fn(&Point) -> f64| -> Vec<Line> {
        curves.iter().map(|(name, points)| line(name, points, value)).collect()
    };
    let shares = curves.iter().flat_map(|(name, points)| {
        [
            line(name, points, |point| 100.0 * point.converged_share),
            line(&format!("{name}, on the object"), points, |p| {
                100.0 * p.converged_on_object_share
            }),
        ]
    });
    svg(&[
        panel("touches that converge", "%", shares.collect()),
        panel("turns of Press and Orient", "mean of those that converge", of(|p| p.rounds_mean)),
        panel(
            "commands of Press and Orient",
            "mean of those that converge",
            of(|p| p.commands_mean),
        ),
        panel("off the place without noise", "median, mm", of(|p| p.distance_off_mm_median)),
        panel("off the direction without noise", "median, degrees", of(|p| p.angle_off_deg_median)),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_has_every_level_and_names_what_is_missing() {
        let config = Controllers { seed: 101, seeds: 1, successes: 12, ..defaults() };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        assert_eq!(outcome.report.rows.len(), RULES.len() * LEVELS.len());
        let summary = &outcome.report.summary;
        assert!(summary["printed_converged_at_0"] > 0.5, "{summary:?}");
        // Without noise nothing converges in the air, and both rules are one.
        let converged = summary["printed_converged_at_0"];
        assert!((summary["printed_converged_on_object_at_0"] - converged).abs() < 1e-12);
        assert!((summary["above_noise_converged_at_0"] - converged).abs() < 1e-12);
        assert_eq!(outcome.plot.matches("<polyline").count(), 3 * 6);
        let nobody = Controllers { object: "unicorn".to_owned(), ..config };
        let error = run(&nobody, &|_, _, _| ()).err().unwrap().to_string();
        assert!(error.contains("unicorn") && error.contains("dragon"), "{error}");
    }
}
