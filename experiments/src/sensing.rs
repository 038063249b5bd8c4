//! Sensors that differ from that of training: another covering, other physics, and taxels with
//! too high, too low or no response.

use std::ops::ControlFlow;

use anyhow::Context as _;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_sim::noise::{NoiseLevel, taxel_gains};
use palpate_sim::press::{Physics, PressConfig, PressSimulator};
use palpate_sim::sampler::{SamplerConfig, sample};
use rayon::prelude::*;

use crate::objects::TestObject;

/// Sensor, noise and physics of readings.
#[derive(Clone, Debug)]
pub struct Sensing {
    /// The sensor as it is built.
    pub sensor: SensorDescription,
    /// Noise beyond its own, which the controllers feel too.
    pub noise_level: NoiseLevel,
    /// Physics of its covering.
    pub physics: Physics,
    /// Standard deviation of the taxels' gains about 1; the controllers do not feel it.
    pub gain_spread: f64,
    /// Standard deviation of each taxel's noise in proportion to its pressure; the controllers do
    /// not feel it.
    pub relative_noise: f64,
    /// Standard deviation of the taxels' offsets, as a share of the range; the controllers do not
    /// feel them.
    pub offset_spread: f64,
    /// Row-major indices of dead taxels that are not reported as missing.
    pub dead: Vec<usize>,
    /// Row-major indices of taxels that are known to be missing.
    pub missing: Vec<usize>,
}

impl Sensing {
    /// A sensor as it is described, in the physics of training.
    #[must_use]
    pub fn with(sensor: SensorDescription) -> Self {
        Self {
            sensor,
            noise_level: NoiseLevel::NONE,
            physics: Physics::PointSpread,
            gain_spread: 0.0,
            relative_noise: 0.0,
            offset_spread: 0.0,
            dead: Vec::new(),
            missing: Vec::new(),
        }
    }

    /// The simulator of an object under this sensor.
    #[must_use]
    pub fn simulator(&self, object: &TestObject) -> PressSimulator {
        let press = PressConfig {
            noise_level: self.noise_level,
            physics: self.physics,
            ..PressConfig::for_sensor(&self.sensor)
        };
        PressSimulator::with_config(object.mesh.clone(), self.sensor.clone(), press)
    }

    /// `n` converged readings of each object by the training sampler, from one seed; gains are
    /// drawn from the seed too.
    ///
    /// # Errors
    /// When the sampler gives up: an object cannot be touched often enough.
    pub fn touch_all(
        &self,
        objects: &[TestObject],
        n: usize,
        seed: u64,
    ) -> anyhow::Result<Vec<Vec<Reading>>> {
        let touch = |(number, object): (usize, &TestObject)| {
            let simulator = self.simulator(object);
            let config = SamplerConfig::for_simulator(&simulator);
            let mut go_on = |_done: usize, _total: usize| ControlFlow::Continue(());
            let readings = sample(&simulator, SensorId(0), n, seed, &config, &mut go_on)
                .with_context(|| format!("cannot touch {} {n} times", object.name))?;
            self.as_taxels_give(&readings, number, seed)
        };
        objects.par_iter().enumerate().map(touch).collect()
    }

    /// Readings of the simulator, of the object with this number, as the taxels give them: with
    /// gains, offsets, relative noise, dead and missing taxels, all drawn from the seed.
    ///
    /// # Errors
    /// When more taxels are missing than a reading permits.
    pub fn as_taxels_give(
        &self,
        readings: &[Reading],
        object: usize,
        seed: u64,
    ) -> anyhow::Result<Vec<Reading>> {
        let taxels = self.taxels(seed);
        let one = |(index, reading): (usize, &Reading)| {
            let number = ((object as u64) << 32) | index as u64;
            let mut stream = Stream::new(seed, Purpose::SensorNoise, number);
            self.altered(reading, &taxels, &mut stream)
        };
        readings.iter().enumerate().map(one).collect()
    }

