//! Reproducible streams of random numbers, one for each purpose, passed as arguments.
//!
//! A stream is named by a seed, a [`Purpose`] and an index; equal names give equal numbers on
//! every machine and for any number of threads, and streams of different names are
//! independent. The crates of the mathematics and the simulator have no other source of
//! randomness.

use glam::{DQuat, DVec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Purpose of a stream of random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Places of the training sampler's touches.
    Sampling = 1,
    /// Noise of a simulated sensor.
    SensorNoise = 2,
    /// Starting points and sub-samples of a clustering.
    Clustering = 3,
    /// Poses of unknown objects in trials.
    ObjectPose = 4,
    /// Held-out readings of a trial.
    ReadingChoice = 5,
    /// Shapes of generated objects.
    Shape = 6,
    /// Noise and placement of the letter rig's presses.
    RigNoise = 7,
    /// Particles: initial states, motion and resampling.
    Particles = 8,
    /// Gains of the letter rig's taxels.
    RigGains = 10,
    /// Wander of the letter rig's position over a session.
    RigWander = 13,
    /// Targets of a blind arm, and the noise of its readings.
    Exploration = 11,
    /// Motion of an object under touch.
    Perturbation = 12,
    /// Gains of a simulated sensor's taxels.
    TaxelGains = 20,
    /// Draws of sensors from a family.
    SensorFamily = 21,
    /// Choice of the next touch: sampled poses and approaches.
    NextTouch = 30,
    /// Resampling of trials by a bootstrap.
    Bootstrap = 31,
    /// Randomly assembled objects.
    Assembly = 32,
    /// Times and kinds of a load's requests.
    Arrivals = 40,
    /// Search of an object's pose in commissioning, and mistakes of its trials.
    Commissioning = 50,
}

/// A reproducible stream of random numbers.
#[derive(Clone, Debug)]
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream named by `seed`, `purpose` and `index`.
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose, index: u64) -> Self {
        let mut key = [0u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&(purpose as u64).to_le_bytes());
        key[16..24].copy_from_slice(&index.to_le_bytes());
        Self(ChaCha8Rng::from_seed(key))
    }

    /// A number drawn uniformly from `low..high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// A number drawn from the normal distribution with mean 0 and deviation 1.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// An index drawn uniformly from `0..n`.
    ///
    /// # Panics
    /// When `n` is 0.
    pub fn index(&mut self, n: usize) -> usize {
        assert!(n > 0, "an index is drawn from at least one element");
        self.0.random_range(0..n)
    }

    /// A direction drawn uniformly from the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        let z = self.uniform(-1.0, 1.0);
        let angle = self.uniform(0.0, std::f64::consts::TAU);
        let radius = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
    }

    /// A rotation drawn uniformly from all rotations (Shoemake 1992).
    pub fn rotation(&mut self) -> DQuat {
        let (u, v, w) = (
            self.uniform(0.0, 1.0),
            self.uniform(0.0, std::f64::consts::TAU),
            self.uniform(0.0, std::f64::consts::TAU),
        );
        let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
        DQuat::from_xyzw(a * v.sin(), a * v.cos(), b * w.sin(), b * w.cos()).normalize()
    }

    /// A rotation drawn uniformly from those by at most `angle_max` (rad): a uniform axis,
    /// and an angle by the inverse of its distribution function (θ − sin θ) / (angle_max −
    /// sin angle_max). The cost does not depend on the bound.
    pub fn rotation_within(&mut self, angle_max: f64) -> DQuat {
        if angle_max >= std::f64::consts::PI {
            return self.rotation();
        }
        let axis = self.direction();
        let share = self.uniform(0.0, 1.0);
        DQuat::from_axis_angle(axis, angle_of_share(share, angle_max))
    }

    /// Sixty-four random bits, for seeding a library's own generator.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }
}

