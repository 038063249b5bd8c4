//! `geometric` away from what it was trained with: other noise, coverings, physics, simulators.
//!
//! Planar part (`planar`): letters mapped on the rig and pressed elsewhere, by the service's
//! default and by the printed histogram filter. Solid part (`solid`): ten objects mapped with the
//! preset sensor and touched by others, in boxes of ±10 mm and ±17°. Within a part all rows share
//! maps and poses of trials.

mod planar;
mod solid;

use std::path::PathBuf;

use clap::Args;
use palpate_core::units::MM;
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::letters_geometric::letters_named;
use crate::report::{Outcome, Progress, Report};
use crate::statistics::{mean, median, standard_error_over_groups};

/// Numbers of readings whose figures the summary states.
const STATED_AT: [usize; 6] = [1, 3, 5, 9, 10, 15];

/// Arguments of `geometric-elsewhere`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct GeometricElsewhere {
    /// The letters of the planar part: AEIOU, capitals, all, or any letters.
    #[arg(long, default_value = "AEIOU", value_parser = letters_named)]
    pub letters: String,
    /// A TrueType or OpenType font [default: Quicksand Bold].
    #[arg(long, value_name = "PATH")]
    pub font: Option<PathBuf>,
    /// The objects of the solid part.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of seeds of the planar part. Each is a sensor, its noise and its trials.
    #[arg(long, default_value_t = 3, value_parser = count)]
    pub seeds: usize,
    /// Trials per letter and seed.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub trials: usize,
    /// Readings per trial of the planar part, at most 192.
    #[arg(long, default_value_t = 15, value_parser = count)]
    pub readings: usize,
    /// Trials per object of the solid part; 0 leaves it out.
    #[arg(long, default_value_t = 3)]
    pub solid_trials: usize,
}

/// An answer after some readings of a trial.
struct Step {
    /// The row: where the readings come from, and the method.
    row: usize,
    /// The sensor or the object that trials share.
    group: u64,
    readings: usize,
    is_right: bool,
    stated: f64,
    /// Error of the pose when the name is right, metres.
    error: Option<f64>,
}

/// Figures of a row after some readings.
#[derive(Serialize)]
struct AfterReadings {
    readings: usize,
    accuracy: f64,
    standard_error: f64,
    stated_probability_mean: f64,
    error_mm_median: f64,
}

/// Runs the experiment.
///
/// # Errors
/// When letters or objects cannot be loaded, touched or mapped.
pub fn run(config: &GeometricElsewhere, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let (names, steps) = planar::run(config, progress)?;
    let mut panels = vec![summarised(&mut report, "letters", &names, &steps)];
    if config.solid_trials > 0 {
        let (names, steps) = solid::run(config, progress)?;
        panels.push(summarised(&mut report, "solid", &names, &steps));
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// Adds rows and summary of a part; gives its panel of accuracy.
fn summarised(report: &mut Report, part: &str, names: &[String], steps: &[Step]) -> Panel {
    let most = steps.iter().map(|step| step.readings).max().unwrap_or(0);
    let mut lines = Vec::new();
    for (row, name) in names.iter().enumerate() {
        let mut points = Vec::new();
        for readings in 1..=most {
            let after = after(steps, row, readings);
            if STATED_AT.contains(&readings) {
                let mut state = |key: &str, value: f64| {
                    report.summarise(&format!("{part}_{name}_{key}_at_{readings}"), value);
                };
                state("accuracy", after.accuracy);
                state("standard_error", after.standard_error);
                state("stated", after.stated_probability_mean);
                state("error_mm_median", after.error_mm_median);
            }
            points.push((readings as f64, after.accuracy));
            report.labelled(&[("part", part), ("row", name)], after);
        }
        lines.push(Line { name: name.clone(), points });
    }
    let (title, x, y) = (part.to_owned(), "readings".to_owned(), "share right".to_owned());
    Panel { title, x, y, lines }
}

fn after(steps: &[Step], row: usize, readings: usize) -> AfterReadings {
    let at = || steps.iter().filter(|step| step.row == row && step.readings == readings);
    let right = |step: &Step| f64::from(u8::from(step.is_right));
    let errors: Vec<f64> = at().filter_map(|step| step.error).map(|error| error / MM).collect();
    AfterReadings {
        readings,
        accuracy: mean(&at().map(right).collect::<Vec<_>>()),
        standard_error: standard_error_over_groups(at().map(|step| (step.group, right(step)))),
        stated_probability_mean: mean(&at().map(|step| step.stated).collect::<Vec<_>>()),
        error_mm_median: median(&errors),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn letters_are_named_where_they_were_mapped_and_elsewhere() {
        let config = GeometricElsewhere {
            letters: "AEI".to_owned(),
            seed: 101,
            seeds: 2,
            trials: 2,
            readings: 9,
            solid_trials: 0,
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        // Two of twelve trials may be wrong where the maps were made; chance is a third.
        assert!(summary["letters_rig_adaptive_accuracy_at_9"] > 0.8, "{summary:?}");
        assert!(summary["letters_rig_histogram_accuracy_at_9"] > 0.8, "{summary:?}");
        assert!(summary["letters_mesh_adaptive_accuracy_at_9"] > 0.5, "{summary:?}");
        for row in ["unmatched", "harsh", "jittered", "covering", "layer", "half_space"] {
            let key = format!("letters_{row}_histogram_standard_error_at_9");
            assert!(summary[&key] >= 0.0, "{key}");
        }
        let error = summary["letters_rig_adaptive_error_mm_median_at_9"];
        assert!((0.05..2.0).contains(&error), "{error}");
        assert_eq!(outcome.report.rows.len(), planar::N_ROWS * 9);
    }
}
