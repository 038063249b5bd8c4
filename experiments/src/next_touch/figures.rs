//! Rows, summary and plot of the trials of every policy.

use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use super::robot::{Met, Policy};
use super::{NextTouch, Played, Step, approaches_for_good, touches_for_good};
use crate::objects::TestObject;
use crate::report::Report;
use crate::statistics::{bootstrap_95, mean, quantile};

#[derive(Serialize)]
struct Touches {
    trials: usize,
    touches_mean: f64,
    touches_low: f64,
    touches_high: f64,
    touches_median: f64,
    touches_p90: f64,
    touches_max: f64,
    never_share: f64,
    approaches_mean: f64,
    touching_share: f64,
}

#[derive(Serialize)]
struct AfterPresses {
    presses: usize,
    accuracy: f64,
    sure_for_good: f64,
}

pub(super) fn report_policy(report: &mut Report, config: &NextTouch, played: &Played) {
    let name = played.policy.name();
    let touches = counts(played, touches_for_good);
    let approaches = counts(played, approaches_for_good);
    let steps = || played.trials.iter().flatten();
    let share = |values: Vec<bool>| {
        mean(&values.into_iter().map(|value| f64::from(u8::from(value))).collect::<Vec<_>>())
    };
    let resampled = |cases: &[usize]| mean(&cases.iter().map(|n| touches[*n]).collect::<Vec<_>>());
    let [low, high] = bootstrap_95(touches.len(), config.seed, resampled);
    let never = touches.iter().map(|n| *n > config.readings as f64).collect();
    // The first press is blind for all: what was chosen are the others.
    let chosen =
        played.trials.iter().flat_map(|steps| &steps[1..]).map(|step| step.met == Met::Contact);
    report.labelled(
        &[("policy", name)],
        Touches {
            trials: touches.len(),
            touches_mean: mean(&touches),
            touches_low: low,
            touches_high: high,
            touches_median: quantile(&touches, 0.5),
            touches_p90: quantile(&touches, 0.9),
            touches_max: quantile(&touches, 1.0),
            never_share: share(never),
            approaches_mean: mean(&approaches),
            touching_share: share(chosen.collect()),
        },
    );
    report.summarise(&format!("{name}_touches_mean"), mean(&touches));
    report.summarise(&format!("{name}_approaches_mean"), mean(&approaches));
    for n in 1..=config.readings {
        let after = || played.trials.iter().map(|steps| steps[n - 1]);
        let for_good = touches.iter().map(|touches| *touches <= n as f64).collect();
        report.labelled(
            &[("policy", name)],
            AfterPresses {
                presses: n,
                accuracy: share(after().map(|step| step.right).collect()),
                sure_for_good: share(for_good),
            },
        );
    }
    if played.policy == Policy::Information {
        let times: Vec<f64> =
            steps().filter(|step| step.expected.is_some()).map(|step| step.choice_ms).collect();
        report.summarise("p99_ms", quantile(&times, 0.99));
        report.summarise("median_ms", quantile(&times, 0.5));
    }
    report_expected(report, played);
}

#[derive(Serialize)]
struct Expected {
    trials: usize,
    contact_expected: f64,
    touching_share: f64,
}

/// Rows of presses by what contact was expected, beside how many of them touched.
fn report_expected(report: &mut Report, played: &Played) {
    const BINS: usize = 5;
    let steps = || played.trials.iter().flatten();
    for bin in 0..BINS {
        let within = |expected: f64| ((expected * BINS as f64) as usize).min(BINS - 1) == bin;
        let found: Vec<(f64, f64)> = steps()
            .filter_map(|step| {
                Some((step.expected?[0], f64::from(u8::from(step.met == Met::Contact))))
            })
            .filter(|(expected, _)| within(*expected))
            .collect();
        if found.is_empty() {
            continue;
        }
        let (expected, touched): (Vec<f64>, Vec<f64>) = found.into_iter().unzip();
        report.labelled(
            &[("policy", played.policy.name())],
            Expected {
                trials: expected.len(),
                contact_expected: mean(&expected),
                touching_share: mean(&touched),
            },
        );
    }
}

#[derive(Serialize)]
struct OfObject {
    trials: usize,
    touches_mean: f64,
    never_share: f64,
}

pub(super) fn report_objects(
    report: &mut Report,
    config: &NextTouch,
    objects: &[TestObject],
    played: &Played,
) {
    let touches = counts(played, touches_for_good);
    for (index, object) in objects.iter().enumerate() {
        let own: Vec<f64> = touches.iter().copied().skip(index).step_by(objects.len()).collect();
        if own.is_empty() {
            continue;
        }
        let never = own.iter().filter(|n| **n > config.readings as f64).count();
        report.labelled(
            &[("policy", played.policy.name()), ("object", &object.name)],
            OfObject {
                trials: own.len(),
                touches_mean: mean(&own),
                never_share: never as f64 / own.len() as f64,
            },
        );
    }
}

pub(super) fn report_ratios(report: &mut Report, config: &NextTouch, all: &[Played]) {
    let of = |policy: Policy| {
        let found = all.iter().find(|played| played.policy == policy);
        found.map(|played| counts(played, touches_for_good))
    };
    let Some(ours) = of(Policy::Information) else { return };
    for (key, policy) in [
        ("touches_ratio_to_random", Policy::Random),
        ("touches_ratio_to_random_recentered", Policy::RandomRecentered),
        ("touches_ratio_to_directed", Policy::Directed),
        ("touches_ratio_to_sampler", Policy::Sampler),
    ] {
        let Some(other) = of(policy) else { continue };
        let ratio = |cases: &[usize]| {
            let sum = |values: &[f64]| cases.iter().map(|n| values[*n]).sum::<f64>();
            sum(&ours) / sum(&other)
        };
        report.summarise(key, mean(&ours) / mean(&other));
        let [low, high] = bootstrap_95(ours.len(), config.seed, ratio);
        report.summarise(&format!("{key}_low"), low);
        report.summarise(&format!("{key}_high"), high);
    }
}

pub(super) fn plot(config: &NextTouch, all: &[Played]) -> String {
    let lines = |value: &dyn Fn(&Played, usize) -> f64| -> Vec<Line> {
        let line = |played: &Played| Line {
            name: played.policy.name().replace('_', " "),
            points: (1..=config.readings).map(|n| (n as f64, value(played, n))).collect(),
        };
        all.iter().map(line).collect()
    };
    let panel = |title: &str, lines| Panel {
        title: title.to_owned(),
        x: "presses, misses included".to_owned(),
        y: "% of trials".to_owned(),
        lines,
    };
    let percent = |played: &Played, is: &dyn Fn(&Vec<Step>) -> bool| {
        let n = played.trials.iter().filter(|steps| is(steps)).count();
        100.0 * n as f64 / played.trials.len() as f64
    };
    svg(&[
        panel(
            "right with 95 % for good",
            lines(&|played, n| percent(played, &|steps| touches_for_good(steps) <= n)),
        ),
        panel("right", lines(&|played, n| percent(played, &|steps| steps[n - 1].right))),
    ])
}

fn counts(played: &Played, of: fn(&[Step]) -> usize) -> Vec<f64> {
    played.trials.iter().map(|steps| of(steps) as f64).collect()
}
