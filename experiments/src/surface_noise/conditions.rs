//! The conditions: sensors of training and of tests, and disturbances between touch and session.

use anyhow::Context as _;
use palpate_core::reading::Looseness;
use palpate_core::sensor::point_spread::point_spread_of_covering;
use palpate_core::sensor::{ForceCurve, SensorDescription, SensorParameters};
use palpate_core::units::{DEG, INCH, KPA, MM};
use palpate_recogniser::options::SurfaceOptions;
use palpate_sim::explore::Perturbation;
use palpate_sim::noise::NoiseLevel;

use crate::disturbance::{Disturbance, stated};
use crate::sensing::Sensing;

/// Row-major indices of the failing taxels in the 6 × 6 array: one in the middle, one near a
/// corner.
const FAILED: [usize; 2] = [14, 28];

/// Number of readings before the single motion of an object.
const JOLTED: usize = 10;

/// Sensor of the training readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trained {
    /// By the 6 × 6 preset.
    Preset,
    /// By the same preset with this deviation of noise, as a part of the sensing range.
    Noisy(f64),
    /// By ideal presses of the mesh: without noise and without a converter.
    Ideal,
}

impl Trained {
    /// The sensor of training.
    ///
    /// # Errors
    /// When its numbers are out of range.
    pub fn sensing(self) -> anyhow::Result<Sensing> {
        let preset = Sensing::with(SensorDescription::digitacts_6x6());
        Ok(match self {
            Self::Preset => preset,
            Self::Noisy(level) => Sensing { noise_level: noise(level)?, ..preset },
            Self::Ideal => Sensing::with(changed(|p| (p.noise, p.quantisation) = (0.0, 0.0))?),
        })
    }
}

/// One condition.
#[derive(Clone, Debug)]
pub struct Condition {
    /// Part of the summary's keys.
    pub key: &'static str,
    /// Name in plots.
    pub name: &'static str,
    /// Sensor of the training readings.
    pub trained: Trained,
    /// Sensing of the test readings.
    pub sensing: Sensing,
    /// Disturbance between a touch and the session.
    pub disturbance: Disturbance,
    /// Options of the recogniser: the defaults, or those that describe the disturbance.
    pub options: SurfaceOptions,
}

/// All conditions, for objects of a `size` in metres.
///
/// # Errors
/// When a sensor's numbers are out of range.
pub fn conditions(size: f64) -> anyhow::Result<Vec<Condition>> {
    let preset = Sensing::with(SensorDescription::digitacts_6x6());
    let (trained, disturbance) = (Trained::Preset, Disturbance::None);
    let options = SurfaceOptions::default();
    let tested =
        |key, name, sensing| Condition { key, name, trained, sensing, disturbance, options };
    let disturbed = |key, name, disturbance| {
        let sensing = preset.clone();
        Condition { key, name, trained, sensing, disturbance, options }
    };
    let arm = |mm: f64, deg: f64| Disturbance::Arm { position: mm * MM, angle: deg * DEG };
    let noisy = |key, name, level: f64| -> anyhow::Result<Condition> {
        let trained = Trained::Noisy(level);
        let sensing = trained.sensing()?;
        Ok(Condition { key, name, trained, sensing, disturbance, options })
    };
    let base = Looseness { position: 5.0 * MM, angle: 3.0 * DEG };
    let robots = |is_told| Disturbance::Robots { robots: 3, base, is_told };
    let moving =
        |share: f64, deg: f64| Perturbation { angle_max: deg * DEG, shift_max: share * size };
    let jolt = |is_told| Disturbance::Jolt { by: moving(1.0, 60.0), after: JOLTED, is_told };
    let moves = moving(0.1, 10.0);
    let told = SurfaceOptions { motion: Some(stated(&moves)), ..options };
    Ok(vec![
        tested("clean", "nothing wrong", preset.clone()),
        noisy("noise_10", "noise 10 %", 0.1)?,
        noisy("noise_20", "noise 20 %", 0.2)?,
        noisy("noise_40", "noise 40 %", 0.4)?,
        tested(
            "untold_noise_20",
            "noise 20 %, untold",
            Sensing { noise_level: noise(0.2)?, ..preset.clone() },
        ),
        disturbed("arm_0_5mm_1deg", "arm 0.5 mm, 1 deg", arm(0.5, 1.0)),
        disturbed("arm_1mm_2deg", "arm 1 mm, 2 deg", arm(1.0, 2.0)),
        disturbed("arm_2mm_4deg", "arm 2 mm, 4 deg", arm(2.0, 4.0)),
        disturbed("moving", "object moves", Disturbance::Moving(moves)),
        Condition {
            options: told,
            ..disturbed("moving_told", "object moves, told", Disturbance::Moving(moves))
        },
        // Not an amplitude of the recogniser's: between two of them, and above all of them.
        disturbed("little_moving", "moves little", Disturbance::Moving(moving(0.05, 5.0))),
        disturbed("far_moving", "moves far", Disturbance::Moving(moving(0.4, 40.0))),
        disturbed("jolt", "moves once", jolt(false)),
        disturbed("jolt_told", "moves once, told", jolt(true)),
        disturbed("robots", "three robots, bases off", robots(false)),
        disturbed("robots_told", "three robots, told", robots(true)),
        tested("fine_14x14", "14 x 14 taxels", Sensing::with(SensorDescription::fingertip_14x14())),
        tested("thin_covering", "covering 0.04 in", Sensing::with(covered(0.04 * INCH)?)),
        tested("thick_covering", "covering 0.20 in", Sensing::with(covered(0.20 * INCH)?)),
        tested("gains_20", "gains off by 20 %", Sensing { gain_spread: 0.2, ..preset.clone() }),
        tested(
            "dead_taxels",
            "two dead taxels",
            Sensing { dead: FAILED.to_vec(), ..preset.clone() },
        ),
        tested(
            "missing_taxels",
            "two, and known",
            Sensing { missing: FAILED.to_vec(), ..preset.clone() },
        ),
        Condition {
            key: "cad_shifted",
            name: "from CAD, shifted",
            trained: Trained::Ideal,
            sensing: Sensing { gain_spread: 0.05, ..Sensing::with(shifted()?) },
            disturbance,
            options,
        },
    ])
}

