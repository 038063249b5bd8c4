//! Figures 4.11 and 4.12: strategies of blind exploration, and the sampler that they are
//! measured against.
//!
//! Models learn from the sampler's readings; tests take readings of the planner with three
//! probabilities L of the local strategy, and held-back readings of the sampler. The coarse
//! and the fine sensor of figure 4.12. Beside accuracy stands what the dissertation explains
//! it by: how much of the surface a strategy touches, and how one-sidedly.

use palpate_core::descriptor::DescriptorKind;
use palpate_core::model::appearance::AppearanceRule;
use palpate_core::sensor::SensorDescription;
use palpate_sim::noise::NoiseLevel;

use crate::appearance_trials::{Evidence, line};
use crate::explorations::{
    COUNTS, ExplorationTrials, Run, Strategy, report_curve, report_curves, report_runs,
};
use crate::object_trials::{Setting, panel};
use crate::plot::svg;
use crate::report::{Outcome, Progress, Report};

/// Those of figure 4.12, and the one that figure 4.9 is of.
const DESCRIPTORS: [DescriptorKind; 3] =
    [DescriptorKind::PolarFourier, DescriptorKind::MomentNormalized, DescriptorKind::Mnti];

/// The probabilities of the local strategy; the dissertation names only that there are three.
const LOCALS: [f64; 3] = [0.0, 0.5, 1.0];

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched, explored or learnt.
pub fn run(
    config: &ExplorationTrials,
    command: String,
    progress: Progress<'_>,
) -> anyhow::Result<Outcome> {
    let objects = config.objects.objects()?;
    let mut report = Report::new("exploration", command, config.objects.seed);
    let mut panels = Vec::new();
    let settings = settings();
    let n_steps = settings.len() * (LOCALS.len() + 1 + DESCRIPTORS.len());
    let mut done = 0;
    let mut next = |stage: &str| {
        progress(stage, done, n_steps);
        done += 1;
    };
    for setting in &settings {
        next(&format!("touching, {}", setting.name));
        let touched = config.objects.touch(&objects, setting)?;
        let mut explored: Vec<(Strategy, Vec<Run>)> = Vec::new();
        for strategy in LOCALS.map(strategy) {
            next(&format!("exploring, {}, {}", setting.name, strategy.name));
            let runs = config.explore(&objects, setting, &strategy)?;
            report_runs(&mut report, setting, &strategy, &runs);
            explored.push((strategy, runs));
        }
        for descriptor in DESCRIPTORS {
            let method = descriptor.name();
            next(&format!("recognising, {}, {method}", setting.name));
            let appearance = config.objects.appearance(descriptor);
            let model = config.objects.test(&touched, setting, &appearance)?.model;
            let (rule, seed) = (AppearanceRule::Divergence, config.objects.seed);
            let held_back = Evidence::of(&model, &touched.test, &setting.sensor, rule);
            let sampled = held_back.drawn(&COUNTS, config.objects.trials, seed);
            report_curve(&mut report, setting, method, ("sampler", "sampler"), "drawn", &sampled);
            let mut lines = vec![line("sampler", &sampled)];
            for (strategy, runs) in &explored {
                let curves = config.curves(&model, setting, runs);
                report_curves(&mut report, setting, method, strategy, &curves);
                lines.push(line(&format!("explored, {}", strategy.name), &curves.drawn));
            }
            panels.push(panel(&format!("{method}, {}", setting.name), lines));
        }
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

fn strategy(local: f64) -> Strategy {
    let key = format!("l{local}").replace('.', "_");
    Strategy { name: format!("L = {local}"), key, local, perturb: false }
}

fn settings() -> Vec<Setting> {
    let setting = |sensor: SensorDescription| {
        let side = sensor.grid().rows;
        Setting {
            name: format!("{side}×{side}"),
            key: format!("{side}x{side}_"),
            sensor,
            noise_level: NoiseLevel::NONE,
        }
    };
    [SensorDescription::digitacts_6x6(), SensorDescription::tekscan_26x26()].map(setting).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object_trials::tests::small;

    #[test]
    fn a_small_run_has_every_strategy_at_both_resolutions() {
        let config = ExplorationTrials { objects: small(), runs: 1 };
        let outcome = run(&config, "test".to_owned(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for side in ["6x6", "26x26"] {
            for source in ["sampler", "l0", "l0_5", "l1"] {
                let key = format!("polar_fourier_{side}_{source}_accuracy_at_20");
                // Ten objects: a guess is right one time in ten.
                assert!(summary[&key] > 0.2, "{key}: {summary:?}");
            }
            assert!(summary[&format!("{side}_l0_5_covered_at_20")] > 0.1, "{summary:?}");
        }
        assert_eq!(outcome.plot.matches("<polyline").count(), 2 * 3 * 4);
    }
}
