//! Training touches by many sensors of a family.
//!
//! A map must not depend on what is unknown about the sensor, so sensors change every few
//! touches. A session has one sensor, so readings for calibration come in runs by one sensor.

use std::borrow::Cow;
use std::ops::ControlFlow;

use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorFamily;

use super::{SampleError, SamplerConfig, sample, sample_with};
use crate::press::PressSimulator;

/// Takes `n` readings as [`sample`] does, but every few attempts with another sensor of the
/// family. `simulator` has the family's description.
///
/// # Errors
/// [`SampleError`] when too many attempts fail or `progress` stops.
pub fn sample_family(
    simulator: &PressSimulator,
    family: &SensorFamily,
    sensor: SensorId,
    n: usize,
    seed: u64,
    config: &SamplerConfig,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Vec<Reading>, SampleError> {
    if family.is_single() {
        return sample(simulator, sensor, n, seed, config, progress);
    }
    let drawn = |index| Cow::Owned(one_of(simulator, family, seed, index as u64));
    sample_with(&drawn, simulator.surface(), sensor, n, seed, config, progress)
}

/// Turns the seed of an object's touches into that of the further ones of its surface.
const FURTHER: u64 = 1 << 62;

/// Takes the readings that an object is trained from, as [`sample_family`] does: `n` for all methods,
/// which do not depend on the others, and `further` ones for its surface alone. `progress` counts
/// both together.
///
/// # Errors
/// As [`sample_family`].
pub fn sample_training(
    simulator: &PressSimulator,
    family: &SensorFamily,
    sensor: SensorId,
    [n, further]: [usize; 2],
    seed: u64,
    config: &SamplerConfig,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<[Vec<Reading>; 2], SampleError> {
    let mut part = |before: usize, n: usize, seed: u64| {
        let mut heard = |taken: usize, _: usize| progress(before + taken, before + n);
        sample_family(simulator, family, sensor, n, seed, config, &mut heard)
    };
    let for_all = part(0, n, seed)?;
    let of_surface = if further > 0 { part(n, further, seed ^ FURTHER)? } else { Vec::new() };
    Ok([for_all, of_surface])
}

/// Takes `runs` runs of `touches` readings, each run by one sensor of the family. A sensor that
/// cannot touch the object often enough is replaced by another one.
///
/// # Errors
/// [`SampleError`] when more sensors fail than succeed or `progress`, called once a run, stops.
pub fn sample_runs(
    simulator: &PressSimulator,
    family: &SensorFamily,
    sensor: SensorId,
    (runs, touches): (usize, usize),
    seed: u64,
    config: &SamplerConfig,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Vec<Reading>, SampleError> {
    let mut readings = Vec::with_capacity(runs * touches);
    for run in 0..2 * runs {
        if readings.len() == runs * touches {
            break;
        }
        // Other streams than those of training with this seed.
        let seed = (!seed).wrapping_add((run as u64) << 32);
        let pressed = one_of(simulator, family, seed, run as u64);
        let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
        if let Ok(taken) = sample(&pressed, sensor, touches, seed, config, &mut go_on) {
            readings.extend(taken);
        }
        if progress(readings.len(), runs * touches).is_break() {
            let (accepted, wanted) = (readings.len(), runs * touches);
            return Err(SampleError::Stopped { accepted, wanted });
        }
    }
    match readings.len() {
        n if n == runs * touches => Ok(readings),
        accepted => Err(SampleError::TooFewTouches {
            accepted,
            wanted: runs * touches,
            attempts: 2 * runs * touches,
        }),
    }
}

/// The object of `simulator` under the family's sensor with the given index.
fn one_of(
    simulator: &PressSimulator,
    family: &SensorFamily,
    seed: u64,
    index: u64,
) -> PressSimulator {
    let mut stream = Stream::new(seed, Purpose::SensorFamily, index);
    let drawn = family.draw(&mut stream);
    simulator.with_sensor(drawn, &mut stream)
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::{Preset, SensorDescription, SensorKnowledge};
    use palpate_core::units::MM;

    use super::*;
    use crate::mesh::tests_support::sphere;

    fn family(knowledge: SensorKnowledge) -> SensorFamily {
        SensorFamily::new(SensorDescription::digitacts_6x6(), knowledge)
    }

    fn sampled(knowledge: SensorKnowledge, n: usize) -> Vec<Reading> {
        let simulator =
            PressSimulator::new(sphere(20.0 * MM, 60), SensorDescription::digitacts_6x6());
        let config = SamplerConfig::for_simulator(&simulator);
        let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
        let family = family(knowledge);
        sample_family(&simulator, &family, SensorId(0), n, 7, &config, &mut go_on).unwrap()
    }

    /// Standard deviation over readings of the sensor's distance from a sphere's surface, m.
    fn depth_deviation(readings: &[Reading]) -> f64 {
        let depths: Vec<f64> = readings
            .iter()
            .map(|r| 20.0 * MM - r.session_from_sensor().translation.length())
            .collect();
        let mean = depths.iter().sum::<f64>() / depths.len() as f64;
        (depths.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / depths.len() as f64).sqrt()
    }

    #[test]
    fn softer_and_stiffer_sensors_come_to_rest_at_other_depths() {
        let [one, many] = [SensorKnowledge::Measured, SensorKnowledge::DataSheet]
            .map(|knowledge| depth_deviation(&sampled(knowledge, 64)));
        assert!(one < 0.1 * MM && many > 0.2 * MM, "{one} m and {many} m");
    }

    #[test]
    fn families_of_all_presets_touch_a_ball() {
        for name in Preset::NAMES {
            let Preset { description, ranges } = Preset::named(name).unwrap();
            let sheet = SensorKnowledge::DataSheet;
            let family = SensorFamily::within(description.clone(), sheet, &ranges);
            let simulator = PressSimulator::new(sphere(25.0 * MM, 60), description);
            let config = SamplerConfig::for_simulator(&simulator);
            let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
            let taken = sample_family(&simulator, &family, SensorId(0), 32, 3, &config, &mut go_on);
            let readings = taken.unwrap_or_else(|error| panic!("{name}: {error}"));
            let floor = simulator.sensor().contact_floor();
            assert!(readings.iter().all(|reading| reading.image().max() > floor), "{name}");
        }
    }

    #[test]
    fn a_run_is_of_one_sensor() {
        let simulator =
            PressSimulator::new(sphere(20.0 * MM, 60), SensorDescription::digitacts_6x6());
        let config = SamplerConfig::for_simulator(&simulator);
        let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
        let family = family(SensorKnowledge::DataSheet);
        let readings =
            sample_runs(&simulator, &family, SensorId(0), (4, 8), 7, &config, &mut go_on).unwrap();
        assert_eq!(readings.len(), 32);
        let within: f64 = readings.chunks(8).map(depth_deviation).sum::<f64>() / 4.0;
        assert!(within < 0.5 * depth_deviation(&readings), "{within} m");
    }

    #[test]
    fn touches_for_the_surface_leave_the_others_as_they_are() {
        let simulator =
            PressSimulator::new(sphere(20.0 * MM, 60), SensorDescription::digitacts_6x6());
        let config = SamplerConfig::for_simulator(&simulator);
        let mut counted = Vec::new();
        let mut count = |taken: usize, wanted: usize| {
            counted.push((taken, wanted));
            ControlFlow::Continue(())
        };
        let (id, family) = (SensorId(0), family(SensorKnowledge::DataSheet));
        let both = sample_training(&simulator, &family, id, [12, 8], 7, &config, &mut count);
        let [for_all, of_surface] = both.unwrap();
        let alone = sampled(SensorKnowledge::DataSheet, 12);
        assert_eq!(for_all, alone);
        assert_eq!(of_surface.len(), 8);
        assert!(of_surface.iter().all(|reading| !alone.contains(reading)));
        assert_eq!(counted.last(), Some(&(20, 20)));
    }
}
