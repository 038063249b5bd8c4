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
    /// As [`Policy::Information`] with five times the samples and four times the approaches.
    Wide,
    /// The best of the planner's approaches that will touch, if one does.
    Touching,
    /// The best of the planner's approaches, when they aim at the true object where it is.
    TrueAims,
    /// Of the planner's best approaches, the one after which the right object is likeliest.
    Foresight,
}

/// Result of a press.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Met {
    /// The controllers came to rest on the object.
    Contact,
    /// Nothing was felt.
    Nothing,
    /// Something was felt, but the controllers did not come to rest.
    NoRest,
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

    /// The planner beside choices that know the truth, by what they know.
    pub const CAUSES: [Self; 7] = [
        Self::Information,
        Self::Directed,
        Self::TrueAims,
        Self::Touching,
        Self::Wide,
        Self::Foresight,
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
            Self::Wide => "wide",
            Self::Touching => "touching",
            Self::TrueAims => "true_aims",
            Self::Foresight => "foresight",
        }
    }
}

/// Maximum shift along the surface (metres) and tilt (rad) of a press near an earlier contact.
const NEAR: f64 = 25.0 * MM;
const NEAR_TILT: f64 = 30.0 * DEG;

/// Distance outside the surface at which such a press begins, metres.
const STAND_OFF: f64 = 120.0 * MM;

impl Met {
    /// Name in rows.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Contact => "contact",
            Self::Nothing => "nothing",
            Self::NoRest => "no rest",
        }
    }
}

/// Number of the planner's best approaches that are tried with the truth.
const FORESEEN: usize = 12;

/// A robot in front of one object.
pub struct Robot<'a> {
    /// The object, in its mesh's frame.
    pub simulator: &'a PressSimulator,
    /// Its index in the catalogue.
    pub object: usize,
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
    /// What it met.
    pub met: Met,
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
        let given = match self.policy {
            Policy::Sampler => return (self.random_ray(press), None),
            Policy::Random | Policy::RandomRecentered => Some(vec![self.random_ray(press)]),
            Policy::NearEarlier => {
                let mut stream = self.stream(Purpose::NextTouch, press);
                Some(vec![near(&contacts[stream.index(contacts.len())], &mut stream)])
            }
            Policy::TrueAims => Some(self.true_aims(press)),
            _ => None,
        };
        let seed = self.stream(Purpose::NextTouch, press).bits();
        let recenters = self.policy != Policy::Random;
        let mut options = NextTouchOptions { recenters, seed, ..NextTouchOptions::default() };
        match self.policy {
            Policy::Wide => {
                options.n_hypotheses *= 5;
                options.n_approaches *= 4;
            }
            Policy::Directed => options.n_approaches = 1,
            _ => {}
        }
        let ranking = rank(belief, given.as_deref(), &options, &mut || false);
        let ranked = ranking.map(|ranking| ranking.ranked).unwrap_or_default();
        let best = match self.policy {
            Policy::Touching => self.first_that_touches(press, &ranked),
            Policy::Foresight => self.best_in_truth(press, belief, &ranked),
            _ => ranked.first(),
        };
        let chosen = best.map(|best| best.approach).or(given.map(|given| given[0]));
        (chosen.unwrap_or_else(|| self.random_ray(press)), best.copied())
    }

    /// Approaches against places of the object's surface, from where they can be reached.
    fn true_aims(&self, press: usize) -> Vec<Approach> {
        let mut stream = self.stream(Purpose::Exploration, press);
        let config = SamplerConfig::for_simulator(self.simulator);
        let n = NextTouchOptions::default().n_approaches;
        let mut aims = Vec::with_capacity(n);
        for _ in 0..n {
            let Ok(rest) = touch_anywhere(self.simulator, SensorId(0), &config, &mut stream) else {
                continue;
            };
            let back = Pose::from_parts(DQuat::IDENTITY, -STAND_OFF * DVec3::Z);
            let session_from_sensor = self.session_from_object * rest.session_from_sensor() * back;
            aims.push(Approach { session_from_sensor, reach: 2.0 * STAND_OFF, cost: None });
        }
        aims
    }

    /// The first approach that ends in a contact, else the first.
    fn first_that_touches<'a>(&self, press: usize, ranked: &'a [Ranked]) -> Option<&'a Ranked> {
        let touches = |best: &&Ranked| self.press(press, &best.approach).met == Met::Contact;
        ranked.iter().find(touches).or(ranked.first())
    }

    /// Of the first approaches the one after which the right object is likeliest.
    fn best_in_truth<'a>(
        &self,
        press: usize,
        belief: &SurfaceBelief,
        ranked: &'a [Ranked],
    ) -> Option<&'a Ranked> {
        let truth = |best: &Ranked| {
            let mut after = belief.clone();
            if let Some(reading) = self.press(press, &best.approach).reading {
                after.add(&reading, self.simulator.sensor());
            }
            after.posterior()[self.object]
        };
        let rated = ranked.iter().take(FORESEEN).map(|best| (truth(best), best));
        rated.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, best)| best)
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
            let met = if reading.is_some() { Met::Contact } else { Met::NoRest };
            return Pressed { met, reading, approaches: 1 };
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
                met: Met::Contact,
                approaches: 1 + shifts,
            },
            Landing::Missed { miss, shifts } => Pressed {
                reading: reading(miss.object_from_sensor, &miss.pressures)
                    .map(|reading| reading.after_approach(miss.travel)),
                met: Met::Nothing,
                approaches: 1 + shifts,
            },
            Landing::NoConvergence | Landing::Unreachable => {
                Pressed { reading: None, met: Met::Nothing, approaches: 1 + config.shifts_max }
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
