//! Figures 4.11 and 4.12: strategies of blind exploration, compared with the sampler.
//!
//! Models learn from the sampler's readings; tests take readings of the planner with three
//! probabilities L of the local strategy, and held-back readings of the sampler. Both sensors of
//! figure 4.12, the coarse and the fine one, are tested. Beside accuracy the report gives what
//! the dissertation explains it by: the share of the surface that a strategy touches, and how
//! one-sided its readings are. Added: models of touches that begin at any angle, as those of a
//! blind arm do, and an arm that moves on from places that it has pressed, on the same objects
//! and seeds.

mod causes;

use clap::Args;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::DEG;
use palpate_dissertation::appearance::model::AppearanceRule;
use palpate_sim::plot::{Panel, svg};
use serde::Serialize;

use crate::appearance_trials::{Evidence, line};
use crate::explorations::{
    COUNTS, ExplorationTrials, Run, Strategy, report_curve, report_curves, report_runs,
};
use crate::explored_sessions::{play, recognisers};
use crate::object_trials::{Setting, Touched, panel};
use crate::objects::{TestObject, touch_tilted};
use crate::report::{Outcome, Progress, Report};

/// Descriptors of figure 4.12, and that of figure 4.9.
const DESCRIPTORS: [DescriptorKind; 3] =
    [DescriptorKind::PolarFourier, DescriptorKind::MomentNormalized, DescriptorKind::Mnti];

/// The probabilities of the local strategy; the dissertation names only that there are three.
/// With 1 the arm may stay for ever where no contact is possible.
const LOCALS: [f64; 3] = [0.1, 0.5, 0.9];

/// The largest tilt of the added training touches, radians; the printed "small perturbation"
/// is the sampler's 10°.
const WIDE_TILT: f64 = 60.0 * DEG;

/// Arguments of `exploration`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Exploration {
    /// Objects, training and explorations.
    #[command(flatten)]
    #[serde(flatten)]
    pub trials: ExplorationTrials,
    /// Instead of the figures: why explored readings are not recognised, and what helps.
    #[arg(long)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub causes: bool,
}

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched, explored or learnt.
pub fn run(config: &Exploration, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    match config.causes {
        true => causes::run(&config.trials, progress),
        false => figures(&config.trials, progress),
    }
}

