//! Where presses are lost, and why: rows for each policy.
//!
//! A press is *lost* unless the right object is sure for good from it on. Lost presses are told
//! apart by what they met, and by the belief after them; together with 1 they add up to the mean
//! number of presses. Further rows: bits expected and gained, by the bits expected and by the
//! distance from earlier contacts; all presses of the three slowest trials; trials that never
//! get there.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use serde::Serialize;

use super::robot::Met;
use super::{Played, Step, touches_for_good};
use crate::objects::TestObject;
use crate::report::Report;
use crate::statistics::mean;

/// Trials whose presses are listed.
const SLOWEST: usize = 3;

#[derive(Serialize)]
struct Lost {
    /// Lost presses in a trial.
    lost_mean: f64,
}

#[derive(Serialize)]
struct Gained {
    presses: usize,
    /// Upper end of the range of bits expected, if presses are told apart by it.
    bits_below: Option<f64>,
    /// Upper end of the range of distances from the nearest earlier contact, likewise.
    apart_mm_below: Option<f64>,
    bits_expected: f64,
    bits_gained: f64,
    truth_before: f64,
    truth_after: f64,
}

#[derive(Serialize)]
struct Pressed {
    trial: usize,
    press: usize,
    contact_expected: Option<f64>,
    bits_expected: Option<f64>,
    apart_mm: Option<f64>,
    truth: f64,
    entropy: f64,
}

#[derive(Serialize)]
struct Never {
    trial: usize,
    contacts: usize,
    misses: usize,
    no_rests: usize,
    truth_last: f64,
    truth_max: f64,
}

/// Adds the rows of a policy, and its lost presses by the belief after them to the summary.
pub(super) fn report(report: &mut Report, objects: &[TestObject], played: &Played) {
    report_lost(report, played);
    report_gained(report, played);
    report_slowest(report, objects, played);
    report_never(report, objects, played);
}

fn report_lost(report: &mut Report, played: &Played) {
    let policy = played.policy.name();
    let one = 1.0 / played.trials.len() as f64;
    let mut kinds: BTreeMap<(&str, &str), f64> = BTreeMap::new();
    let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
    for (trial, steps) in played.trials.iter().enumerate() {
        let first = steps.iter().position(|step| step.met == Met::Contact);
        for (press, step) in steps[..touches_for_good(steps) - 1].iter().enumerate() {
            let met = match first {
                Some(first) if press > first => step.met.name(),
                Some(first) if press == first => "first contact",
                _ => "nothing yet",
            };
            let after = state(step, played.object(trial));
            *kinds.entry((met, after)).or_default() += one;
            *sums.entry(after).or_default() += one;
        }
    }
    for ((met, after), lost_mean) in kinds {
        report.labelled(&[("policy", policy), ("met", met), ("after", after)], Lost { lost_mean });
    }
    for (after, sum) in sums {
        let after = after.replace(", ", "_").replace(' ', "_");
        report.summarise(&format!("{policy}_lost_{after}"), sum);
    }
}

/// The belief after a lost press.
fn state(step: &Step, object: usize) -> &'static str {
    match step.likeliest {
        _ if step.sure => "sure, doubted later",
        Some(likeliest) if likeliest == object => "right, not sure",
        Some(_) => "another object",
        None => "none of these",
    }
}

/// Rows of planned presses while the right object was not sure.
fn report_gained(report: &mut Report, played: &Played) {
    const BITS: [f64; 6] = [0.0, 0.1, 0.25, 0.5, 1.0, f64::INFINITY];
    const APART_MM: [f64; 7] = [0.0, 1.0, 3.0, 6.0, 12.0, 25.0, f64::INFINITY];
    let pairs = played.trials.iter().flat_map(|steps| steps.windows(2));
    let planned: Vec<[&Step; 2]> = pairs
        .filter(|pair| !pair[0].sure && pair[1].expected.is_some())
        .map(|pair| [&pair[0], &pair[1]])
        .collect();
    let bits = |step: &Step| step.expected.map(|expected| expected[1]);
    let apart_mm = |step: &Step| step.apart.map(|apart| 1e3 * apart);
    for range in BITS.windows(2) {
        let row = gained(&planned, range, &bits);
        let row = row.map(|row| Gained { bits_below: Some(range[1]), ..row });
        row.into_iter().for_each(|row| report.labelled(&[("policy", played.policy.name())], row));
    }
    for range in APART_MM.windows(2) {
        let row = gained(&planned, range, &apart_mm);
        let row = row.map(|row| Gained { apart_mm_below: Some(range[1]), ..row });
        row.into_iter().for_each(|row| report.labelled(&[("policy", played.policy.name())], row));
    }
}

