//! The particle filter of chapter 3: weighted samples of identity and pose.
//!
//! Source: section 3.3.3, equations 3.9–3.13 as corrected; weights in the log domain. A state
//! is an object and its `session_from_object`, planar or solid. Noise moves a particle in the
//! object frame, about the object's origin. Not here: the likelihood, which is an argument.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::kld::KldSize;
use palpate_core::log_prob::{log_sum_exp, normalize};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;

/// Number of nodes of equation 3.12's grid at which the density is evaluated: the heaviest.
const MODE_CANDIDATES: usize = 64;

/// The region of possible poses, from which particles are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PoseRegion {
    /// In the plane: a box of translations, and every angle about z.
    Planar {
        /// Centre of the box, metres; its z is that of all particles.
        center: DVec3,
        /// Half its sides along x and y, metres; z is ignored.
        half: DVec3,
    },
    /// In space: a box around a pose.
    Solid {
        /// The centre.
        center: Pose,
        /// Half its sides, metres.
        half: DVec3,
        /// Largest rotation from the centre, radians; π permits every rotation.
        angle_max: f64,
    },
}

/// Resampling method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resampling {
    /// Independent draws, as printed.
    Multinomial,
    /// Equidistant draws from one random start: least variance.
    Systematic,
}

/// Injection of random particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Injection {
    /// Never.
    None,
    /// This fraction of every new set, within 0..1.
    Share(f64),
    /// As much as the likelihood falls below its average (Augmented MCL, Gutmann et al. 1998).
    Augmented {
        /// The rate of the slow average, below that of the fast.
        slow: f64,
        /// The rate of the fast average.
        fast: f64,
    },
}

/// Configuration of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParticleOptions {
    /// Number of particles over all objects; the maximum, when the number adapts.
    pub n: usize,
    /// Standard deviation of the noise along each axis, metres.
    pub translation_noise: f64,
    /// Standard deviation of the noise about each axis (z alone in the plane), radians.
    pub rotation_noise: f64,
    /// Resampling method.
    pub resampling: Resampling,
    /// Resamples when the effective fraction of particles is below this; 1 is always.
    pub resample_below: f64,
    /// Adaptive number of particles; `None` keeps it.
    pub size: Option<KldSize>,
    /// Injection of random particles.
    pub injection: Injection,
    /// Exponent of the likelihood; 1 is as printed.
    pub exponent: f64,
}

impl ParticleOptions {
    /// As printed: noise of 1 mm and 0.1 rad, multinomial, after every reading.
    #[must_use]
    pub fn literal(n: usize) -> Self {
        Self {
            n,
            translation_noise: 1.0 * MM,
            rotation_noise: 0.1,
            resampling: Resampling::Multinomial,
            resample_below: 1.0,
            size: None,
            injection: Injection::None,
            exponent: 1.0,
        }
    }
}

/// One hypothesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particle {
    /// Index of the object.
    pub object: usize,
    /// Pose of the object.
    pub session_from_object: Pose,
    /// Natural logarithm of the weight; the weights of all particles sum to 1.
    pub log_weight: f64,
}

/// A belief over identity and pose.
#[derive(Clone, Debug)]
pub struct ParticleFilter {
    options: ParticleOptions,
    region: PoseRegion,
    n_objects: usize,
    seed: u64,
    step: u64,
    particles: Vec<Particle>,
    averages: Option<(f64, f64)>,
}

