//! Summary of the demonstration: recognised objects, number of touches, pose errors, latency.

use serde::Serialize;

use crate::output::{self, ERRORS_OF_POSE, median};
use crate::trial::TrialResult;

/// The line of `palpate demo --once --json`. Touches count all trials, and `misses` those that
/// touched nothing. Errors are those of the recognised objects modulo symmetry (`plain…`: without
/// regard to symmetry), null if there are none. Milliseconds are per reading.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Summary {
    trials: usize,
    recognised: usize,
    touches_median: Option<f64>,
    misses: u32,
    position_error_mm_median: Option<f64>,
    angle_error_deg_median: Option<f64>,
    plain_angle_error_deg_median: Option<f64>,
    ms_per_reading_median: Option<f64>,
}

impl Summary {
    /// The summary of all trials.
    pub(super) fn of(results: &[TrialResult]) -> Self {
        let right = || results.iter().map(|result| &result.last).filter(|last| last.right);
        let steps = || results.iter().flat_map(|result| &result.steps);
        let touches: Vec<f64> =
            results.iter().map(|result| f64::from(result.last.touches)).collect();
        let position: Vec<f64> = right().filter_map(|last| last.position_error_mm()).collect();
        let angle: Vec<f64> = right().filter_map(|last| last.angle_error_deg()).collect();
        let plain_angle: Vec<f64> =
            right().filter_map(|last| last.plain_angle_error_deg()).collect();
        let ms: Vec<f64> = steps().map(|step| step.reading_ms).collect();
        Self {
            trials: results.len(),
            recognised: right().count(),
            touches_median: median(&touches),
            misses: results.iter().map(|result| result.last.misses).sum(),
            position_error_mm_median: median(&position),
            angle_error_deg_median: median(&angle),
            plain_angle_error_deg_median: median(&plain_angle),
            ms_per_reading_median: median(&ms),
        }
    }

    /// The summary as a sentence.
    pub(super) fn words(&self) -> String {
        let or_none = |value: Option<f64>, unit: &str| {
            value.map_or("–".to_owned(), |value| format!("{value:.1}{unit}"))
        };
        format!(
            "recognised {} of {} objects; median {} touches ({} in all touched nothing), off by {} \
             and {}, {} a reading\n{ERRORS_OF_POSE}",
            self.recognised,
            self.trials,
            or_none(self.touches_median, ""),
            self.misses,
            or_none(self.position_error_mm_median, " mm"),
            or_none(self.angle_error_deg_median, "°"),
            or_none(self.ms_per_reading_median, " ms"),
        )
    }
}

/// A row per trial, sorted by object.
pub(super) fn table(results: &[TrialResult]) -> String {
    let mut sorted: Vec<&TrialResult> = results.iter().collect();
    sorted.sort_by(|a, b| a.truth.cmp(&b.truth));
    output::table(
        [
            "object",
            "",
            "believed",
            "probability",
            "touches",
            "missed",
            "position",
            "angle",
            "ms a reading",
        ],
        sorted.into_iter().map(|result| {
            let last = &result.last;
            let ms: Vec<f64> = result.steps.iter().map(|step| step.reading_ms).collect();
            [
                result.truth.clone(),
                if last.right { "right" } else { "wrong" }.to_owned(),
                last.answer.clone(),
                format!("{:.1} %", last.probability * 100.0),
                last.touches.to_string(),
                last.misses.to_string(),
                last.position_error.map_or("–".to_owned(), output::mm),
                last.angle_error.map_or("–".to_owned(), output::degrees),
                median(&ms).map_or("–".to_owned(), |ms| format!("{ms:.1}")),
            ]
        }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::Step;

    fn result(right: bool, touches: u32, position_error: f64) -> TrialResult {
        let last = Step {
            touches,
            misses: 1,
            answer: "mug".to_owned(),
            probability: 1.0,
            unknown: 0.0,
            object: Some("mug".to_owned()),
            object_probability: 1.0,
            entropy_bits: 0.0,
            right,
            position_error: Some(position_error),
            angle_error: Some(0.1),
            plain_angle_error: Some(0.2),
            reading_ms: 4.0,
        };
        TrialResult { truth: "mug".to_owned(), steps: vec![last.clone()], last }
    }

    #[test]
    fn errors_count_only_where_the_object_was_recognised() {
        let results = [result(true, 4, 0.002), result(true, 8, 0.004), result(false, 20, 9.0)];
        let summary = Summary::of(&results);
        assert_eq!((summary.trials, summary.recognised), (3, 2));
        assert_eq!((summary.touches_median, summary.misses), (Some(8.0), 3));
        assert!((summary.position_error_mm_median.unwrap() - 3.0).abs() < 1e-9);
    }

    #[test]
    fn the_line_of_json_has_the_keys_that_scripts_read() {
        let line = serde_json::to_value(Summary::of(&[])).unwrap();
        let keys: Vec<_> = line.as_object().unwrap().keys().cloned().collect();
        let mut expected = [
            "trials",
            "recognised",
            "touches_median",
            "misses",
            "position_error_mm_median",
            "angle_error_deg_median",
            "plain_angle_error_deg_median",
            "ms_per_reading_median",
        ];
        expected.sort_unstable();
        let mut keys: Vec<_> = keys.iter().map(String::as_str).collect();
        keys.sort_unstable();
        assert_eq!(keys, expected);
    }
}