fn noise(level: f64) -> anyhow::Result<NoiseLevel> {
    NoiseLevel::new(level).context("a level from 0 to 2")
}

fn changed(change: impl FnOnce(&mut SensorParameters)) -> anyhow::Result<SensorDescription> {
    let mut parameters = SensorDescription::digitacts_6x6().parameters().clone();
    change(&mut parameters);
    Ok(SensorDescription::new(parameters)?)
}

/// The 6 × 6 sensor under another covering, metres; full scale is a full indentation.
fn covered(thickness: f64) -> anyhow::Result<SensorDescription> {
    let saturation = SensorDescription::digitacts_6x6().parameters().saturation;
    let force_curve = ForceCurve::new(vec![(0.0, 0.0), (thickness, saturation)])?;
    changed(|parameters| {
        parameters.covering_thickness = thickness;
        parameters.point_spread = point_spread_of_covering(thickness);
        parameters.force_curve = force_curve;
    })
}

/// The array of section 4.4.4.3's test: it answers with the square of the indentation, has
/// noise of 0.2 kPa and steps of 0.08 kPa.
fn shifted() -> anyhow::Result<SensorDescription> {
    let parameters = SensorDescription::digitacts_6x6().parameters().clone();
    let (thickness, saturation) = (parameters.covering_thickness, parameters.saturation);
    let knot = |n: u32| {
        let share = f64::from(n) / 16.0;
        (share * thickness, share.powi(2) * saturation)
    };
    let force_curve = ForceCurve::new((0..=16).map(knot).collect())?;
    changed(|parameters| {
        parameters.force_curve = force_curve;
        (parameters.noise, parameters.quantisation) = (0.2 * KPA, 0.08 * KPA);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_what_their_keys_say() {
        let all = conditions(80.0 * MM).unwrap();
        let find = |key: &str| all.iter().find(|c| c.key == key).unwrap();
        let mut keys: Vec<&str> = all.iter().map(|c| c.key).collect();
        keys.dedup();
        assert_eq!(keys.len(), 23);
        let Disturbance::Moving(moves) = find("moving").disturbance else { panic!("moves") };
        assert!((moves.shift_max - 8.0 * MM).abs() < 1e-12);
        assert_eq!(find("fine_14x14").sensing.sensor.grid().n_taxels(), 196);
        // Half of the indentation reads as a quarter of the range.
        let curve = find("cad_shifted").sensing.sensor.parameters().force_curve.clone();
        assert!((curve.pressure(0.5 * 2.54 * MM) / (5.0 * KPA) - 1.0).abs() < 1e-9);
        assert!(find("cad_shifted").trained.sensing().unwrap().sensor.parameters().noise == 0.0);
    }
}
