//! Figure 4.16 again: noise of up to 40 % of the sensing range, in training and in tests.
//!
//! The level is the total width of a uniform distribution (`docs/equations.md`); the
//! controllers that place the sensor feel the noise too.

use anyhow::Context as _;
use palpate_core::sensor::SensorDescription;
use palpate_sim::noise::NoiseLevel;

use crate::object_trials::Setting;
use crate::planner_trials::PlannerTrials;
use crate::report::{Outcome, Progress};

/// Levels, parts of the sensing range.
const LEVELS: [f64; 4] = [0.0, 0.1, 0.2, 0.4];

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched or learnt.
pub fn run(config: &PlannerTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let settings =
        LEVELS.iter().map(|level| setting(*level)).collect::<anyhow::Result<Vec<_>>>()?;
    config.sweep(&settings, progress)
}

fn setting(level: f64) -> anyhow::Result<Setting> {
    let percent = (100.0 * level).round();
    Ok(Setting {
        name: format!("noise {percent} %"),
        key: format!("{percent}percent_"),
        sensor: SensorDescription::digitacts_6x6(),
        noise_level: NoiseLevel::new(level).context("a level from 0 to 2")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner_trials::tests::small;

    #[test]
    fn a_small_run_states_every_level() {
        // Explorations with four sensors take long; those of coverings are tested.
        let config = PlannerTrials { explorations: None, ..small() };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for percent in [0, 10, 20, 40] {
            assert!(summary.contains_key(&format!("mnti_{percent}percent_accuracy_at_20")));
        }
        assert!(summary["mnti_0percent_accuracy_at_20"] > 0.4, "{summary:?}");
        assert_eq!(outcome.plot.matches("<polyline").count(), 16);
    }
}
