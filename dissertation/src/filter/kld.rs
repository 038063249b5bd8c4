//! Number of particles by the bins that a belief occupies (KLD sampling, Fox 2003).

use rustc_hash::FxHashSet;

use super::particle::Particle;

/// Parameters of the adaptive number of particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KldSize {
    /// Permitted error as Kullback–Leibler divergence, nats.
    pub error: f64,
    /// The normal quantile of the confidence: 2.33 for 99 %.
    pub quantile: f64,
    /// Side of a bin of translation, metres.
    pub edge: f64,
    /// Side of a bin of the rotation vector, radians.
    pub angle: f64,
    /// Minimum number of particles.
    pub min: usize,
}

impl KldSize {
    /// Number of particles needed for the bins that `particles` occupy, at most `max`.
    #[must_use]
    pub fn wanted(&self, particles: &[Particle], max: usize) -> usize {
        let bin = |particle: &Particle| {
            let pose = &particle.session_from_object;
            let at = (pose.translation / self.edge).floor().to_array();
            let turned = (pose.rotation.to_scaled_axis() / self.angle).floor().to_array();
            (particle.object, at.map(|v| v as i32), turned.map(|v| v as i32))
        };
        let occupied: FxHashSet<_> = particles.iter().map(bin).collect();
        self.size(occupied.len()).clamp(self.min.min(max), max)
    }

    /// The chi-square bound by Wilson and Hilferty for `bins` occupied bins.
    fn size(&self, bins: usize) -> usize {
        if bins < 2 {
            return self.min;
        }
        let free = (bins - 1) as f64;
        let spread = 2.0 / (9.0 * free);
        let root = 1.0 - spread + spread.sqrt() * self.quantile;
        (free / (2.0 * self.error) * root.powi(3)).ceil() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_core::units::{DEG, MM};

    #[test]
    fn the_bound_matches_a_hand_computed_value() {
        let size =
            KldSize { error: 0.05, quantile: 2.33, edge: 4.0 * MM, angle: 20.0 * DEG, min: 50 };
        // k − 1 = 100: 2/900 = 0.0022222, root 1 − 0.0022222 + 0.0471405·2.33 = 1.107615,
        // 1000 · 1.358812 = 1358.8.
        assert_eq!(size.size(101), 1359);
        assert_eq!(size.wanted(&[], 1_000), 50);
    }
}
