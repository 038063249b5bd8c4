//! Rows, summary and plot of all trials.

use palpate_core::units::MM;
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use super::methods::METHODS;
use super::{ANSWERS_AT, LettersSva, Presses, Step};
use crate::appearance_trials::Confused;
use crate::report::Report;
use crate::statistics::{mean, median, standard_error_over_groups};

/// Numbers of readings whose figures the summary states.
const STATED_AT: [usize; 7] = [3, 5, 9, 15, 20, 30, 46];

#[derive(Serialize)]
struct AfterReadings {
    readings: usize,
    accuracy: f64,
    standard_error: f64,
    stated_probability_mean: f64,
    inertial_error_mm_mean: f64,
    inertial_error_mm_median: f64,
}

/// Adds rows, confusions and the summary of every method and kind of presses.
pub(super) fn report(report: &mut Report, config: &LettersSva, steps: &[Step]) {
    for presses in Presses::ALL {
        for (method, named) in METHODS.iter().enumerate() {
            let labels = [("presses", presses.name()), ("method", named.name)];
            for readings in ANSWERS_AT.into_iter().filter(|n| *n <= config.readings) {
                let at = at(steps, presses, method, readings);
                let row = after(&at, readings);
                if STATED_AT.contains(&readings) {
                    let mut state = |key: &str, value: f64| {
                        let key = format!("{}_{}_{key}_at_{readings}", presses.name(), named.name);
                        report.summarise(&key, value);
                    };
                    state("accuracy", row.accuracy);
                    state("inertial_error_mm_mean", row.inertial_error_mm_mean);
                    state("inertial_error_mm_median", row.inertial_error_mm_median);
                    if config.seeds > 1 {
                        state("standard_error", row.standard_error);
                    }
                }
                report.labelled(&labels, row);
                confusions(report, config, &labels, &at);
            }
        }
    }
}

fn at(steps: &[Step], presses: Presses, method: usize, readings: usize) -> Vec<&Step> {
    let is = |s: &&Step| s.presses == presses && s.method == method && s.readings == readings;
    steps.iter().filter(is).collect()
}

fn right(step: &Step) -> f64 {
    f64::from(u8::from(step.named == step.letter))
}

fn after(at: &[&Step], readings: usize) -> AfterReadings {
    let of = |value: &dyn Fn(&Step) -> f64| at.iter().map(|s| value(s)).collect::<Vec<f64>>();
    let errors: Vec<f64> = at.iter().filter_map(|s| s.error).map(|error| error / MM).collect();
    AfterReadings {
        readings,
        accuracy: mean(&of(&right)),
        // A seed is a sensor: the trials of one seed share its gains and its maps.
        standard_error: standard_error_over_groups(at.iter().map(|s| (s.seed, right(s)))),
        stated_probability_mean: mean(&of(&|s| s.probability)),
        inertial_error_mm_mean: mean(&errors),
        inertial_error_mm_median: median(&errors),
    }
}

/// A row for each pair of letters that is confused after 30 readings, or at the end.
fn confusions(report: &mut Report, config: &LettersSva, labels: &[(&str, &str)], at: &[&Step]) {
    let late = config.readings.min(30);
    let wrong = at.iter().filter(|s| s.readings == late && s.named != s.letter);
    let mut pairs: Vec<(usize, usize)> = wrong.map(|s| (s.letter, s.named)).collect();
    pairs.sort_unstable();
    let symbols: Vec<String> = config.letters.chars().map(String::from).collect();
    for pair in pairs.chunk_by(|a, b| a == b) {
        let (letter, named) = pair[0];
        let names = [("letter", symbols[letter].as_str()), ("confused_with", &symbols[named])];
        let labels = [labels, &names].concat();
        report.labelled(&labels, Confused { readings: late, trials: pair.len() });
    }
}

/// Figure 5.4: accuracy and inertial error against readings, on planned and on jittered presses.
pub(super) fn plot(config: &LettersSva, steps: &[Step]) -> String {
    let panel = |presses: Presses, y: &str, value: &dyn Fn(&AfterReadings) -> f64| {
        let line = |(method, named): (usize, &super::methods::Method)| {
            let counts = ANSWERS_AT.into_iter().filter(|n| *n <= config.readings);
            let point = |readings: usize| {
                let row = after(&at(steps, presses, method, readings), readings);
                (readings as f64, value(&row))
            };
            Line { name: named.name.to_owned(), points: counts.map(point).collect() }
        };
        Panel {
            title: format!("{} presses", presses.name().replace('_', " ")),
            x: "readings".to_owned(),
            y: y.to_owned(),
            lines: METHODS.iter().enumerate().map(line).collect(),
        }
    };
    let panels = Presses::ALL.into_iter().flat_map(|presses| {
        [
            panel(presses, "share right", &|row| row.accuracy),
            panel(presses, "median inertial error (mm)", &|row| row.inertial_error_mm_median),
        ]
    });
    svg(&panels.collect::<Vec<_>>())
}
