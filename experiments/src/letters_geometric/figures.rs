//! Rows, summary and plots of all trials.

use palpate_core::units::{DEG, MM};
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use super::methods::{Kind, Method};
use super::trials::{POSES_AT, PoseError, Step};
use super::{LettersGeometric, TestLetter};
use crate::appearance_trials::Confused;
use crate::report::Report;
use crate::statistics::{mean, median, standard_error_over_groups};

/// Numbers of readings whose figures the summary states.
const STATED_AT: [usize; 8] = [1, 3, 5, 9, 12, 15, 20, 46];

/// Adds rows for every method and number of readings, rows for confusions, and the summary.
pub(super) fn report(
    report: &mut Report,
    config: &LettersGeometric,
    methods: &[&Method],
    letters: &[TestLetter],
    steps: &[Step],
) {
    for (idx, method) in methods.iter().enumerate() {
        let of_method: Vec<&Step> = steps.iter().filter(|step| step.method == idx).collect();
        for readings in 1..=config.readings {
            row(report, method, letters.len(), readings, &of_method);
        }
        summarise(report, config, method, &of_method);
        confusions(report, config, method, letters, &of_method);
    }
}

#[derive(Serialize)]
struct AfterReadings {
    hypotheses: usize,
    readings: usize,
    accuracy: f64,
    stated_probability_mean: f64,
    translation_error_mm_mean: f64,
    angle_error_deg_mean: f64,
    inertial_error_mm_mean: f64,
    height_error_mm_mean: f64,
}

fn row(report: &mut Report, method: &Method, n_letters: usize, readings: usize, steps: &[&Step]) {
    let at: Vec<&Step> = steps.iter().copied().filter(|step| step.readings == readings).collect();
    let right: Vec<f64> = at.iter().map(|step| right(step)).collect();
    let stated: Vec<f64> = at.iter().map(|step| step.probability).collect();
    let errors: Vec<PoseError> = at.iter().filter_map(|step| step.error).collect();
    let of = |value: fn(&PoseError) -> f64| mean(&errors.iter().map(value).collect::<Vec<f64>>());
    report.labelled(
        &[("method", method.name)],
        AfterReadings {
            hypotheses: method.hypotheses(n_letters),
            readings,
            accuracy: mean(&right),
            stated_probability_mean: mean(&stated),
            translation_error_mm_mean: of(|error| error.translation / MM),
            angle_error_deg_mean: of(|error| error.angle / DEG),
            inertial_error_mm_mean: of(|error| error.inertial / MM),
            height_error_mm_mean: of(|error| error.height / MM),
        },
    );
}

fn right(step: &Step) -> f64 {
    f64::from(u8::from(step.named == step.letter))
}

fn summarise(report: &mut Report, config: &LettersGeometric, method: &Method, steps: &[&Step]) {
    let to_all_right: Vec<f64> = (0..config.seeds as u64)
        .map(|idx| readings_to_100(config, config.seed + idx, steps) as f64)
        .collect();
    let mut state = |name: &str, value: f64| {
        let key =
            if method.key.is_empty() { name.into() } else { format!("{}_{name}", method.key) };
        report.summarise(&key, value);
    };
    state("readings_to_100_median", median(&to_all_right));
    state("readings_to_100_worst", to_all_right.iter().copied().fold(0.0, f64::max));
    state("expected_calibration_error", calibration_error(steps));
    for readings in STATED_AT.into_iter().filter(|n| *n <= config.readings) {
        let at = || steps.iter().filter(|step| step.readings == readings);
        state(
            &format!("accuracy_at_{readings}"),
            mean(&at().map(|s| right(s)).collect::<Vec<_>>()),
        );
        if config.seeds > 1 {
            // A seed is a sensor: the trials of one seed share its gains and its maps.
            let by_seed = at().map(|step| (step.seed, right(step)));
            state(&format!("standard_error_at_{readings}"), standard_error_over_groups(by_seed));
        }
        let inertial: Vec<f64> =
            at().filter_map(|step| step.error).map(|error| error.inertial / MM).collect();
        if POSES_AT.contains(&readings) && !inertial.is_empty() {
            state(&format!("inertial_error_mm_mean_at_{readings}"), mean(&inertial));
        }
    }
    // The other methods are given the plane, so that they have no error of height.
    if matches!(method.kind, Kind::Adaptive) {
        let errors = steps.iter().filter_map(|step| step.error);
        let heights: Vec<f64> = errors.map(|error| error.height / MM).collect();
        state("height_error_mm_mean", mean(&heights));
    }
}

/// Expected calibration error of the named letter over the first nine readings, with ten bins of
/// equal width.
fn calibration_error(steps: &[&Step]) -> f64 {
    let mut classes = [(0.0, 0.0); 10];
    let mut n = 0.0;
    for step in steps.iter().filter(|step| step.readings <= 9) {
        let class = &mut classes[((step.probability * 10.0) as usize).min(9)];
        class.0 += step.probability;
        class.1 += right(step);
        n += 1.0;
    }
    classes.iter().map(|(stated, right)| (stated - right).abs()).sum::<f64>() / f64::max(n, 1.0)
}

/// The first number of readings from which all trials of a seed stay right; one more than a
/// trial has if they never do.
fn readings_to_100(config: &LettersGeometric, seed: u64, steps: &[&Step]) -> usize {
    let wrong = steps.iter().filter(|step| step.seed == seed && step.named != step.letter);
    wrong.map(|step| step.readings).max().unwrap_or(0).min(config.readings) + 1
}