/// Means over the presses (before and after) whose value is within a range; `None` without any.
fn gained(
    planned: &[[&Step; 2]],
    range: &[f64],
    value: &dyn Fn(&Step) -> Option<f64>,
) -> Option<Gained> {
    let within = |[_, after]: &&[&Step; 2]| {
        value(after).is_some_and(|value| range[0] <= value && value < range[1])
    };
    let own: Vec<&[&Step; 2]> = planned.iter().filter(within).collect();
    let of = |figure: &dyn Fn(&[&Step; 2]) -> f64| {
        mean(&own.iter().map(|steps| figure(steps)).collect::<Vec<_>>())
    };
    (!own.is_empty()).then(|| Gained {
        presses: own.len(),
        bits_below: None,
        apart_mm_below: None,
        bits_expected: of(&|[_, after]| after.expected.map_or(f64::NAN, |expected| expected[1])),
        bits_gained: of(&|[before, after]| before.entropy - after.entropy),
        truth_before: of(&|[before, _]| before.truth),
        truth_after: of(&|[_, after]| after.truth),
    })
}

/// Rows of all presses of the trials with the most presses.
fn report_slowest(report: &mut Report, objects: &[TestObject], played: &Played) {
    let mut trials: Vec<usize> = (0..played.trials.len()).collect();
    trials.sort_by_key(|trial| Reverse(touches_for_good(&played.trials[*trial])));
    for trial in trials.into_iter().take(SLOWEST) {
        for (press, step) in played.trials[trial].iter().enumerate() {
            let row = Pressed {
                trial,
                press: press + 1,
                contact_expected: step.expected.map(|expected| expected[0]),
                bits_expected: step.expected.map(|expected| expected[1]),
                apart_mm: step.apart.map(|apart| 1e3 * apart),
                truth: step.truth,
                entropy: step.entropy,
            };
            let labels = [
                ("policy", played.policy.name()),
                ("object", &*objects[played.object(trial)].name),
                ("met", step.met.name()),
                ("likeliest", likeliest(objects, step)),
            ];
            report.labelled(&labels, row);
        }
    }
}

/// A row of every trial that never gets there, with what was likeliest at last.
fn report_never(report: &mut Report, objects: &[TestObject], played: &Played) {
    for (trial, steps) in played.trials.iter().enumerate() {
        let Some(last) = steps.last().filter(|_| touches_for_good(steps) > steps.len()) else {
            continue;
        };
        let count = |met: Met| steps.iter().filter(|step| step.met == met).count();
        let row = Never {
            trial,
            contacts: count(Met::Contact),
            misses: count(Met::Nothing),
            no_rests: count(Met::NoRest),
            truth_last: last.truth,
            truth_max: steps.iter().map(|step| step.truth).fold(0.0, f64::max),
        };
        let labels = [
            ("policy", played.policy.name()),
            ("object", &*objects[played.object(trial)].name),
            ("likeliest", likeliest(objects, last)),
        ];
        report.labelled(&labels, row);
    }
}

fn likeliest<'a>(objects: &'a [TestObject], step: &Step) -> &'a str {
    step.likeliest.map_or("none of these", |object| &objects[object].name)
}

#[cfg(test)]
mod tests {
    use super::super::robot::Policy;
    use super::*;

    #[test]
    fn lost_presses_and_one_add_up_to_the_mean_of_presses() {
        let step = |met, likeliest, sure| Step {
            right: likeliest == Some(0),
            sure,
            met,
            approaches: 1,
            likeliest,
            truth: 0.5,
            entropy: 1.0,
            apart: None,
            choice_ms: 0.0,
            expected: None,
        };
        let slow = vec![
            step(Met::Nothing, Some(1), false),
            step(Met::Contact, Some(0), true),
            step(Met::NoRest, None, false),
            step(Met::Contact, Some(0), true),
        ];
        let never = vec![step(Met::Contact, Some(1), false); 4];
        let (policy, n_objects) = (Policy::Information, 1);
        let played = Played { policy, n_objects, trials: vec![slow, never] };
        let mut report = Report::default();
        report_lost(&mut report, &played);
        // 4 and, for the one that never gets there, 5 presses: 4.5 in the mean, 3.5 of them lost.
        let sum: f64 = report.summary.values().sum();
        assert!((sum - 3.5).abs() < 1e-9, "{:?}", report.summary);
        let lost = |after: &str| report.summary[&format!("information_lost_{after}")];
        assert!((lost("another_object") - 2.5).abs() < 1e-9);
        assert!((lost("none_of_these") - 0.5).abs() < 1e-9);
        assert!((lost("sure_doubted_later") - 0.5).abs() < 1e-9);
    }
}
