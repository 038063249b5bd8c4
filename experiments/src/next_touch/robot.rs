//! A robot that presses along rays from outside and may miss, and how it chooses them.
//!
//! It knows roughly where the object is (the centre and the size of its bounds), and the
//! recogniser's answers. The n-th random ray of a trial is the same for every policy, and so is
//! the noise of the n-th press. Rays are `session_from_sensor`, along +z.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, MM};
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::next_touch::{Approach, NextTouchOptions, Ranked, rank};
use palpate_sim::controller::{Landing, RecenterConfig, touch_recentered};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::rays::{RayConfig, draw_ray};
use palpate_sim::sampler::{SamplerConfig, touch_anywhere};

/// Choice of the next press.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// Random approach rays, pressed where they land.
    Random,
    /// Random approach rays; a contact off the array's centre is centred.
    RandomRecentered,
    /// Against the normal of an earlier contact, moved and tilted a little; centred.
    NearEarlier,
    /// Against a mapped touch of a hypothesis drawn from the belief; centred.
    Directed,
    /// The best of the planner's own approaches by expected information; centred.
    Information,
    /// Guided to the surface as by a camera, never missing.
    Sampler,
}

impl Policy {
    /// All policies, in order of increasing knowledge.
    pub const ALL: [Self; 6] = [
        Self::Random,
        Self::RandomRecentered,
        Self::NearEarlier,
        Self::Directed,
        Self::Information,
        Self::Sampler,
    ];

    /// Name in rows, plots and keys.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::RandomRecentered => "random_recentered",
            Self::NearEarlier => "near_earlier",
            Self::Directed => "directed",
            Self::Information => "information",
            Self::Sampler => "sampler",
        }
    }
}

/// Maximum shift along the surface (metres) and tilt (rad) of a press near an earlier contact.
const NEAR: f64 = 25.0 * MM;
const NEAR_TILT: f64 = 30.0 * DEG;

/// Distance outside the surface at which such a press begins, metres.
const STAND_OFF: f64 = 120.0 * MM;

/// A robot in front of one object.
pub struct Robot<'a> {
    /// The object, in its mesh's frame.
    pub simulator: &'a PressSimulator,
    /// Pose of the object.
    pub session_from_object: Pose,
    /// Policy for the next press.
    pub policy: Policy,
    /// Part of the key of the trial's random streams.
    pub seed: u64,
    /// Part of the key of the trial's random streams.
    pub trial: usize,
}

/// Result of a press.
pub struct Pressed {
    /// Reading for the recogniser; `None` when the sensor felt something and did not come to rest.
    pub reading: Option<Reading>,
    /// Whether the controllers came to rest on the object.
    pub touched: bool,
    /// Approaches of the sensor: one, and one more for every shift.
    pub approaches: usize,
}

impl Robot<'_> {
    fn stream(&self, purpose: Purpose, press: usize) -> Stream {
        Stream::new(self.seed, purpose, (self.trial * 1_000 + press) as u64)
    }

    /// A random ray, the same one for every policy.
    fn random_ray(&self, press: usize) -> Approach {
        let config = RayConfig::around(self.simulator.mesh());
        let ray = draw_ray(&config, &mut self.stream(Purpose::Sampling, press));
        let session_from_sensor = self.session_from_object * ray;
        Approach { session_from_sensor, reach: config.approach_max(), cost: None }
    }

    /// Next press after `contacts`, and its expected value.
    pub fn choose(
        &self,
        press: usize,
        belief: &SurfaceBelief,
        contacts: &[Reading],
    ) -> (Approach, Option<Ranked>) {
        let Some(_) = contacts.first() else { return (self.random_ray(press), None) };
        let seed = self.stream(Purpose::NextTouch, press).bits();
        let recenters = self.policy != Policy::Random;
        let ranked = |given: Option<Approach>, n_approaches| {
            let defaults = NextTouchOptions::default();
            let options = NextTouchOptions { n_approaches, recenters, seed, ..defaults };
            let given = given.as_ref().map(std::slice::from_ref);
            let ranking = rank(belief, given, &options, &mut || false).ok()?;
            ranking.ranked.first().copied()
        };
        let given = match self.policy {
            Policy::Random | Policy::RandomRecentered => Some(self.random_ray(press)),
            Policy::NearEarlier => {
                let mut stream = self.stream(Purpose::NextTouch, press);
                Some(near(&contacts[stream.index(contacts.len())], &mut stream))
            }
            Policy::Sampler => return (self.random_ray(press), None),
            Policy::Directed | Policy::Information => None,
        };
        let n_approaches = match self.policy {
            Policy::Information => NextTouchOptions::default().n_approaches,
            _ => 1,
        };
        let best = ranked(given, n_approaches);
        let chosen = best.map(|best| best.approach).or(given);
        (chosen.unwrap_or_else(|| self.random_ray(press)), best)
    }

    /// Presses along an approach.
    #[must_use]
    pub fn press(&self, press: usize, approach: &Approach) -> Pressed {
        let mut stream = self.stream(Purpose::SensorNoise, press);
        let (simulator, level) = (self.simulator, self.simulator.config().noise_level);
        if self.policy == Policy::Sampler {
            let config = SamplerConfig::for_simulator(simulator);
            let touched = touch_anywhere(simulator, SensorId(0), &config, &mut stream).ok();
            let reading = touched.map(|reading| reading.moved_by(self.session_from_object));
            return Pressed { touched: reading.is_some(), reading, approaches: 1 };
        }
        let mut config = RecenterConfig::for_sensor(simulator.sensor(), level);
        config.contact.approach_max = approach.reach;
        if self.policy == Policy::Random {
            config.shifts_max = 0;
        }
        let ray = self.session_from_object.inverse() * approach.session_from_sensor;
        let reading = |pose: Pose, pressures: &[f64]| {
            let reading = simulator.reading(SensorId(0), pose, pressures);
            Some(reading.moved_by(self.session_from_object))
        };
        match touch_recentered(simulator, ray, &config, &mut stream) {
            Landing::Converged { contact, shifts } => Pressed {
                reading: reading(contact.object_from_sensor, &contact.pressures),
                touched: true,
                approaches: 1 + shifts,
            },
            Landing::Missed { miss, shifts } => Pressed {
                reading: reading(miss.object_from_sensor, &miss.pressures)
                    .map(|reading| reading.after_approach(miss.travel)),
                touched: false,
                approaches: 1 + shifts,
            },
            Landing::NoConvergence | Landing::Unreachable => {
                Pressed { reading: None, touched: false, approaches: 1 + config.shifts_max }
            }
        }
    }
}

/// Against the normal of an earlier contact, moved along the surface and tilted.
fn near(contact: &Reading, stream: &mut Stream) -> Approach {
    let at = contact.session_from_sensor();
    let (along, angle) = (NEAR * stream.uniform(0.0, 1.0).sqrt(), stream.uniform(0.0, TAU));
    let moved = DVec3::new(along * angle.cos(), along * angle.sin(), 0.0);
    let axis = DQuat::from_rotation_z(angle) * DVec3::Y;
    let tilt = DQuat::from_axis_angle(axis, NEAR_TILT * stream.uniform(-1.0, 1.0));
    let ray = at * Pose::from_parts(DQuat::IDENTITY, moved) * Pose::from_parts(tilt, DVec3::ZERO);
    let back = Pose::from_parts(DQuat::IDENTITY, -STAND_OFF * DVec3::Z);
    Approach { session_from_sensor: ray * back, reach: 2.0 * STAND_OFF, cost: None }
}
