//! Randomness as an argument: one reproducible stream for each purpose.
//!
//! A stream is named by a seed, a [`Purpose`] and an index; equal names give equal
//! numbers on every machine and for any number of threads, and streams of different
//! names are independent. Nothing in `core` or `sim` draws from anywhere else.

use glam::{DQuat, DVec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// What a stream of random numbers is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Choosing where the training sampler touches.
    Sampling = 1,
    /// Noise of a simulated sensor.
    SensorNoise = 2,
    /// Starting points and sub-samples of a clustering.
    Clustering = 3,
    /// Poses of unknown objects in trials.
    ObjectPose = 4,
    /// Which held-back readings a trial draws.
    ReadingChoice = 5,
    /// Shapes of generated objects.
    Shape = 6,
    /// Noise and placement of the letter rig's presses.
    RigNoise = 7,
    /// Particles: where they start, how they move and which are drawn again.
    Particles = 8,
    /// Gains of the letter rig's taxels.
    RigGains = 10,
    /// Where a blind arm goes next, and what it feels there.
    Exploration = 11,
    /// How an object moves when it is touched.
    Perturbation = 12,
    /// Gains of a simulated sensor's taxels.
    TaxelGains = 20,
    /// Where to touch next: poses that are drawn, and approaches.
    NextTouch = 30,
    /// Which trials a bootstrap draws again.
    Bootstrap = 31,
    /// Objects put together at random.
    Assembly = 32,
    /// When a load's requests are due, and what each of them is.
    Arrivals = 40,
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
    /// When `n` is 0: there is nothing to choose from.
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

    /// Sixty-four random bits, for seeding a library's own generator.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_names_give_equal_numbers_and_other_names_do_not() {
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
}
