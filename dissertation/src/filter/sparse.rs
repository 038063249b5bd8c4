//! The sparse histogram filter over one object's poses, with bins only where there is evidence.
//!
//! Source: sections 5.2 and 5.4.4, equations 5.12–5.14, in the log domain. A pair of readings
//! gives a distribution over poses ([`PairEvidence`]); beliefs are products of such
//! distributions. Two rules: the dissertation's strict product, where a missed match excludes
//! a pose for ever, and a mixture with the prior, which excludes nothing (the default). Not
//! here: the poses of a pair (`patch_pair`), and probabilities of identity.

use glam::{DQuat, DVec3};
use rustc_hash::FxHashMap;

use super::pose_bins::{PoseBin, PoseBins};
use palpate_core::log_prob::log_sum_exp;
use palpate_core::pose::Pose;

/// Product of the distributions of several pairs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProductRule {
    /// As printed: a bin without evidence from a pair is impossible.
    Strict,
    /// Each pair is a mixture of the prior, with weight `floor`, and its own distribution.
    Floored {
        /// Weight of the prior, within 0..1.
        floor: f64,
    },
}

/// Sums of the weighted poses within one bin, for their mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseSum {
    weight: f32,
    translation: [f32; 3],
    rotation: [f32; 4],
}

impl PoseSum {
    fn add(&mut self, pose: &Pose, weight: f64) {
        let seen = self.rotation.iter().zip(pose.rotation.to_array());
        let aligned: f64 = seen.map(|(sum, q)| f64::from(*sum) * q).sum();
        // q and −q are one rotation; sums are kept on one side.
        let signed = if aligned < 0.0 { -weight } else { weight };
        self.weight += weight as f32;
        for (sum, value) in self.translation.iter_mut().zip(pose.translation.to_array()) {
            *sum += (weight * value) as f32;
        }
        for (sum, value) in self.rotation.iter_mut().zip(pose.rotation.to_array()) {
            *sum += (signed * value) as f32;
        }
    }

    fn add_scaled(&mut self, other: &Self, scale: f32) {
        let aligned: f32 = self.rotation.iter().zip(&other.rotation).map(|(a, b)| a * b).sum();
        let signed = if aligned < 0.0 { -scale } else { scale };
        self.weight += scale * other.weight;
        for (sum, value) in self.translation.iter_mut().zip(&other.translation) {
            *sum += scale * value;
        }
        for (sum, value) in self.rotation.iter_mut().zip(&other.rotation) {
            *sum += signed * value;
        }
    }

    /// The mean pose, or `None` when nothing was added.
    #[must_use]
    pub fn mean(&self) -> Option<Pose> {
        let rotation = DQuat::from_array(self.rotation.map(f64::from));
        let (weight, norm) = (f64::from(self.weight), rotation.length());
        let translation = DVec3::from_array(self.translation.map(f64::from)) / weight;
        (weight > 0.0 && norm > 1e-30).then(|| Pose::from_parts(rotation, translation))
    }
}

/// Evidence of one pair of readings for one object's poses.
#[derive(Clone, Debug, Default)]
pub struct PairEvidence {
    bins: FxHashMap<PoseBin, PoseSum>,
    total: f64,
}

impl PairEvidence {
    /// Adds a pose with a weight (linear, not normalised); a pose without a bin is impossible and
    /// adds nothing.
    pub fn add(&mut self, bins: &PoseBins, pose: &Pose, weight: f64) {
        let Some(bin) = bins.bin(pose) else { return };
        self.bins.entry(bin).or_default().add(pose, weight);
        self.total += weight;
    }

    /// The sum of all weights.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.total
    }
}

/// One bin of a belief: its log evidence and the mean pose of the evidence.
#[derive(Clone, Copy, Debug, Default)]
struct BinBelief {
    log: f32,
    poses: PoseSum,
}

/// The belief over one object's poses.
#[derive(Clone, Debug)]
pub struct SparseHistogram {
    bins: FxHashMap<PoseBin, BinBelief>,
    rule: ProductRule,
    capacity: usize,
    has_evidence: bool,
}

