//! Beliefs about one trial: the adaptive method, bins, particles, and particles that a histogram
//! seeds.

use glam::DVec3;
use palpate_core::log_prob::normalize;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::Stream;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_dissertation::filter::class_field::ClassField;
use palpate_dissertation::filter::histogram::{PlanarBins, PlanarHistogram};
use palpate_dissertation::filter::particle::ParticleFilter;
use palpate_dissertation::geometric::GeometricBelief;

use super::Lab;

/// Share of the particles that a histogram gives, as many as the options add at random.
pub(super) const SEEDED_SHARE: f64 = 0.05;

/// A belief about one trial.
pub(super) trait Belief {
    /// Adds a reading (session frame).
    fn add(&mut self, reading: &Reading);
    /// The letters' probabilities, which sum to 1.
    fn identities(&self) -> Vec<f64>;
    /// Most likely pose of the letter of this index: `session_from_object`.
    fn pose(&self, letter: usize) -> Option<Pose>;
}

pub(super) struct Adaptive<'a> {
    pub(super) belief: GeometricBelief,
    pub(super) sensor: &'a SensorDescription,
}

impl Belief for Adaptive<'_> {
    fn add(&mut self, reading: &Reading) {
        self.belief.add(reading, self.sensor).expect("the rig presses straight down");
    }

    fn identities(&self) -> Vec<f64> {
        self.belief.answer(0).probabilities
    }

    fn pose(&self, letter: usize) -> Option<Pose> {
        let modes = self.belief.answer(3).modes;
        modes.iter().find(|mode| mode.object.0 as usize == letter).map(|m| m.session_from_object)
    }
}

pub(super) struct Bins<'a> {
    pub(super) filter: PlanarHistogram,
    pub(super) lab: &'a Lab,
}

impl Belief for Bins<'_> {
    fn add(&mut self, reading: &Reading) {
        self.filter.add(self.lab.classified(reading));
    }

    fn identities(&self) -> Vec<f64> {
        normalize(&self.filter.log_identities())
    }

    fn pose(&self, letter: usize) -> Option<Pose> {
        self.filter.mode(letter).map(|(pose, _)| pose)
    }
}

pub(super) struct Particles<'a> {
    pub(super) filter: ParticleFilter,
    pub(super) fields: &'a [ClassField],
    pub(super) lab: &'a Lab,
}

impl Belief for Particles<'_> {
    fn add(&mut self, reading: &Reading) {
        let press = self.lab.classified(reading);
        let fields = self.fields;
        self.filter.add(|object, pose| fields[object].log_likelihood(&press, pose));
    }

    fn identities(&self) -> Vec<f64> {
        self.filter.identities()
    }

    fn pose(&self, letter: usize) -> Option<Pose> {
        self.filter.mode(letter, 1.0 * MM, 1.0)
    }
}

/// Particle filter that replaces a share of its particles, before every reading, by draws from a
/// histogram filter of coarser bins.
pub(super) struct Seeded<'a> {
    pub(super) particles: Particles<'a>,
    pub(super) histogram: Bins<'a>,
    pub(super) bins: PlanarBins,
    pub(super) stream: Stream,
    pub(super) n_readings: usize,
}

impl Seeded<'_> {
    /// Hypotheses drawn from the histogram: a bin by its probability, a pose evenly within it.
    fn drawn(&mut self) -> Vec<(usize, Pose)> {
        let n_objects = self.particles.fields.len();
        let of_object = |object: usize| {
            let logs = self.histogram.filter.logs(object).into_iter();
            logs.map(move |(bin, log)| (object, bin, log))
        };
        let all: Vec<(usize, usize, f64)> = (0..n_objects).flat_map(of_object).collect();
        let weights = normalize(&all.iter().map(|(_, _, log)| *log).collect::<Vec<f64>>());
        let n = (SEEDED_SHARE * self.particles.filter.particles().len() as f64).round() as usize;
        let (sides, turn) = (self.bins.sides(), std::f64::consts::TAU / self.bins.n[2] as f64);
        (0..n)
            .map(|_| {
                let mut place = self.stream.uniform(0.0, 1.0);
                let idx = weights.iter().position(|weight| {
                    place -= weight;
                    place <= 0.0
                });
                let (object, bin, _) = all[idx.unwrap_or(all.len() - 1)];
                let center = self.bins.session_from_object(bin);
                let mut within = |side: f64| self.stream.uniform(-0.5 * side, 0.5 * side);
                let offset = DVec3::new(within(sides.x), within(sides.y), 0.0);
                let rotation = center.rotation * glam::DQuat::from_rotation_z(within(turn));
                (object, Pose { rotation, translation: center.translation + offset })
            })
            .collect()
    }
}

impl Belief for Seeded<'_> {
    fn add(&mut self, reading: &Reading) {
        if self.n_readings > 0 {
            let drawn = self.drawn();
            self.particles.filter.replace_lightest(&drawn);
        }
        self.particles.add(reading);
        self.histogram.add(reading);
        self.n_readings += 1;
    }

    fn identities(&self) -> Vec<f64> {
        self.particles.identities()
    }

    fn pose(&self, letter: usize) -> Option<Pose> {
        self.particles.pose(letter)
    }
}