impl ParticleFilter {
    /// Bytes of the particles.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.particles.capacity() * size_of::<Particle>()
    }

    /// Particles drawn uniformly from all objects and the region. `seed` determines all
    /// randomness.
    ///
    /// # Panics
    /// When there is no object or no particle.
    #[must_use]
    pub fn new(options: ParticleOptions, region: PoseRegion, n_objects: usize, seed: u64) -> Self {
        assert!(n_objects > 0 && options.n > 0, "a belief has objects and particles");
        let mut stream = Stream::new(seed, Purpose::Particles, 0);
        let log_weight = -(options.n as f64).ln();
        let particles = (0..options.n)
            .map(|_| Particle { log_weight, ..drawn(&region, n_objects, &mut stream) })
            .collect();
        Self { options, region, n_objects, seed, step: 0, particles, averages: None }
    }

    /// One time step: noise, weights by `log_likelihood` of an object and its pose, and
    /// resampling first when the last reading left too few effective particles.
    pub fn add(&mut self, log_likelihood: impl Fn(usize, &Pose) -> f64 + Sync) {
        self.step += 1;
        let mut stream = Stream::new(self.seed, Purpose::Particles, self.step);
        // The set was weighted by the last reading; it is resampled before the next, so that
        // answers can use the weights (equation 3.10).
        if self.step > 1 {
            self.resample(&mut stream);
        }
        for particle in &mut self.particles {
            let moved = noise(&self.options, &self.region, &mut stream);
            particle.session_from_object = particle.session_from_object * moved;
        }
        let exponent = self.options.exponent;
        self.particles.par_iter_mut().for_each(|particle| {
            particle.log_weight +=
                exponent * log_likelihood(particle.object, &particle.session_from_object);
        });
        let total = log_sum_exp(self.particles.iter().map(|particle| particle.log_weight));
        for particle in &mut self.particles {
            particle.log_weight -= total;
        }
        self.note_likelihood(total);
    }

    /// Replaces the lightest particles by hypotheses of another filter (object and pose), each with
    /// the mean weight: section 3.4.1. The next reading moves and weighs them like the others.
    pub fn replace_lightest(&mut self, others: &[(usize, Pose)]) {
        let n = self.particles.len();
        let mut order: Vec<usize> = (0..n).collect();
        let weight = |idx: &usize| self.particles[*idx].log_weight;
        order.sort_by(|a, b| weight(a).total_cmp(&weight(b)));
        let log_weight = -(n as f64).ln();
        for (idx, (object, pose)) in order.into_iter().zip(others) {
            self.particles[idx] =
                Particle { object: *object, session_from_object: *pose, log_weight };
        }
        let total = log_sum_exp(self.particles.iter().map(|particle| particle.log_weight));
        self.particles.iter_mut().for_each(|particle| particle.log_weight -= total);
    }

    /// The particles, with the weights of the last reading.
    #[must_use]
    pub fn particles(&self) -> &[Particle] {
        &self.particles
    }

    /// The objects' probabilities, which sum to 1 (the sums of equation 3.10).
    #[must_use]
    pub fn identities(&self) -> Vec<f64> {
        let mut sums = vec![0.0; self.n_objects];
        for particle in &self.particles {
            sums[particle.object] += particle.log_weight.exp();
        }
        sums
    }

    /// The effective number of particles: 1/Σw².
    #[must_use]
    pub fn effective(&self) -> f64 {
        self.particles.iter().map(|p| (2.0 * p.log_weight).exp()).sum::<f64>().recip()
    }

    /// The pose of `object` with the largest density under conical kernels of `reach` metres
    /// and `turn` radians (equations 3.11–3.13); `None` when the object has no particle.
    ///
    /// In the plane, candidates are the 64 heaviest nodes of the printed grid of 0.5 mm and
    /// 0.04π; in space, the 64 heaviest particles.
    #[must_use]
    pub fn mode(&self, object: usize, reach: f64, turn: f64) -> Option<Pose> {
        let of_object = || self.particles.iter().filter(|p| p.object == object);
        let mut nodes: Vec<(Pose, f64)> =
            of_object().map(|p| (self.node(&p.session_from_object), p.log_weight.exp())).collect();
        // Equal nodes have equal bits; 0 is added so that −0 becomes 0.
        let key = |pose: &Pose| {
            let [x, y, z] = pose.translation.to_array();
            let [i, j, k, w] = pose.rotation.to_array();
            [x, y, z, i, j, k, w].map(|value| (value + 0.0).to_bits())
        };
        nodes.sort_unstable_by_key(|(pose, _)| key(pose));
        nodes.dedup_by(|(next, weight), (pose, sum)| {
            let same = key(next) == key(pose);
            if same {
                *sum += *weight;
            }
            same
        });
        nodes.sort_by(|a, b| b.1.total_cmp(&a.1));
        nodes.truncate(MODE_CANDIDATES);
        let density = |at: &Pose| {
            let cone = |particle: &Particle| {
                let pose = &particle.session_from_object;
                let (moved, turned) = (pose.distance_to(at) / reach, pose.angle_to(at) / turn);
                (1.0 - moved.hypot(turned)).max(0.0) * particle.log_weight.exp()
            };
            of_object().map(cone).sum::<f64>()
        };
        let rated = nodes.into_iter().map(|(pose, _)| (density(&pose), pose));
        rated.reduce(|a, b| if b.0 > a.0 { b } else { a }).map(|(_, pose)| pose)
    }

    /// The grid node nearest to a planar pose; a solid pose itself.
    fn node(&self, pose: &Pose) -> Pose {
        let PoseRegion::Planar { .. } = self.region else {
            return *pose;
        };
        let (edge, step) = (0.5 * MM, 0.04 * PI);
        let angle = 2.0 * pose.rotation.z.atan2(pose.rotation.w);
        let turns = (angle / step).round().rem_euclid((TAU / step).round());
        let z = pose.translation.z;
        let at = ((pose.translation / edge).round() * edge).with_z(z);
        Pose { rotation: DQuat::from_rotation_z(turns * step), translation: at }
    }

    fn resample(&mut self, stream: &mut Stream) {
        if self.effective() >= self.options.resample_below * self.particles.len() as f64 {
            // With a fraction of 1, only equal weights need no resampling.
            return;
        }
        let n_injected_share = self.injected_share();
        let logs: Vec<f64> = self.particles.iter().map(|p| p.log_weight).collect();
        let weights = normalize(&logs);
        let n = match self.options.size {
            None => self.options.n,
            Some(size) => {
                let preview = pick(&weights, self.options.n, self.options.resampling, stream);
                let preview = preview.map(|idx| {
                    let particle = &self.particles[idx];
                    (particle.object, particle.session_from_object)
                });
                size.wanted(preview, self.options.n)
            }
        };
        let injected = (n_injected_share * n as f64).round() as usize;
        let kept = n - injected.min(n);
        let mut particles: Vec<Particle> = pick(&weights, kept, self.options.resampling, stream)
            .map(|idx| self.particles[idx])
            .collect();
        particles.extend((kept..n).map(|_| drawn(&self.region, self.n_objects, stream)));
        let log_weight = -(n as f64).ln();
        particles.iter_mut().for_each(|particle| particle.log_weight = log_weight);
        self.particles = particles;
    }

    fn injected_share(&self) -> f64 {
        match (self.options.injection, self.averages) {
            (Injection::Share(share), _) => share,
            (Injection::Augmented { .. }, Some((slow, fast))) => {
                (1.0 - (fast - slow).exp()).max(0.0)
            }
            (Injection::None | Injection::Augmented { .. }, _) => 0.0,
        }
    }

    /// Updates the slow and the fast average of the mean likelihood, as logarithms.
    fn note_likelihood(&mut self, log_mean: f64) {
        let Injection::Augmented { slow, fast } = self.options.injection else {
            return;
        };
        let towards = |average: f64, rate: f64| {
            log_sum_exp([average + (1.0 - rate).ln(), log_mean + rate.ln()].into_iter())
        };
        let (was_slow, was_fast) = self.averages.unwrap_or((log_mean, log_mean));
        self.averages = Some((towards(was_slow, slow), towards(was_fast, fast)));
    }
}

