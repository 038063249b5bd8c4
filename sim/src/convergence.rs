//! Convergence of the contact controllers under noise, and the repeatability of their results.
//!
//! Source: section 4.4.3, figure 4.17: touches from random starts until a given number
//! converge. The noise level is the total width of a uniform distribution as a fraction of
//! the observed range of forces (`docs/equations.md`). Added: the displacement of the
//! sensor's rest by noise.

use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::DEG;
use rayon::prelude::*;

use crate::controller::{ContactConfig, Idle, Outcome, touch};
use crate::noise::NoiseLevel;
use crate::press::PressSimulator;
use crate::sampler::{SamplerConfig, start_at};

/// Pressure above which the controllers take a taxel to be in contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactRule {
    /// The threshold without noise, as far as the dissertation says: noise is not considered.
    Unaware,
    /// A threshold above what noise alone can reach, as elsewhere for noisy sensors.
    AboveNoise,
}

/// Number and kind of the touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConvergenceConfig {
    /// Touches that must converge; 100 in the dissertation.
    pub successes: usize,
    /// Maximum number of touches.
    pub attempts_max: usize,
    /// Largest tilt of a start away from the surface's normal, radians.
    pub tilt_max: f64,
    /// The controllers' contact threshold.
    pub rule: ContactRule,
    /// The rule that ends a touch.
    pub idle: Idle,
}

impl Default for ConvergenceConfig {
    /// As printed.
    fn default() -> Self {
        Self {
            successes: 100,
            attempts_max: 5000,
            tilt_max: 30.0 * DEG,
            rule: ContactRule::Unaware,
            idle: Idle::Consecutive,
        }
    }
}

/// Results of the touches at one noise level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Width of the noise as a fraction of the observed range of forces.
    pub level: f64,
    /// Number of touches.
    pub attempts: usize,
    /// Number of touches that converged.
    pub converged: usize,
    /// Number of converged touches with the object in the covering; the others came to rest
    /// on noise alone.
    pub touching: usize,
    /// Mean rounds of Press and Orient of the converged touches.
    pub rounds_mean: f64,
    /// Mean commands of Press and Orient of the converged touches.
    pub commands_mean: f64,
    /// Median angle between the sensor's directions at rest with and without noise, radians.
    pub angle_median: f64,
    /// Median distance between its positions at rest with and without noise, metres.
    pub distance_median: f64,
}

impl Convergence {
    /// Fraction of the touches that converged; 0 without touches.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.converged as f64 / self.attempts.max(1) as f64
    }

    /// Fraction of the touches that converged on the object; 0 without touches.
    #[must_use]
    pub fn touching_share(&self) -> f64 {
        self.touching as f64 / self.attempts.max(1) as f64
    }
}

/// The largest pressure (Pa) of converged touches without added noise.
///
/// Forces begin at 0, so this is their observed range. 0 when no touch converges.
#[must_use]
pub fn observed_range(simulator: &PressSimulator, seed: u64, config: &ConvergenceConfig) -> f64 {
    let quiet = Trial::new(simulator, NoiseLevel::NONE, config);
    let largest = |attempt| match quiet.outcome(seed, attempt)? {
        Outcome::Converged(contact) => contact.pressures.iter().copied().reduce(f64::max),
        _ => None,
    };
    let attempts = 3 * config.successes as u64;
    (0..attempts)
        .into_par_iter()
        .filter_map(largest)
        .collect::<Vec<_>>()
        .into_iter()
        .fold(0.0, f64::max)
}

