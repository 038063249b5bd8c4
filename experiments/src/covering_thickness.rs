//! Figure 4.14 again: the four coverings of chapter 2 under appearance.
//!
//! A thicker covering follows deeper relief and blurs it more (equation 2.5).

use palpate_core::sensor::point_spread::point_spread_of_covering;
use palpate_core::sensor::{ForceCurve, SensorDescription, SensorParameters};
use palpate_core::units::INCH;
use palpate_sim::noise::NoiseLevel;

use crate::object_trials::Setting;
use crate::planner_trials::PlannerTrials;
use crate::report::{Outcome, Progress};

/// The coverings, inches.
const COVERINGS: [f64; 4] = [0.04, 0.10, 0.14, 0.20];

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched or learnt.
pub fn run(config: &PlannerTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let settings =
        COVERINGS.iter().map(|inches| setting(*inches)).collect::<anyhow::Result<Vec<_>>>()?;
    config.sweep(&settings, progress)
}

/// The 6 × 6 sensor under a covering of this many inches; full scale is a full indentation.
///
/// # Errors
/// When there is no such covering.
pub fn sensor_under(inches: f64) -> anyhow::Result<SensorDescription> {
    let thickness = inches * INCH;
    let parameters = SensorDescription::digitacts_6x6().parameters().clone();
    Ok(SensorDescription::new(SensorParameters {
        layout: None,
        covering_thickness: thickness,
        point_spread: point_spread_of_covering(thickness),
        force_curve: ForceCurve::new(vec![(0.0, 0.0), (thickness, parameters.saturation)])?,
        ..parameters
    })?)
}

fn setting(inches: f64) -> anyhow::Result<Setting> {
    Ok(Setting {
        name: format!("{inches:.2} inch"),
        key: format!("{inches:.2}in_").replace('.', "_"),
        sensor: sensor_under(inches)?,
        noise_level: NoiseLevel::NONE,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner_trials::tests::small;

    #[test]
    fn the_covering_of_the_preset_is_one_of_them() {
        let preset = SensorDescription::digitacts_6x6();
        assert_eq!(setting(0.10).unwrap().sensor, preset);
        assert_eq!(setting(0.04).unwrap().sensor, SensorDescription::digitacts_6x6_thin());
    }

    #[test]
    fn a_small_run_states_every_covering() {
        let outcome = run(&small(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for key in ["0_04in", "0_10in", "0_14in", "0_20in"] {
            assert!(summary[&format!("mnti_{key}_accuracy_at_20")] > 0.3, "{summary:?}");
            assert!(summary.contains_key(&format!("mnti_{key}_explored_accuracy_at_20")));
        }
        assert_eq!(outcome.plot.matches("<polyline").count(), 2 * 16);
    }
}
