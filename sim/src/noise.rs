//! The sensor's electronics: from the pressure on a taxel to its reported value.
//!
//! Order: noise, clipping to 0 … saturation, steps of the converter. Source: section 2.5.1.
//! The noise level of section 4.4.2.7 is the total width of a uniform distribution as a
//! fraction of the sensing range (`docs/equations.md`).

use palpate_core::rng::Stream;
use palpate_core::sensor::SensorDescription;

/// Noise added to that of the sensor's description.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseLevel(f64);

impl NoiseLevel {
    /// Only the sensor's own noise.
    pub const NONE: Self = Self(0.0);

    /// A level as a fraction of the sensing range: at 0.4, half the range reads as 0.3 to 0.7
    /// of it. `None` unless `level` is within 0 ..= 2.
    #[must_use]
    pub fn new(level: f64) -> Option<Self> {
        (0.0..=2.0).contains(&level).then_some(Self(level))
    }

    /// The largest added deviation for a sensor's `saturation`, pascal.
    #[must_use]
    pub fn half_width(self, saturation: f64) -> f64 {
        0.5 * self.0 * saturation
    }
}

/// Gains of a sensor's taxels: about 1 with the standard deviation `spread`, truncated at three
/// deviations and never negative.
#[must_use]
pub fn taxel_gains(n_taxels: usize, spread: f64, stream: &mut Stream) -> Vec<f64> {
    (0..n_taxels).map(|_| (1.0 + spread * stream.normal().clamp(-3.0, 3.0)).max(0.0)).collect()
}

/// The parameters of the electronics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Electronics {
    /// Standard deviation of the additive noise, pascal.
    pub(crate) noise: f64,
    /// Upper limit of a reported value, pascal.
    pub(crate) saturation: f64,
    /// Step of the converter, pascal; 0 for a continuous sensor.
    pub(crate) quantisation: f64,
}

impl Electronics {
    /// The electronics of a sensor's description.
    pub(crate) fn of(sensor: &SensorDescription) -> Self {
        let parameters = sensor.parameters();
        let (noise, saturation) = (parameters.noise, parameters.saturation);
        Self { noise, saturation, quantisation: parameters.quantisation }
    }

    /// The value (pascal) reported for a `pressure`.
    pub(crate) fn reported(&self, pressure: f64, level: NoiseLevel, stream: &mut Stream) -> f64 {
        let mut pressure = pressure;
        if self.noise > 0.0 {
            pressure += self.noise * stream.normal();
        }
        let half_width = level.half_width(self.saturation);
        if half_width > 0.0 {
            pressure += stream.uniform(-half_width, half_width);
        }
        let clipped = pressure.clamp(0.0, self.saturation);
        if self.quantisation > 0.0 {
            let steps = (clipped / self.quantisation).round();
            (steps * self.quantisation).min(self.saturation)
        } else {
            clipped
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::Purpose;
    use palpate_core::sensor::SensorParameters;
    use palpate_core::units::{KPA, MM};

    use super::*;

    fn sensor(noise: f64, quantisation: f64) -> SensorDescription {
        let parameters = SensorDescription::digitacts_6x6().parameters().clone();
        SensorDescription::new(SensorParameters { noise, quantisation, ..parameters }).unwrap()
    }

    #[test]
    fn pressures_are_clipped_and_come_in_steps() {
        let mut stream = Stream::new(1, Purpose::SensorNoise, 0);
        let sensor = sensor(0.0, 1.0 * KPA);
        // 20 kPa over 2.54 mm: 1 mm gives 7.874 kPa, the nearest step is 8 kPa.
        let curve = &sensor.parameters().force_curve;
        let electronics = Electronics::of(&sensor);
        let mut measured =
            |d| electronics.reported(curve.pressure(d), NoiseLevel::NONE, &mut stream);
        assert!((measured(1.0 * MM) - 8.0 * KPA).abs() < 1e-9);
        assert!((measured(9.0 * MM) - 20.0 * KPA).abs() < 1e-9);
        assert!(measured(-MM).abs() < 1e-9);
    }

    #[test]
    fn forty_percent_noise_spreads_half_range_over_0_3_to_0_7() {
        let mut stream = Stream::new(1, Purpose::SensorNoise, 0);
        let sensor = sensor(0.0, 0.0);
        let level = NoiseLevel::new(0.4).unwrap();
        let electronics = Electronics::of(&sensor);
        let drawn: Vec<f64> =
            (0..4000).map(|_| electronics.reported(10.0 * KPA, level, &mut stream)).collect();
        let (low, high) =
            drawn.iter().fold((f64::MAX, 0.0f64), |(low, high), p| (low.min(*p), high.max(*p)));
        assert!((6.0 * KPA..6.1 * KPA).contains(&low), "{low}");
        assert!((13.9 * KPA..=14.0 * KPA).contains(&high), "{high}");
    }

    #[test]
    fn levels_out_of_range_are_refused() {
        assert_eq!(NoiseLevel::new(-0.1), None);
        assert_eq!(NoiseLevel::new(f64::NAN), None);
    }
}
