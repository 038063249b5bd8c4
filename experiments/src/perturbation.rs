//! Figure 4.13: an object that moves each time it is touched, against one that rests.
//!
//! Each motion is up to 10° and a tenth of the object's size; motions accumulate. Both objects
//! are explored from the same places by the same planner. The appearance models do not use
//! poses; for contrast the same readings go to `sva` of section 5, which assumes that objects
//! rest.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::object::ObjectIdx;
use palpate_core::reading::Reading;
use palpate_core::training::TrainingSet;
use palpate_dissertation::sva::model::SvaModel;
use palpate_dissertation::sva::train::{TrainingConfig, learn_vocabulary, map_object};
use palpate_dissertation::sva::{SvaBelief, SvaOptions};
use palpate_sim::plot::{Line, svg};
use rayon::prelude::*;
use serde::Serialize;

use crate::appearance_trials::line;
use crate::explorations::{ExplorationTrials, Run, Strategy, report_curves, report_runs};
use crate::object_trials::{Setting, TOP_DESCRIPTORS, Touched, panel};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::mean;

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
            local: LOCAL,
            as_printed: true,
            perturb,
        };
        let runs = config.explore(&objects, &setting, &strategy)?;
        report_runs(&mut report, &setting, &strategy, &runs);
        explored.push((strategy, runs));
    }
    progress("sva", 3, n_steps);
    let catalogue = Arc::new(sva_catalogue(&touched.training, &setting, config.objects.seed)?);
    let mut contrast = Vec::new();
    for (strategy, runs) in &explored {
        let accuracies = sva_accuracies(&catalogue, &setting, runs)?;
        report_sva(&mut report, &strategy.name, &accuracies);
        let points = accuracies.iter().map(|(readings, share)| (*readings as f64, 100.0 * share));
        contrast.push(Line { name: strategy.name.clone(), points: points.collect() });
    }
    let mut panels = vec![panel("sva, as they came", contrast)];
    for (done, descriptor) in TOP_DESCRIPTORS.into_iter().enumerate() {
        progress(descriptor.name(), 4 + done, n_steps);
        let lines = lines(config, &setting, &touched, &explored, descriptor, &mut report)?;
        panels.push(panel(descriptor.name(), lines));
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// Counts of readings after which `sva` answers.
const SVA_COUNTS: [usize; 7] = [2, 3, 5, 7, 10, 15, 20];

fn sva_catalogue(
    training: &[Vec<Reading>],
    setting: &Setting,
    seed: u64,
) -> anyhow::Result<SvaModel> {
    let config = TrainingConfig::default();
    let sensor = &setting.sensor;
    let sets: Vec<TrainingSet<'_>> =
        training.iter().map(|readings| TrainingSet { readings, sensor }).collect();
    let vocabulary = learn_vocabulary(&sets, &config, seed)?;
    // The meshes' centroids are their origins already.
    let origin = Some(DVec3::ZERO);
    let map = |set| map_object(set, &vocabulary, &config, origin).map(Arc::new);
    let objects = sets.par_iter().map(map).collect::<Result<Vec<_>, _>>()?;
    let association = config.association;
    Ok(SvaModel { vocabulary, association, objects })
}

/// Share of the explorations in which `sva` names the right object, after each of the counts.
fn sva_accuracies(
    catalogue: &Arc<SvaModel>,
    setting: &Setting,
    runs: &[Run],
) -> anyhow::Result<Vec<(usize, f64)>> {
    let explorations: Vec<(usize, Vec<Reading>)> =
        runs.iter().flat_map(|run| run.readings().into_iter().enumerate()).collect();
    let verdicts = explorations.par_iter().map(|(truth, readings)| {
        let mut belief = SvaBelief::new(catalogue.clone(), SvaOptions::default(), None)?;
        let mut right = Vec::with_capacity(SVA_COUNTS.len());
        let last = SVA_COUNTS[SVA_COUNTS.len() - 1];
        for (taken, reading) in readings.iter().enumerate().take(last) {
            belief.add(reading, &setting.sensor)?;
            if SVA_COUNTS.contains(&(taken + 1)) {
                let best = belief.answer(1).best_object();
                right.push(f64::from(u8::from(best == Some(ObjectIdx(*truth as u32)))));
            }
        }
        Ok(right)
    });
    let verdicts = verdicts.collect::<anyhow::Result<Vec<Vec<f64>>>>()?;
    let of = |(at, readings): (usize, &usize)| {
        let right: Vec<f64> = verdicts.iter().filter_map(|right| right.get(at).copied()).collect();
        (!right.is_empty()).then(|| (*readings, mean(&right)))
    };
    Ok(SVA_COUNTS.iter().enumerate().filter_map(of).collect())
}

#[derive(Serialize)]
struct Recognised {
    readings: usize,
    accuracy: f64,
}

fn report_sva(report: &mut Report, name: &str, accuracies: &[(usize, f64)]) {
    for (readings, accuracy) in accuracies {
        report.labelled(
            &[("readings_from", name), ("order", "in_order"), ("method", "sva")],
            Recognised { readings: *readings, accuracy: *accuracy },
        );
        if [5, 10, 20].contains(readings) {
            report.summarise(&format!("sva_{name}_in_order_accuracy_at_{readings}"), *accuracy);
        }
    }
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
    use crate::object_trials::tests::small;

    #[test]
    fn a_small_run_compares_moving_and_resting_objects() {
        let config = ExplorationTrials { objects: small(), runs: 1 };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for key in ["resting", "moving"] {
            let accuracies = TOP_DESCRIPTORS
                .map(|descriptor| summary[&format!("{}_{key}_accuracy_at_20", descriptor.name())]);
            // Ten objects: a guess is right one time in ten.
            assert!(accuracies.iter().sum::<f64>() / 4.0 > 0.15, "{summary:?}");
            assert!(summary.contains_key(&format!("sva_{key}_in_order_accuracy_at_10")));
        }
        // A moving object presents other sides to an arm that stays in place.
        assert!(summary["moving_covered_at_20"] > summary["resting_covered_at_20"]);
        assert_eq!(outcome.plot.matches("<polyline").count(), 2 + 16);
    }
}