/// A particle drawn uniformly, with its weight unset.
fn drawn(region: &PoseRegion, n_objects: usize, stream: &mut Stream) -> Particle {
    let object = stream.index(n_objects);
    let within = |half: DVec3, stream: &mut Stream| {
        DVec3::from_array(half.to_array().map(|half| stream.uniform(-half, half)))
    };
    let session_from_object = match *region {
        PoseRegion::Planar { center, half } => {
            let translation = center + within(half.with_z(0.0), stream);
            Pose { rotation: DQuat::from_rotation_z(stream.uniform(-PI, PI)), translation }
        }
        PoseRegion::Solid { center, half, angle_max } => {
            let offset = within(half, stream);
            center * Pose::from_parts(stream.rotation_within(angle_max), offset)
        }
    };
    Particle { object, session_from_object, log_weight: 0.0 }
}

/// A small random motion in the object frame.
fn noise(options: &ParticleOptions, region: &PoseRegion, stream: &mut Stream) -> Pose {
    let (moved, turned) = (options.translation_noise, options.rotation_noise);
    let mut normal = |deviation: f64| deviation * stream.normal();
    match region {
        PoseRegion::Planar { .. } => Pose {
            translation: DVec3::new(normal(moved), normal(moved), 0.0),
            rotation: DQuat::from_rotation_z(normal(turned)),
        },
        PoseRegion::Solid { .. } => Pose {
            translation: DVec3::new(normal(moved), normal(moved), normal(moved)),
            rotation: DQuat::from_scaled_axis(DVec3::new(
                normal(turned),
                normal(turned),
                normal(turned),
            )),
        },
    }
}

/// `n` indices of `weights` (which sum to 1), in ascending order.
fn pick<'a>(
    weights: &'a [f64],
    n: usize,
    resampling: Resampling,
    stream: &mut Stream,
) -> impl Iterator<Item = usize> + use<'a> {
    let mut places: Vec<f64> = match resampling {
        Resampling::Multinomial => (0..n).map(|_| stream.uniform(0.0, 1.0)).collect(),
        Resampling::Systematic => {
            let start = stream.uniform(0.0, 1.0);
            (0..n).map(|idx| (idx as f64 + start) / n as f64).collect()
        }
    };
    places.sort_unstable_by(f64::total_cmp);
    let (mut idx, mut below) = (0, 0.0);
    places.into_iter().map(move |place| {
        while idx + 1 < weights.len() && below + weights[idx] <= place {
            below += weights[idx];
            idx += 1;
        }
        idx
    })
}

#[cfg(test)]
mod tests;