/// The angle below which this share of the rotations by at most `angle_max` lies.
fn angle_of_share(share: f64, angle_max: f64) -> f64 {
    // θ − sin θ, without cancellation where θ is small.
    let volume = |angle: f64| match angle {
        small if small < 0.02 => small.powi(3) / 6.0 * (1.0 - small * small / 20.0),
        angle => angle - angle.sin(),
    };
    let wanted = share * volume(angle_max);
    // Small balls of rotations are like balls: the cube root lies above the solution, and
    // Newton's steps on a convex function decrease to it.
    let mut angle = angle_max * share.cbrt();
    for _ in 0..NEWTON_STEPS {
        let slope = 2.0 * (0.5 * angle).sin().powi(2);
        if slope <= 0.0 {
            return angle;
        }
        angle -= (volume(angle) - wanted) / slope;
    }
    angle.clamp(0.0, angle_max)
}

/// Derived: from the cube root, five steps are exact to rounding up to π; one in reserve.
const NEWTON_STEPS: usize = 6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_depend_on_their_name_alone() {
        let draw = |seed, purpose, index| Stream::new(seed, purpose, index).bits();
        let first = draw(7, Purpose::Sampling, 3);
        assert_eq!(first, draw(7, Purpose::Sampling, 3));
        assert_ne!(first, draw(8, Purpose::Sampling, 3));
        assert_ne!(first, draw(7, Purpose::SensorNoise, 3));
        assert_ne!(first, draw(7, Purpose::Sampling, 4));
    }

    #[test]
    fn random_rotations_have_no_preferred_axis() {
        let mut stream = Stream::new(1, Purpose::ObjectPose, 0);
        let n = 20_000;
        let mean = (0..n).map(|_| stream.rotation() * DVec3::Z).sum::<DVec3>() / f64::from(n);
        // Each component has deviation sqrt(1/3)/sqrt(n) = 0.004; five of them.
        assert!(mean.abs().max_element() < 0.02, "{mean}");
    }

    /// The share of draws below each of nine angles, and the mean axis.
    fn angles(draw: impl FnMut() -> DQuat, bound: f64) -> ([f64; 9], DVec3) {
        let n = 20_000;
        let (mut shares, mut mean) = ([0.0; 9], DVec3::ZERO);
        for turn in std::iter::repeat_with(draw).take(n) {
            let (axis, angle) = turn.to_axis_angle();
            for (step, share) in shares.iter_mut().enumerate() {
                let below = angle < bound * (step + 1) as f64 / 10.0;
                *share += f64::from(u8::from(below)) / n as f64;
            }
            mean += axis / n as f64;
        }
        (shares, mean)
    }

    #[test]
    fn bounded_rotations_match_rejection_sampling() {
        let bound = 1.2;
        let mut direct = Stream::new(1, Purpose::Particles, 0);
        let mut rejecting = Stream::new(2, Purpose::Particles, 0);
        let (found, axis) = angles(|| direct.rotation_within(bound), bound);
        let rejected = || loop {
            let turn = rejecting.rotation();
            if turn.to_axis_angle().1 <= bound {
                return turn;
            }
        };
        let (expected, _) = angles(rejected, bound);
        for (found, expected) in found.iter().zip(&expected) {
            // Two shares of 20,000 draws: deviation of their difference at most 0.005.
            assert!((found - expected).abs() < 0.02, "{found} {expected}");
        }
        assert!(axis.abs().max_element() < 0.02, "{axis}");
    }

    #[test]
    fn the_angle_of_a_share_inverts_its_distribution() {
        for bound in [1e-6, 1e-3, 0.019, 0.021, 0.5, 2.0, std::f64::consts::PI] {
            for share in [0.0, 1e-12, 1e-3, 0.2, 0.5, 0.9, 1.0] {
                let angle = angle_of_share(share, bound);
                assert!((0.0..=bound).contains(&angle), "{angle} of {bound}");
                // For a small bound the ratio of volumes is that of cubes.
                let ratio = match bound < 0.01 {
                    true => (angle / bound).powi(3),
                    false => (angle - angle.sin()) / (bound - bound.sin()),
                };
                assert!((ratio - share).abs() < 1e-5, "{bound} {share}: {ratio}");
            }
        }
    }
}
