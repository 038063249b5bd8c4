//! Why appearance fails on explored readings, and what helps.
//!
//! The 6 × 6 sensor and L = 0.5. Beside the printed planner there is one that rarely presses a
//! place again, and one that also centres weak contacts. Every explored place is touched once
//! more as in training, which separates the posture of touches from their places. Models learn
//! from the sampler's touches, from touches that begin tilted, and from both in turn.

use palpate_core::descriptor::DescriptorKind;
use palpate_core::reading::Reading;
use palpate_dissertation::appearance::model::{AppearanceModel, AppearanceRule};
use palpate_sim::plot::{Line, svg};

use super::tilted;
use crate::appearance_trials::{Evidence, Point, line, mean_of};
use crate::explorations::{
    COUNTS, ExplorationTrials, Run, Strategy, report_curve, report_curves, report_runs,
};
use crate::explored_sessions::{play, recognisers};
use crate::explored_touches::{firmness, report_explored, report_sampled, touched_again};
use crate::object_trials::{Setting, Touched, panel};
use crate::objects::TestObject;
use crate::report::{Outcome, Progress, Report};

/// The descriptor of the goals.
const DESCRIPTOR: DescriptorKind = DescriptorKind::PolarFourier;

/// The probability of the local strategy.
const LOCAL: f64 = 0.5;

/// Steps of the progress.
const N_STEPS: usize = 9;

/// Training readings, and the prefix of the methods that learn from them.
struct Training {
    prefix: &'static str,
    touched: Touched,
}

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched, explored or learnt.
pub(super) fn run(config: &ExplorationTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let objects = config.objects.objects()?;
    let setting = Setting::printed("6×6");
    let mut report = Report::default();
    let mut explored: Vec<(Strategy, Vec<Run>)> = Vec::new();
    let strategies =
        [Strategy::printed(LOCAL), Strategy::moving_on(LOCAL), Strategy::centring(LOCAL)];
    for (done, strategy) in strategies.into_iter().enumerate() {
        progress(&format!("exploring, {}", strategy.name), done, N_STEPS);
        let runs = config.explore(&objects, &setting, &strategy)?;
        report_runs(&mut report, &setting, &strategy, &runs);
        report_explored(&mut report, &setting, (&strategy.name, &strategy.key), &runs);
        explored.push((strategy, runs));
    }
    let trainings = trainings(config, &objects, &setting, progress)?;
    if let Some(run) = explored[0].1.first() {
        let sampled = &trainings[0].touched.test;
        report_sampled(&mut report, &setting, ("sampler", "sampler"), run, sampled);
    }
    let mut panels = Vec::new();
    for (done, training) in trainings.iter().enumerate() {
        progress(&format!("recognising, {}", training.prefix), 5 + done, N_STEPS);
        let lines = recognised(config, &setting, training, &explored, &mut report)?;
        panels.push(panel(&format!("{}{}", training.prefix, DESCRIPTOR.name()), lines));
    }
    progress("sessions", 8, N_STEPS);
    let training = &trainings[0].touched.training;
    let recognisers = recognisers(&objects, training, &setting, config.objects.seed)?;
    let mut lines = Vec::new();
    for (strategy, runs) in &explored {
        for (name, recogniser) in &recognisers {
            lines.push(play(&mut report, (name, recogniser), &setting, strategy, runs)?);
        }
    }
    panels.push(panel("with poses, as they came", lines));
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// The sampler's touches, tilted ones, and both in turn.
fn trainings(
    config: &ExplorationTrials,
    objects: &[TestObject],
    setting: &Setting,
    progress: Progress<'_>,
) -> anyhow::Result<[Training; 3]> {
    progress("touching", 3, N_STEPS);
    let sampled = config.objects.touch(objects, setting)?;
    progress("touching, tilted", 4, N_STEPS);
    let tilted = tilted(config, objects, setting)?.training;
    let in_turn = |(a, b): (&Vec<Reading>, &Vec<Reading>)| {
        a.iter().zip(b).flat_map(|(a, b)| [a.clone(), b.clone()]).collect()
    };
    let mixed = sampled.training.iter().zip(&tilted).map(in_turn).collect();
    let test = sampled.test.clone();
    let of =
        |prefix, training| Training { prefix, touched: Touched { training, test: test.clone() } };
    Ok([of("", sampled.training), of("tilted_", tilted), of("mixed_", mixed)])
}

/// Curves of the models that learn from one kind of touches.
fn recognised(
    config: &ExplorationTrials,
    setting: &Setting,
    training: &Training,
    explored: &[(Strategy, Vec<Run>)],
    report: &mut Report,
) -> anyhow::Result<Vec<Line>> {
    let method = format!("{}{}", training.prefix, DESCRIPTOR.name());
    let appearance = config.objects.appearance(DESCRIPTOR);
    let tested = config.objects.test(&training.touched, setting, &appearance)?;
    report_curve(report, setting, &method, ("sampler", "sampler"), "drawn", &tested.curve);
    let mut lines = vec![line("sampler", &tested.curve)];
    for (strategy, runs) in explored {
        let all = config.curves(&tested.model, setting, runs);
        report_curves(report, setting, &method, strategy, &all);
        lines.push(line(&strategy.name, &all.drawn));
        let firm = config.weighed_curves(&tested.model, setting, runs, firmness(setting));
        report_curves(report, setting, &format!("{method}_firm"), strategy, &firm);
        lines.push(line(&format!("{}, firm", strategy.name), &firm.drawn));
        if training.prefix.is_empty() {
            let (name, key) =
                (format!("{}, as in training", strategy.name), strategy.key.clone() + "_again");
            let curve = again(config, setting, &tested.model, runs);
            report_curve(report, setting, &method, (&name, &key), "drawn", &curve);
            lines.push(line(&name, &curve));
        }
    }
    Ok(lines)
}

/// The curve on the explored places, touched as in training.
fn again(
    config: &ExplorationTrials,
    setting: &Setting,
    model: &AppearanceModel,
    runs: &[Run],
) -> Vec<Point> {
    let seed = config.objects.seed;
    let curve = |run: &Run| {
        let readings = touched_again(run, seed);
        let rule = AppearanceRule::Divergence;
        let evidence = Evidence::of(model, &readings, &setting.sensor, rule);
        evidence.drawn(&COUNTS, config.objects.trials.div_ceil(config.runs), seed)
    };
    mean_of(&runs.iter().map(curve).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explorations::tests::small;

    #[test]
    fn an_arm_that_moves_on_presses_more_places() {
        let outcome = run(&small(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        assert!(summary["l0_5_moves_on_places_of_20"] > summary["l0_5_places_of_20"]);
        assert!(summary["sampler_weak_share"] < summary["l0_5_weak_share"], "{summary:?}");
        for training in ["", "tilted_", "mixed_"] {
            for source in ["sampler", "l0_5", "l0_5_moves_on_centres"] {
                let key = format!("{training}polar_fourier_{source}_accuracy_at_20");
                assert!(summary.contains_key(&key), "{key}");
            }
        }
        assert!(summary.contains_key("surface_l0_5_in_order_accuracy_at_10"), "{summary:?}");
    }
}