impl SparseHistogram {
    /// Approximate bytes of the bins; the table's control bytes are one per bin.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.bins.capacity() * (size_of::<(PoseBin, BinBelief)>() + 1)
    }

    /// A uniform belief that keeps at most about `capacity` bins.
    #[must_use]
    pub fn new(rule: ProductRule, capacity: usize) -> Self {
        Self { bins: FxHashMap::default(), rule, capacity, has_evidence: false }
    }

    /// Multiplies in a pair's distribution, `exponent` times.
    ///
    /// `scale` turns the evidence's weights into probabilities over identity and pose;
    /// `log_prior` is ln of the prior probability of one bin.
    pub fn multiply(&mut self, evidence: &PairEvidence, scale: f64, log_prior: f64, exponent: f64) {
        match self.rule {
            ProductRule::Strict => self.multiply_strict(evidence, scale, log_prior, exponent),
            ProductRule::Floored { floor } => {
                let gain = scale * (1.0 - floor) / floor * (-log_prior).exp();
                for (bin, poses) in &evidence.bins {
                    let belief = self.bins.entry(*bin).or_default();
                    belief.log += (exponent * (gain * f64::from(poses.weight)).ln_1p()) as f32;
                    belief.poses.add_scaled(poses, scale as f32);
                }
            }
        }
        self.has_evidence = true;
    }

    fn multiply_strict(
        &mut self,
        evidence: &PairEvidence,
        scale: f64,
        log_prior: f64,
        exponent: f64,
    ) {
        let first = !self.has_evidence;
        let mut product = FxHashMap::default();
        for (bin, poses) in &evidence.bins {
            let before =
                if first { Some(BinBelief::default()) } else { self.bins.get(bin).copied() };
            if let Some(mut belief) = before {
                let log = (scale * f64::from(poses.weight)).ln() - log_prior;
                belief.log += (exponent * log) as f32;
                belief.poses.add_scaled(poses, scale as f32);
                product.insert(*bin, belief);
            }
        }
        self.bins = product;
    }

    /// Resets the belief to the prior (re-seeding after a strict product has excluded
    /// everything, section 5.6.1).
    pub fn reset(&mut self) {
        self.bins.clear();
        self.has_evidence = false;
    }

    /// True when a strict product has left no possible pose.
    #[must_use]
    pub fn is_impossible(&self) -> bool {
        self.has_evidence && self.rule == ProductRule::Strict && self.bins.is_empty()
    }

    /// Drops the least likely bins above the capacity; they fall back to the floor. Ties are
    /// decided by the bin's name, so the result depends on nothing else.
    pub fn prune(&mut self) {
        if self.bins.len() <= self.capacity {
            return;
        }
        let mut order: Vec<(f32, PoseBin)> =
            self.bins.iter().map(|(bin, belief)| (belief.log, *bin)).collect();
        let by_evidence =
            |a: &(f32, PoseBin), b: &(f32, PoseBin)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        let (_, last, _) = order.select_nth_unstable_by(self.capacity - 1, by_evidence);
        let last = *last;
        self.bins.retain(|bin, belief| !by_evidence(&(belief.log, *bin), &last).is_gt());
    }

    /// ln of the evidence for this object: the sum over all its poses, with and without bins,
    /// given `log_count`, ln of the number of bins; 0 before any evidence.
    #[must_use]
    pub fn log_evidence(&self, log_count: f64) -> f64 {
        let mut logs: Vec<f64> = self.bins.values().map(|b| f64::from(b.log) - log_count).collect();
        logs.sort_by(f64::total_cmp);
        let unnamed = match self.rule {
            ProductRule::Strict if self.has_evidence => f64::NEG_INFINITY,
            _ => 0.0,
        };
        log_sum_exp(logs.into_iter().chain([unnamed]))
    }

    /// The best `n` bins, best first: ln of each one's unnormalised share of the sum of
    /// [`SparseHistogram::log_evidence`], its name and its mean pose.
    #[must_use]
    pub fn best(&self, n: usize, log_count: f64) -> Vec<(f64, PoseBin, Pose)> {
        let mut order: Vec<(f32, PoseBin)> =
            self.bins.iter().map(|(bin, belief)| (belief.log, *bin)).collect();
        let by_evidence =
            |a: &(f32, PoseBin), b: &(f32, PoseBin)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if order.len() > n && n > 0 {
            order.select_nth_unstable_by(n - 1, by_evidence);
            order.truncate(n);
        }
        order.sort_by(by_evidence);
        order
            .into_iter()
            .filter_map(|(log, bin)| {
                let pose = self.bins.get(&bin)?.poses.mean()?;
                Some((f64::from(log) - log_count, bin, pose))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::pose_bins::Lattice;
    use crate::rotation_grid::RotationGrid;
    use palpate_core::units::MM;

    const BINS: PoseBins = PoseBins {
        edge: 0.008,
        rotations: RotationGrid::CubedHypersphere { n: 6 },
        workspace: 0.4,
        lattice: Lattice::Space,
    };

    fn at(x: f64) -> Pose {
        Pose::from_parts(DQuat::IDENTITY, DVec3::new(x, 1.0 * MM, 1.0 * MM))
    }

    fn evidence(poses: &[(f64, f64)]) -> PairEvidence {
        let mut evidence = PairEvidence::default();
        for (x, weight) in poses {
            evidence.add(&BINS, &at(*x), *weight);
        }
        evidence
    }

    #[test]
    fn a_strict_product_keeps_bins_that_every_pair_supports() {
        let mut belief = SparseHistogram::new(ProductRule::Strict, 100);
        belief.multiply(&evidence(&[(1.0 * MM, 0.5), (20.0 * MM, 0.5)]), 1.0, 0.0, 1.0);
        belief.multiply(&evidence(&[(1.0 * MM, 0.25), (90.0 * MM, 0.75)]), 1.0, 0.0, 1.0);
        let best = belief.best(10, 0.0);
        assert_eq!(best.len(), 1);
        assert!((best[0].0 - (0.5_f64 * 0.25).ln()).abs() < 1e-6);
        belief.multiply(&evidence(&[(90.0 * MM, 1.0)]), 1.0, 0.0, 1.0);
        assert!(belief.is_impossible());
    }

    #[test]
    fn a_floored_product_forgives_one_missed_match() {
        // Two bins; prior 1/10 each. Pair 1 names A and B equally, pair 2 only B, pairs 3 and
        // 4 only A. With floor 0.1, relative to the prior, by hand: named alone: 1 + 9·10 =
        // 91; named by halves: 1 + 9·5 = 46; unnamed: 1.
        let mut belief = SparseHistogram::new(ProductRule::Floored { floor: 0.1 }, 100);
        let prior = 0.1_f64.ln();
        let (a, b) = (1.0 * MM, 50.0 * MM);
        belief.multiply(&evidence(&[(a, 0.5), (b, 0.5)]), 1.0, prior, 1.0);
        belief.multiply(&evidence(&[(b, 1.0)]), 1.0, prior, 1.0);
        belief.multiply(&evidence(&[(a, 1.0)]), 1.0, prior, 1.0);
        belief.multiply(&evidence(&[(a, 1.0)]), 1.0, prior, 1.0);
        let best = belief.best(2, 0.0);
        assert!((best[0].2.translation.x - a).abs() < 1e-6);
        assert!((best[0].0 - (46.0 * 91.0 * 91.0_f64).ln()).abs() < 1e-4);
        assert!((best[1].0 - (46.0 * 91.0_f64).ln()).abs() < 1e-4);
    }

    #[test]
    fn a_bins_mean_is_the_mean_of_its_evidence() {
        let mut belief = SparseHistogram::new(ProductRule::Floored { floor: 0.1 }, 100);
        belief.multiply(&evidence(&[(1.0 * MM, 3.0), (5.0 * MM, 1.0)]), 0.25, -3.0, 1.0);
        let best = belief.best(1, 0.0);
        assert!((best[0].2.translation.x - 2.0 * MM).abs() < 1e-7);
    }

    #[test]
    fn opposite_quaternions_do_not_cancel_in_the_mean() {
        let mut evidence = PairEvidence::default();
        let pose = at(0.0);
        evidence.add(&BINS, &pose, 1.0);
        evidence.add(&BINS, &Pose { rotation: -pose.rotation, ..pose }, 1.0);
        let mut belief = SparseHistogram::new(ProductRule::Strict, 100);
        belief.multiply(&evidence, 1.0, 0.0, 1.0);
        assert!(belief.best(1, 0.0)[0].2.angle_to(&pose) < 1e-6);
    }

    #[test]
    fn pruning_keeps_the_best() {
        let mut belief = SparseHistogram::new(ProductRule::Floored { floor: 0.1 }, 3);
        let many: Vec<(f64, f64)> =
            (0..20).map(|n| (f64::from(n) * 10.0 * MM, f64::from(n))).collect();
        belief.multiply(&evidence(&many), 0.01, -3.0, 1.0);
        belief.prune();
        assert_eq!(belief.best(20, 0.0).len(), 3);
        assert!((belief.best(1, 0.0)[0].2.translation.x - 190.0 * MM).abs() < 1e-6);
    }
}
