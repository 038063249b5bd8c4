//! Figure 4.13: an object that moves each time it is touched, against one that rests.
//!
//! Each motion is up to 10° and a tenth of the object's size; motions accumulate. Both objects
//! are explored from the same places by the same planner. The appearance models do not use
//! poses; for contrast the same readings go to the service's own recogniser and to `sva` of
//! section 5, which use poses and are not told of the motion.

use palpate_core::descriptor::DescriptorKind;
use palpate_sim::plot::{Line, svg};

use crate::appearance_trials::line;
use crate::explorations::{ExplorationTrials, Run, Strategy, report_curves, report_runs};
use crate::explored_sessions::{play, recognisers};
use crate::object_trials::{Setting, TOP_DESCRIPTORS, Touched, panel};
use crate::report::{Outcome, Progress, Report};

/// Probability of the local strategy, the one that perturbation could disturb.
const LOCAL: f64 = 0.5;

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched, explored or learnt.
pub fn run(config: &ExplorationTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let objects = config.objects.objects()?;
    let mut report = Report::default();
    let setting = Setting::printed("6×6");
    let n_steps = 4 + TOP_DESCRIPTORS.len();
    progress("touching", 0, n_steps);
    let touched = config.objects.touch(&objects, &setting)?;
    let mut explored: Vec<(Strategy, Vec<Run>)> = Vec::new();
    for (done, perturb) in [false, true].into_iter().enumerate() {
        let name = if perturb { "moving" } else { "resting" };
        progress(&format!("exploring, {name}"), 1 + done, n_steps);
        let strategy = Strategy {
            name: name.to_owned(),
            key: name.to_owned(),
            perturb,
            ..Strategy::printed(LOCAL)
        };
        let runs = config.explore(&objects, &setting, &strategy)?;
        report_runs(&mut report, &setting, &strategy, &runs);
        explored.push((strategy, runs));
    }
    progress("sessions", 3, n_steps);
    let recognisers = recognisers(&objects, &touched.training, &setting, config.objects.seed)?;
    let mut contrast = Vec::new();
    for (strategy, runs) in &explored {
        for (name, recogniser) in &recognisers {
            contrast.push(play(&mut report, (name, recogniser), &setting, strategy, runs)?);
        }
    }
    let mut panels = vec![panel("with poses, as they came", contrast)];
    for (done, descriptor) in TOP_DESCRIPTORS.into_iter().enumerate() {
        progress(descriptor.name(), 4 + done, n_steps);
        let lines = lines(config, &setting, &touched, &explored, descriptor, &mut report)?;
        panels.push(panel(descriptor.name(), lines));
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// The curves of one descriptor.
fn lines(
    config: &ExplorationTrials,
    setting: &Setting,
    touched: &Touched,
    explored: &[(Strategy, Vec<Run>)],
    descriptor: DescriptorKind,
    report: &mut Report,
) -> anyhow::Result<Vec<Line>> {
    let appearance = config.objects.appearance(descriptor);
    let model = config.objects.test(touched, setting, &appearance)?.model;
    let mut lines = Vec::new();
    for (strategy, runs) in explored {
        let curves = config.curves(&model, setting, runs);
        report_curves(report, setting, descriptor.name(), strategy, &curves);
        lines.push(line(&strategy.name, &curves.drawn));
        lines.push(line(&format!("{}, as they came", strategy.name), &curves.in_order));
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explorations::tests::small;

    #[test]
    fn a_small_run_compares_moving_and_resting_objects() {
        let outcome = run(&small(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for key in ["resting", "moving"] {
            let accuracies = TOP_DESCRIPTORS
                .map(|descriptor| summary[&format!("{}_{key}_accuracy_at_20", descriptor.name())]);
            // Ten objects: a guess is right one time in ten.
            assert!(accuracies.iter().sum::<f64>() / 4.0 > 0.15, "{summary:?}");
            for method in ["surface", "sva"] {
                assert!(summary.contains_key(&format!("{method}_{key}_in_order_accuracy_at_10")));
            }
        }
        // A moving object presents other sides to an arm that stays in place.
        assert!(summary["moving_covered_at_20"] > summary["resting_covered_at_20"]);
        assert_eq!(outcome.plot.matches("<polyline").count(), 4 + 16);
    }
}