    /// Gain and offset (Pa) of each taxel.
    fn taxels(&self, seed: u64) -> Vec<(f64, f64)> {
        let mut stream = Stream::new(seed, Purpose::TaxelGains, 0);
        let gains = taxel_gains(self.sensor.grid().n_taxels(), self.gain_spread, &mut stream);
        let spread = self.offset_spread * self.sensor.parameters().saturation;
        let mut offset = || if spread > 0.0 { spread * stream.normal() } else { 0.0 };
        gains.into_iter().map(|gain| (gain, offset())).collect()
    }

    /// A reading as the taxels give it.
    fn altered(
        &self,
        reading: &Reading,
        taxels: &[(f64, f64)],
        stream: &mut Stream,
    ) -> anyhow::Result<Reading> {
        let saturation = self.sensor.parameters().saturation;
        let mut noise = || if self.relative_noise > 0.0 { stream.normal() } else { 0.0 };
        let taxel = |(at, pressure): (usize, &f64)| {
            let (gain, offset) = taxels[at];
            let factor = gain * (1.0 + self.relative_noise * noise()).max(0.0);
            match at {
                at if self.missing.contains(&at) => None,
                at if self.dead.contains(&at) => Some(0.0),
                _ => Some((factor * pressure + offset).min(saturation)),
            }
        };
        let pressures: Vec<Option<f64>> =
            reading.image().pressures.iter().enumerate().map(taxel).collect();
        let (id, pose) = (reading.sensor(), reading.session_from_sensor());
        Reading::new(id, &self.sensor, &pressures, pose).context("an altered image fits")
    }
}

#[cfg(test)]
mod tests {
    use palpate_sim::shapes;

    use super::*;
    use crate::objects::generated;

    #[test]
    fn dead_missing_and_scaled_taxels_read_as_told() {
        let objects = &generated(&["hammer"], shapes::LARGEST_DIMENSION).unwrap();
        let plain = Sensing::with(SensorDescription::digitacts_6x6());
        let odd = Sensing {
            dead: vec![14],
            missing: vec![21],
            gain_spread: 0.2,
            offset_spread: 0.01,
            ..plain.clone()
        };
        let [felt, altered] = [&plain, &odd].map(|s| s.touch_all(objects, 20, 7).unwrap());
        let taxels = odd.taxels(7);
        assert!(taxels.iter().any(|(gain, _)| (gain - 1.0).abs() > 0.1), "{taxels:?}");
        assert!(taxels.iter().any(|(_, offset)| offset.abs() > 100.0), "{taxels:?}");
        for (before, after) in felt[0].iter().zip(&altered[0]) {
            let (was, is) = (&before.image().pressures, &after.image().pressures);
            assert!(is[14].abs() < 1e-12 && after.missing()[21] && !after.missing()[14]);
            assert!((is[0] - (taxels[0].0 * was[0] + taxels[0].1).min(20e3)).abs() < 1e-9);
            assert_eq!(before.session_from_sensor(), after.session_from_sensor());
        }
    }

    #[test]
    fn relative_noise_scales_each_pressure_by_itself() {
        let objects = &generated(&["hammer"], shapes::LARGEST_DIMENSION).unwrap();
        let plain = Sensing::with(SensorDescription::digitacts_6x6());
        let noisy = Sensing { relative_noise: 0.02, ..plain.clone() };
        let [felt, altered] = [&plain, &noisy].map(|s| s.touch_all(objects, 40, 7).unwrap());
        let mut ratios = Vec::new();
        for (before, after) in felt[0].iter().zip(&altered[0]) {
            let pairs = before.image().pressures.iter().zip(&after.image().pressures);
            ratios.extend(pairs.filter(|(was, _)| **was > 1e3).map(|(was, is)| is / was - 1.0));
        }
        let n = ratios.len() as f64;
        assert!(n > 200.0, "{n}");
        let deviation = (ratios.iter().map(|ratio| ratio * ratio).sum::<f64>() / n).sqrt();
        // The deviation of more than 200 numbers is within 5 % of the truth, three times over.
        assert!((0.017..0.023).contains(&deviation), "{deviation}");
    }
}
