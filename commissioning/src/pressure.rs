//! The unit of pressure: from the converter's steps and from the level of a settled press.
//!
//! A press that came to rest has its largest pressure somewhere in the sensor's range. Values
//! in steps tell the unit exactly if the description states the converter's step.

use palpate_core::sensor::SensorDescription;

use crate::estimate::{Choice, posterior};

/// Usual largest pressure of a settled press, as a share of saturation, and the deviation of
/// its logarithm. Chosen: 0.08 to 1 are within two deviations below; robots press lightly or
/// firmly.
const LEVEL: (f64, f64) = (0.4, 0.8);

/// Prior probability that pressures are in pascal. Chosen: what people get wrong is rare in
/// each of them.
const STATED: f64 = 0.9;

/// Relative deviation at which a step counts as that of the description. Chosen: the nearest
/// other candidates (counts of 10 and of 12 bits) are a factor of four apart.
const STEP_TOLERANCE: f64 = 0.02;

/// Log-likelihood lost when a sent step contradicts the stated one. Chosen: a described step is
/// wrong more often than a level is far off; both count.
const STEP_LOSS: f64 = 6.0;

/// Unit of sent pressures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PressureUnit {
    /// Pascal, as the API expects.
    Pascal,
    /// Kilopascal.
    Kilopascal,
    /// Bar.
    Bar,
    /// Pounds per square inch.
    Psi,
    /// Newtons on each taxel's area.
    NewtonPerTaxel,
    /// Counts of a converter with this many bits over the whole range.
    Counts {
        /// Bits of the converter.
        bits: u32,
    },
}

impl PressureUnit {
    /// Every unit.
    pub const ALL: [Self; 9] = [
        Self::Pascal,
        Self::Kilopascal,
        Self::Bar,
        Self::Psi,
        Self::NewtonPerTaxel,
        Self::Counts { bits: 8 },
        Self::Counts { bits: 10 },
        Self::Counts { bits: 12 },
        Self::Counts { bits: 16 },
    ];

    /// Pascals in one unit, for a sensor with this description.
    #[must_use]
    pub fn pascals(self, sensor: &SensorDescription) -> f64 {
        match self {
            Self::Pascal => 1.0,
            Self::Kilopascal => 1e3,
            Self::Bar => 1e5,
            Self::Psi => 6_894.757,
            Self::NewtonPerTaxel => sensor.grid().taxel_width.powi(-2),
            Self::Counts { bits } => sensor.parameters().saturation / f64::from(bits).exp2(),
        }
    }
}

/// The unit of images in the numbers that were sent.
pub(crate) fn unit(
    images: &[Vec<Option<f64>>],
    sensor: &SensorDescription,
) -> Choice<PressureUnit> {
    let level = typical_peak(images);
    let step = step(images);
    let described = sensor.parameters().quantisation;
    let alternatives = PressureUnit::ALL.map(|unit| {
        let factor = unit.pascals(sensor);
        let share = level * factor / sensor.parameters().saturation;
        let off = (share.max(f64::MIN_POSITIVE) / LEVEL.0).ln() / LEVEL.1;
        // Tails of a Cauchy: a level far from the usual one is odd, not impossible.
        let mut log = -(1.0 + off * off).ln() - 0.5 * off.powi(2).min(25.0);
        if let Some(step) = step
            && described > 0.0
        {
            let ratio = step * factor / described;
            let is_multiple = ratio > 0.5 && (ratio / ratio.round() - 1.0).abs() < STEP_TOLERANCE;
            log -= if is_multiple { ratio.ln().max(0.0) } else { STEP_LOSS };
        }
        let is_counted = matches!(unit, PressureUnit::Counts { .. });
        if is_counted && step.is_none_or(|step| (step / step.round() - 1.0).abs() > 1e-6) {
            log -= 4.0 * STEP_LOSS;
        }
        let prior = if unit == PressureUnit::Pascal { STATED } else { (1.0 - STATED) / 8.0 };
        (log, prior)
    });
    let probabilities = posterior(&alternatives);
    let (best, probability) = probabilities
        .iter()
        .copied()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0, 1.0));
    Choice { value: PressureUnit::ALL[best], probability, stated: PressureUnit::Pascal }
}

/// Median over touches of the largest sent value.
fn typical_peak(images: &[Vec<Option<f64>>]) -> f64 {
    let peak = |image: &Vec<Option<f64>>| image.iter().flatten().copied().fold(0.0, f64::max);
    let mut peaks: Vec<f64> = images.iter().map(peak).collect();
    peaks.sort_by(f64::total_cmp);
    peaks.get(peaks.len() / 2).copied().unwrap_or(0.0)
}

/// The common step of all values, if they come in steps.
fn step(images: &[Vec<Option<f64>>]) -> Option<f64> {
    let mut values: Vec<f64> = images.iter().flatten().flatten().copied().collect();
    values.sort_by(f64::total_cmp);
    let largest = values.last().copied()?;
    let apart = |pair: &[f64]| pair[1] - pair[0];
    let least = values
        .windows(2)
        .map(apart)
        .filter(|apart| *apart > 1e-6 * largest)
        .fold(f64::INFINITY, f64::min);
    // Rounding of sent decimals: a step is known to a part of the multiples it is counted in.
    let is_multiple = |value: &f64| {
        let steps = value / least;
        (steps - steps.round()).abs() < 0.02 + 1e-4 * steps
    };
    let n_off = values.iter().filter(|value| !is_multiple(value)).count();
    let is_stepped = least.is_finite() && 100 * n_off <= values.len() && largest < 5e3 * least;
    is_stepped.then_some(least)
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::SensorParameters;

    use super::*;
    use crate::estimate::Verdict;

    fn images(factor: f64, step: f64) -> Vec<Vec<Option<f64>>> {
        let value = |touch: usize, taxel: usize| {
            let pascal = 300.0 * taxel as f64 * (1.0 - 0.02 * touch as f64);
            let stepped = if step > 0.0 { (pascal / step).round() * step } else { pascal };
            Some(stepped * factor)
        };
        (0..20).map(|touch| (0..36).map(|taxel| value(touch, taxel)).collect()).collect()
    }

    #[test]
    fn each_unit_is_found_by_the_steps() {
        let sensor = SensorDescription::digitacts_6x6();
        for unit in PressureUnit::ALL
            .into_iter()
            .filter(|u| !matches!(u, PressureUnit::Counts { bits: 10 | 12 | 16 }))
        {
            let step = sensor.parameters().quantisation;
            let found = super::unit(&images(1.0 / unit.pascals(&sensor), step), &sensor);
            assert_eq!(found.value, unit, "{found:?}");
            assert!(found.verdict() != Verdict::Undetermined, "{found:?}");
        }
    }

    #[test]
    fn without_steps_the_level_tells_kilopascal_from_pascal() {
        let parameters = SensorDescription::digitacts_6x6().parameters().clone();
        let smooth = SensorParameters { quantisation: 0.0, ..parameters };
        let smooth = SensorDescription::new(smooth).unwrap();
        let right = super::unit(&images(1.0, 0.0), &smooth);
        assert_eq!((right.value, right.verdict()), (PressureUnit::Pascal, Verdict::Right));
        let kilo = super::unit(&images(1e-3, 0.0), &smooth);
        assert_eq!(kilo.value, PressureUnit::Kilopascal, "{kilo:?}");
    }
}
