//! Figure 4.15 again: 6 × 6, 14 × 14 and 26 × 26 taxels over the same 12 mm.

use palpate_core::sensor::SensorDescription;

use crate::object_trials::Setting;
use crate::planner_trials::PlannerTrials;
use crate::report::{Outcome, Progress};

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched or learnt.
pub fn run(config: &PlannerTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    config.sweep(&settings(), progress)
}

fn settings() -> Vec<Setting> {
    let sensors = [
        SensorDescription::digitacts_6x6(),
        SensorDescription::fingertip_14x14(),
        SensorDescription::tekscan_26x26(),
    ];
    sensors.into_iter().map(Setting::of_resolution).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner_trials::tests::small;

    #[test]
    fn a_small_run_states_every_resolution() {
        // Explorations with fine sensors take long; those of coverings are tested.
        let config = PlannerTrials { explorations: None, ..small() };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for key in ["6x6", "14x14", "26x26"] {
            assert!(summary[&format!("mnti_{key}_accuracy_at_20")] > 0.3, "{summary:?}");
        }
        assert_eq!(outcome.plot.matches("<polyline").count(), 12);
    }
}
