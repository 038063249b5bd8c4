//! Pruned soft association of a feature with its likely classes.
//!
//! Source: equations 5.15–5.19 with the readings of `docs/equations.md`: class priors are
//! uniform, so the pruned likelihoods normalise to the posterior.

use super::{ClassIdx, MIN_SPREAD};
use crate::descriptor::affinity;

/// A class and the probability that a feature belongs to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Association {
    /// The class.
    pub class: ClassIdx,
    /// Pr(class given feature), over the remaining classes.
    pub weight: f64,
}

/// Pruning of unlikely classes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssociationRule {
    /// T_a of equation 5.18: fraction of the best likelihood below which classes are dropped.
    pub threshold: f64,
    /// Maximum number of classes.
    pub max_classes: usize,
}

impl Default for AssociationRule {
    fn default() -> Self {
        Self { threshold: 0.75, max_classes: 4 }
    }
}

/// ψ of every class (equation 5.15): the mean of (1 − affinity)² over its members.
#[must_use]
pub fn spreads(features: &[Vec<f64>], medoids: &[Vec<f64>], membership: &[usize]) -> Vec<f64> {
    spreads_above(MIN_SPREAD, features, medoids, membership)
}

/// Like [`spreads`], with another floor.
#[must_use]
pub fn spreads_above(
    floor: f64,
    features: &[Vec<f64>],
    medoids: &[Vec<f64>],
    membership: &[usize],
) -> Vec<f64> {
    let mut sums = vec![(0.0, 0usize); medoids.len()];
    for (feature, class) in features.iter().zip(membership) {
        sums[*class].0 += (1.0 - affinity(feature, &medoids[*class])).powi(2);
        sums[*class].1 += 1;
    }
    sums.into_iter().map(|(sum, n)| (sum / n.max(1) as f64).max(floor)).collect()
}

/// ln Pr(feature given class), up to a constant (equation 5.16).
fn log_likelihood(affinity: f64, spread: f64) -> f64 {
    -(1.0 - affinity).powi(2) / (2.0 * spread) - 0.5 * spread.ln()
}

/// Equations 5.16–5.19, best class first.
#[must_use]
pub fn associate(
    feature: &[f64],
    medoids: &[Vec<f64>],
    spreads: &[f64],
    rule: AssociationRule,
) -> Vec<Association> {
    let mut candidates: Vec<(usize, f64)> = medoids
        .iter()
        .zip(spreads)
        .map(|(medoid, spread)| log_likelihood(affinity(feature, medoid), *spread))
        .enumerate()
        .collect();
    candidates.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let best = candidates.first().map_or(0.0, |candidate| candidate.1);
    let kept: Vec<(usize, f64)> = candidates
        .into_iter()
        .map(|(class, log)| (class, (log - best).exp()))
        .take(rule.max_classes.max(1))
        .take_while(|(_, relative)| *relative >= rule.threshold)
        .collect();
    let total: f64 = kept.iter().map(|(_, relative)| relative).sum();
    kept.into_iter()
        .map(|(class, relative)| Association {
            class: ClassIdx(class as u8),
            weight: relative / total,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_affinity(value: f64) -> Vec<f64> {
        vec![value, (1.0 - value * value).sqrt()]
    }

    #[test]
    fn the_spread_is_the_mean_square_of_one_less_the_affinity() {
        // Affinities 0.9 and 0.7 to the medoid: (0.01 + 0.09) / 2 = 0.05.
        let features = [at_affinity(0.9), at_affinity(0.7)];
        let spreads = spreads(&features, &[vec![1.0, 0.0]], &[0, 0]);
        assert!((spreads[0] - 0.05).abs() < 1e-12);
    }

    #[test]
    fn a_singleton_has_the_smallest_spread() {
        let spreads = spreads(&[vec![1.0, 0.0]], &[vec![1.0, 0.0]], &[0]);
        assert!((spreads[0] - MIN_SPREAD).abs() < 1e-15);
    }

    #[test]
    fn pruned_likelihoods_are_renormalised() {
        // ψ = 0.02 for all. Affinities 1, 0.95, 0.5 give likelihoods 1, e^−0.0625 = 0.9394,
        // e^−6.25 = 0.0019; at T_a = 0.75 two stay: 1/1.9394 = 0.5156 and 0.4844.
        let medoids = [vec![1.0, 0.0, 0.0], vec![0.95, 0.3, 0.08], vec![0.5, 0.8, 0.3]];
        let rule = AssociationRule { threshold: 0.75, max_classes: 4 };
        let kept = associate(&[1.0, 0.0, 0.0], &medoids, &[0.02; 3], rule);
        assert_eq!(kept.len(), 2);
        assert!((kept[0].weight - 0.5156).abs() < 1e-4, "{kept:?}");
        assert!((kept[1].weight - 0.4844).abs() < 1e-4, "{kept:?}");
    }

    #[test]
    fn a_tight_class_wins_over_a_wide_one_at_equal_affinity() {
        // Equal distance 0 from both medoids: ψ^(−1/2) decides, 10 against 5.
        let medoids = [vec![1.0, 0.0], vec![1.0, 0.0]];
        let rule = AssociationRule { threshold: 0.0, max_classes: 4 };
        let kept = associate(&[1.0, 0.0], &medoids, &[0.04, 0.01], rule);
        assert_eq!(kept[0].class, ClassIdx(1));
        assert!((kept[0].weight - 2.0 / 3.0).abs() < 1e-12);
    }
}