/// A row for each pair of letters that is still confused after 15 readings.
fn confusions(
    report: &mut Report,
    config: &LettersGeometric,
    method: &Method,
    letters: &[TestLetter],
    steps: &[&Step],
) {
    let late = config.readings.min(15);
    let wrong = steps.iter().filter(|step| step.readings == late && step.named != step.letter);
    let mut pairs: Vec<(usize, usize)> = wrong.map(|step| (step.letter, step.named)).collect();
    pairs.sort_unstable();
    for pair in pairs.chunk_by(|a, b| a == b) {
        report.labelled(
            &[
                ("method", method.name),
                ("letter", &letters[pair[0].0].symbol.to_string()),
                ("confused_with", &letters[pair[0].1].symbol.to_string()),
            ],
            Confused { readings: late, trials: pair.len() },
        );
    }
}

/// The trials that are plotted.
pub(super) struct Plotted<'a> {
    pub(super) config: &'a LettersGeometric,
    pub(super) methods: &'a [&'a Method],
    pub(super) steps: &'a [Step],
}

/// A value of the trials after one number of readings.
type Value<'a> = &'a dyn Fn(&[&Step]) -> f64;

impl Plotted<'_> {
    /// Plots accuracy and errors against readings, with separate panels per kind of filter.
    pub(super) fn plot(&self) -> String {
        let accuracy =
            |steps: &[&Step]| mean(&steps.iter().map(|step| right(step)).collect::<Vec<f64>>());
        let inertial = |steps: &[&Step]| mean_error(steps, |error| error.inertial / MM);
        let (histograms, ours) = (&["histogram"][..], &["balanced", "learnt", "extents"][..]);
        let particles = &["particles"][..];
        let (share, error) = ("share right", "mean inertial error (mm)");
        svg(&[
            self.panel("histogram filters", share, histograms, &accuracy),
            self.panel("histogram filters", error, histograms, &inertial),
            self.panel("particle filters", share, particles, &accuracy),
            self.panel("particle filters", error, particles, &inertial),
            self.panel("other bins and tables", share, ours, &accuracy),
            self.panel("other bins and tables", error, ours, &inertial),
        ])
    }

    /// Figure 3.12: the translational part of the histogram filters' errors.
    pub(super) fn translation(&self) -> String {
        let translation = |steps: &[&Step]| mean_error(steps, |error| error.translation / MM);
        let (title, y) = ("3.12: histogram filters", "mean translational error (mm)");
        svg(&[self.panel(title, y, &["histogram"], &translation)])
    }

    /// A value against readings, one line for each method whose name begins so.
    fn panel(&self, title: &str, y: &str, begin: &[&str], value: Value<'_>) -> Panel {
        let chosen = self
            .methods
            .iter()
            .enumerate()
            .filter(|(_, method)| begin.iter().any(|begin| method.name.starts_with(begin)));
        let line = |(idx, method): (usize, &&Method)| Line {
            name: method.name.to_owned(),
            points: (1..=self.config.readings)
                .map(|readings| {
                    let steps = self.steps.iter();
                    let at = steps.filter(|s| s.method == idx && s.readings == readings);
                    (readings as f64, value(&at.collect::<Vec<_>>()))
                })
                .collect(),
        };
        let lines = chosen.map(line).collect();
        Panel { title: title.to_owned(), x: "readings".to_owned(), y: y.to_owned(), lines }
    }
}

/// The mean of an error over the trials with an estimated pose; NaN for none.
fn mean_error(steps: &[&Step], value: fn(&PoseError) -> f64) -> f64 {
    let errors = steps.iter().filter_map(|step| step.error);
    mean(&errors.map(|error| value(&error)).collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    /// A step of letter 0 that was named right or wrong with a probability.
    fn step(seed: u64, readings: usize, right: bool, probability: f64) -> Step {
        let named = usize::from(!right);
        Step { method: 0, seed, letter: 0, readings, named, probability, error: None }
    }

    #[test]
    fn a_seed_is_all_right_after_its_last_wrong_reading() {
        let config = LettersGeometric { readings: 5, ..defaults() };
        let right = |readings| step(1, readings, true, 1.0);
        let wrong = |readings| step(1, readings, false, 1.0);
        let of = |steps: &[Step]| readings_to_100(&config, 1, &steps.iter().collect::<Vec<_>>());
        assert_eq!(of(&[right(1), right(2)]), 1);
        // Right, wrong, right: from the third reading on; wrong at the end: never.
        assert_eq!(of(&[right(1), wrong(2), right(3), right(4), right(5)]), 3);
        assert_eq!(of(&[wrong(1), right(2), wrong(5)]), 6);
        // Another seed's errors do not count.
        assert_eq!(of(&[right(1), step(2, 4, false, 1.0)]), 1);
    }

    #[test]
    fn calibration_is_how_far_stated_probabilities_are_off() {
        // Stated 0.95 twice and right once: 2 · 0.95 − 1 = 0.9. Stated 0.55 and right: 0.45.
        // Together 1.35 of three steps; a step after nine readings does not count.
        let steps = [
            step(1, 1, true, 0.95),
            step(1, 2, false, 0.95),
            step(1, 3, true, 0.55),
            step(1, 10, false, 0.99),
        ];
        let error = calibration_error(&steps.iter().collect::<Vec<_>>());
        assert!((error - 0.45).abs() < 1e-12, "{error}");
    }
}