/// Touches from random starts at one noise level (a fraction of `observed_range`, Pa).
///
/// `None` when the level is negative or above twice the sensor's range.
#[must_use]
pub fn convergence(
    simulator: &PressSimulator,
    level: f64,
    observed_range: f64,
    seed: u64,
    config: &ConvergenceConfig,
) -> Option<Convergence> {
    const BATCH: u64 = 64;
    let saturation = simulator.sensor().parameters().saturation;
    let noise_level = NoiseLevel::new(level * observed_range / saturation)?;
    let noisy = Trial::new(simulator, noise_level, config);
    let quiet = Trial::new(simulator, NoiseLevel::NONE, config);
    let (mut attempts, mut rounds, mut angles, mut distances) = (0, 0, Vec::new(), Vec::new());
    let (mut converged, mut touching, mut commands) = (0, 0, 0);
    let mut next = 0;
    while converged < config.successes && attempts < config.attempts_max && next < u64::MAX / 2 {
        let batch: Vec<_> = (next..next + BATCH)
            .into_par_iter()
            .map(|attempt| (noisy.outcome(seed, attempt), quiet.outcome(seed, attempt)))
            .collect();
        next += BATCH;
        for (with_noise, without) in batch {
            let Some(outcome) = with_noise else { continue };
            if converged >= config.successes || attempts >= config.attempts_max {
                break;
            }
            attempts += 1;
            let Outcome::Converged(contact) = outcome else { continue };
            converged += 1;
            rounds += contact.rounds;
            commands += contact.commands;
            touching += usize::from(contact.press.max_penetration > 0.0);
            if let Some(Outcome::Converged(reference)) = without {
                let (here, there) = (contact.object_from_sensor, reference.object_from_sensor);
                angles.push(angle_between_facings(here, there));
                distances.push(here.distance_to(&there));
            }
        }
        // An object that the sensor fits nowhere yields no attempt at all.
        if attempts == 0 && next > 100 * BATCH {
            break;
        }
    }
    Some(Convergence {
        level,
        attempts,
        converged,
        touching,
        rounds_mean: rounds as f64 / converged.max(1) as f64,
        commands_mean: commands as f64 / converged.max(1) as f64,
        angle_median: median(angles),
        distance_median: median(distances),
    })
}

/// Touches under equal conditions.
struct Trial {
    simulator: PressSimulator,
    places: SamplerConfig,
    contact: ContactConfig,
}

impl Trial {
    fn new(simulator: &PressSimulator, noise: NoiseLevel, config: &ConvergenceConfig) -> Self {
        let known = match config.rule {
            ContactRule::Unaware => NoiseLevel::NONE,
            ContactRule::AboveNoise => noise,
        };
        let contact = ContactConfig {
            idle: config.idle,
            ..ContactConfig::for_sensor(simulator.sensor(), known)
        };
        let places =
            SamplerConfig { tilt_max: config.tilt_max, ..SamplerConfig::for_simulator(simulator) };
        Self { simulator: simulator.clone().with_noise(noise), places, contact }
    }

    /// The result of one attempt; `None` when the sensor does not fit at its start. An
    /// attempt starts equally at every noise level.
    fn outcome(&self, seed: u64, attempt: u64) -> Option<Outcome> {
        let mut stream = Stream::new(seed, Purpose::Exploration, attempt);
        let place = self.simulator.surface().draw(None, &mut stream);
        let start = start_at(&self.simulator, &place, &self.places, &mut stream)?;
        Some(touch(&self.simulator, start, &self.contact, &mut stream))
    }
}

fn angle_between_facings(a: Pose, b: Pose) -> f64 {
    a.turn(glam::DVec3::Z).angle_between(b.turn(glam::DVec3::Z))
}

/// The median; 0 for an empty list.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::SensorDescription;
    use palpate_core::units::MM;

    use super::*;
    use crate::mesh::tests_support::sphere;

    #[test]
    fn noise_lowers_the_share_that_converges() {
        let simulator =
            PressSimulator::new(sphere(30.0 * MM, 60), SensorDescription::digitacts_6x6());
        let config = ConvergenceConfig { successes: 40, attempts_max: 400, ..Default::default() };
        let range = observed_range(&simulator, 1, &config);
        assert!((2e3..=20e3).contains(&range), "{range}");
        let at = |level| convergence(&simulator, level, range, 1, &config).unwrap();
        let (none, little, much) = (at(0.0), at(0.1), at(1.5));
        assert_eq!((none.converged, none), (40, at(0.0)));
        // Without noise a touch is its own reference.
        assert!(none.angle_median < 1e-9 && none.distance_median < 1e-12);
        assert!(none.share() > 0.9 && little.share() > 0.9, "{none:?} {little:?}");
        assert!(little.angle_median < 4.0 * DEG && little.distance_median < 2.0 * MM);
        let (nearer, farther) = (little.distance_median, much.distance_median);
        assert!(farther > nearer, "{much:?} {little:?}");
        assert!(much.angle_median > little.angle_median, "{much:?} {little:?}");
        assert!(convergence(&simulator, -0.1, range, 1, &config).is_none());
    }
}