/// Figures 4.11 and 4.12.
fn figures(config: &ExplorationTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let objects = config.objects.objects()?;
    let mut report = Report::default();
    let mut panels = Vec::new();
    let settings = settings();
    let n_steps = settings.len() * (1 + strategies().len() + DESCRIPTORS.len()) + DESCRIPTORS.len();
    let mut done = 0;
    let mut next = |stage: &str| {
        progress(stage, done, n_steps);
        done += 1;
    };
    for (setting_idx, setting) in settings.iter().enumerate() {
        next(&format!("touching, {}", setting.name));
        let touched = config.objects.touch(&objects, setting)?;
        let mut explored: Vec<(Strategy, Vec<Run>)> = Vec::new();
        for strategy in strategies() {
            next(&format!("exploring, {}, {}", setting.name, strategy.name));
            let runs = config.explore(&objects, setting, &strategy)?;
            report_runs(&mut report, setting, &strategy, &runs);
            explored.push((strategy, runs));
        }
        let mut trainings = vec![Training { prefix: "", touched }];
        if setting_idx == 0 {
            let (training, seed) = (&trainings[0].touched.training, config.objects.seed);
            let recognisers = recognisers(&objects, training, setting, seed)?;
            let mut lines = Vec::new();
            for (strategy, runs) in &explored {
                for (name, recogniser) in &recognisers {
                    lines.push(play(&mut report, (name, recogniser), setting, strategy, runs)?);
                }
            }
            panels.push(panel("with poses, as they came", lines));
            trainings
                .push(Training { prefix: "tilted_", touched: tilted(config, &objects, setting)? });
        }
        for training in &trainings {
            for descriptor in DESCRIPTORS {
                next(&format!("recognising, {}, {}", setting.name, descriptor.name()));
                panels.push(recognised(
                    config,
                    setting,
                    training,
                    &explored,
                    descriptor,
                    &mut report,
                )?);
            }
        }
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// Training readings, and the prefix of the methods that learn from them.
struct Training {
    prefix: &'static str,
    touched: Touched,
}

/// Touches for training and tests that begin at any angle up to [`WIDE_TILT`].
fn tilted(
    config: &ExplorationTrials,
    objects: &[TestObject],
    setting: &Setting,
) -> anyhow::Result<Touched> {
    let seed = config.objects.seed;
    let touch_all = |n: usize, seed: u64| -> anyhow::Result<Vec<Vec<Reading>>> {
        let touch = |object: &TestObject| touch_tilted(object, &setting.sensor, WIDE_TILT, n, seed);
        objects.iter().map(touch).collect()
    };
    Ok(Touched {
        training: touch_all(config.objects.training_readings, 2 * seed)?,
        test: touch_all(config.objects.test_readings, 2 * seed + 1)?,
    })
}

/// A descriptor's curves on the sampler's and on all explored readings.
fn recognised(
    config: &ExplorationTrials,
    setting: &Setting,
    training: &Training,
    explored: &[(Strategy, Vec<Run>)],
    descriptor: DescriptorKind,
    report: &mut Report,
) -> anyhow::Result<Panel> {
    let method = format!("{}{}", training.prefix, descriptor.name());
    let appearance = config.objects.appearance(descriptor);
    let model = config.objects.test(&training.touched, setting, &appearance)?.model;
    let (rule, seed) = (AppearanceRule::Divergence, config.objects.seed);
    let held_back = Evidence::of(&model, &training.touched.test, &setting.sensor, rule);
    let sampled = held_back.drawn(&COUNTS, config.objects.trials, seed);
    report_curve(report, setting, &method, ("sampler", "sampler"), "drawn", &sampled);
    let mut lines = vec![line("sampler", &sampled)];
    for (strategy, runs) in explored {
        let curves = config.curves(&model, setting, runs);
        report_curves(report, setting, &method, strategy, &curves);
        lines.push(line(&format!("explored, {}", strategy.name), &curves.drawn));
    }
    Ok(panel(&format!("{method}, {}", setting.name), lines))
}

/// The printed strategies, and the middle one for an arm that moves on from what it has pressed.
fn strategies() -> [Strategy; 4] {
    let [few, equal, many] = LOCALS.map(Strategy::printed);
    [few, equal, many, Strategy::moving_on(LOCALS[1])]
}

fn settings() -> Vec<Setting> {
    let sensors = [SensorDescription::digitacts_6x6(), SensorDescription::tekscan_26x26()];
    sensors.map(Setting::of_resolution).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explorations::tests::small;

    #[test]
    fn a_small_run_has_every_strategy_at_both_resolutions() {
        let outcome = figures(&small(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        let mean_of =
            |keys: &[String]| keys.iter().map(|key| summary[key]).sum::<f64>() / keys.len() as f64;
        for side in ["6x6", "26x26"] {
            // Ten objects: a guess is right one time in ten.
            assert!(summary[&format!("polar_fourier_{side}_sampler_accuracy_at_20")] > 0.4);
            let explored = ["l0_1", "l0_5", "l0_9"]
                .map(|source| format!("polar_fourier_{side}_{source}_accuracy_at_20"));
            assert!(mean_of(&explored) > 0.15, "{summary:?}");
            // The local strategy needs fewer steps per reading, but covers less of the surface.
            let of =
                |figure: &str| ["l0_1", "l0_5"].map(|l| summary[&format!("{side}_{l}_{figure}")]);
            let ([global, local], [wide, narrow]) = (of("steps_per_reading"), of("covered_at_20"));
            assert!(global > 2.0 * local && wide > narrow, "{summary:?}");
        }
        let learnt_tilted = "tilted_polar_fourier_6x6_l0_9_accuracy_at_20";
        assert!(summary.contains_key(learnt_tilted), "{summary:?}");
        assert_eq!(outcome.plot.matches("<polyline").count(), (2 + 1) * 3 * 5 + 2 * 4);
    }
}
