//! From blurred displacement to what the sensor's electronics report.
//!
//! Order: force curve, noise, clipping to 0 … saturation, steps of the converter. Source:
//! section 2.5.1; the noise level of section 4.4.2.7 is the total width of a uniform
//! distribution as a part of the sensing range (`docs/equations.md`).

use palpate_core::rng::Stream;
use palpate_core::sensor::SensorDescription;

/// Noise beyond what the sensor's description gives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NoiseLevel(f64);

impl NoiseLevel {
    /// Only the sensor's own noise.
    pub const NONE: Self = Self(0.0);

    /// A level as a part of the sensing range: at 0.4, half the range reads as 0.3 to 0.7 of
    /// it. `None` unless `level` is within 0 ..= 2.
    #[must_use]
    pub fn new(level: f64) -> Option<Self> {
        (0.0..=2.0).contains(&level).then_some(Self(level))
    }

    /// The greatest deviation it adds under a sensor's `saturation`, pascal.
    #[must_use]
    pub fn half_width(self, saturation: f64) -> f64 {
        0.5 * self.0 * saturation
    }
}

/// The pressure (pascal) a taxel reports at a blurred displacement (metres).
pub(crate) fn measured_pressure(
    displacement: f64,
    sensor: &SensorDescription,
    level: NoiseLevel,
    stream: &mut Stream,
) -> f64 {
    let parameters = sensor.parameters();
    let mut pressure = parameters.force_curve.pressure(displacement);
    if parameters.noise > 0.0 {
        pressure += parameters.noise * stream.normal();
    }
    let half_width = level.half_width(parameters.saturation);
    if half_width > 0.0 {
        pressure += stream.uniform(-half_width, half_width);
    }
    let clipped = pressure.clamp(0.0, parameters.saturation);
    if parameters.quantisation > 0.0 {
        let steps = (clipped / parameters.quantisation).round();
        (steps * parameters.quantisation).min(parameters.saturation)
    } else {
        clipped
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
        let mut measured = |d| measured_pressure(d, &sensor, NoiseLevel::NONE, &mut stream);
        assert!((measured(1.0 * MM) - 8.0 * KPA).abs() < 1e-9);
        assert!((measured(9.0 * MM) - 20.0 * KPA).abs() < 1e-9);
        assert!(measured(-MM).abs() < 1e-9);
    }

    #[test]
    fn forty_percent_noise_takes_half_the_range_to_three_to_seven_tenths() {
        let mut stream = Stream::new(1, Purpose::SensorNoise, 0);
        let sensor = sensor(0.0, 0.0);
        let level = NoiseLevel::new(0.4).unwrap();
        let drawn: Vec<f64> =
            (0..4000).map(|_| measured_pressure(1.27 * MM, &sensor, level, &mut stream)).collect();
        let (low, high) =
            drawn.iter().fold((f64::MAX, 0.0f64), |(low, high), p| (low.min(*p), high.max(*p)));
        assert!((6.0 * KPA..6.1 * KPA).contains(&low), "{low}");
        assert!((13.9 * KPA..=14.0 * KPA).contains(&high), "{high}");
    }

    #[test]
    fn levels_out_of_range_do_not_exist() {
        assert_eq!(NoiseLevel::new(-0.1), None);
        assert_eq!(NoiseLevel::new(f64::NAN), None);
    }
}
