//! Priors of a match: Pr(c_i) and Pr(binD_k) of section 5.3.5, counted over the stored pairs.
//!
//! Equation 5.25 weighs a match by Pr(z|c_i) Pr(m|c_i) Pr(c_i) for both patches, and by
//! Pr(δ|binD_k) Pr(δ'|binD_k) Pr(binD_k). The kernel of section 5.3.4 gives the joint
//! Pr(δ, binD_k): two of them divided by Pr(binD_k) are that product.

use std::sync::Arc;

use palpate_core::vocabulary::ClassIdx;

use crate::sva::model::ObjectMap;

/// Priors of classes and distances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatchPriors {
    /// Even ones, as in the dissertation's experiments.
    Even,
    /// Counted priors of the classes, even ones of the distances.
    Classes,
    /// Counted priors of the distances, even ones of the classes.
    Distances,
    /// Counted priors of both.
    ClassesAndDistances,
}

/// Factors of a match relative to those of even priors.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MatchWeights {
    /// Pr(c_i) times the number of classes.
    classes: Vec<f64>,
    /// The reciprocal of Pr(binD_k) times the number of bins; 0 for a bin without pairs.
    distances: Vec<f64>,
}

impl MatchWeights {
    /// The factors of a catalogue.
    pub(super) fn new(objects: &[Arc<ObjectMap>], priors: MatchPriors) -> Self {
        let (mut classes, mut distances) = (Vec::new(), Vec::new());
        for object in objects {
            let index = object.index();
            let (of_classes, of_distances) = match priors {
                // A session begins without a walk over all pairs.
                MatchPriors::Even => {
                    (vec![0.0; index.n_classes()], vec![0.0; usize::from(index.distances().n())])
                }
                MatchPriors::Classes
                | MatchPriors::Distances
                | MatchPriors::ClassesAndDistances => index.masses(),
            };
            add(&mut classes, &of_classes);
            add(&mut distances, &of_distances);
        }
        let counts_classes =
            matches!(priors, MatchPriors::Classes | MatchPriors::ClassesAndDistances);
        let counts_distances =
            matches!(priors, MatchPriors::Distances | MatchPriors::ClassesAndDistances);
        let classes = if counts_classes { relative(&classes) } else { vec![1.0; classes.len()] };
        let reciprocal = |share: f64| if share > 0.0 { share.recip() } else { 0.0 };
        let distances = if counts_distances {
            relative(&distances).into_iter().map(reciprocal).collect()
        } else {
            vec![1.0; distances.len()]
        };
        Self { classes, distances }
    }

    /// The factor of matches of these classes and this distance bin.
    pub(super) fn of(&self, a: ClassIdx, b: ClassIdx, bin: u16) -> f64 {
        self.classes[usize::from(a.0)]
            * self.classes[usize::from(b.0)]
            * self.distances[usize::from(bin)]
    }

    /// Bytes of the factors.
    pub(super) fn bytes(&self) -> usize {
        (self.classes.capacity() + self.distances.capacity()) * size_of::<f64>()
    }
}

fn add(sums: &mut Vec<f64>, others: &[f64]) {
    sums.resize(sums.len().max(others.len()), 0.0);
    sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += other);
}

/// Masses divided by their mean; 1 each when there is no mass.
fn relative(masses: &[f64]) -> Vec<f64> {
    let total: f64 = masses.iter().sum();
    if total <= 0.0 {
        return vec![1.0; masses.len()];
    }
    masses.iter().map(|mass| mass * masses.len() as f64 / total).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sva::test_support::{N_CLASSES, map, patch};

    /// A map of patches at these x (mm), the first of class 0 and the others of class 1, and of
    /// enough others that are too far from everything to be in a pair.
    fn on_a_line(xs: &[f64]) -> Arc<ObjectMap> {
        let near = xs.iter().map(|x| patch([*x, 0.0, 0.0], &[(u8::from(*x > 0.0), 1.0)]));
        let far = (1..10).map(|k| patch([0.0, 1e3 * f64::from(k), 0.0], &[(5, 1.0)]));
        let patches: Vec<_> = near.chain(far).collect();
        map(&patches, patches.len())
    }

    #[test]
    fn counted_priors_are_shares_of_the_stored_pairs() {
        // Three patches on a line, of classes 0, 1 and 1: pairs (0, 1) of 35 mm and of 70 mm, and
        // (1, 1) of 35 mm. Class 0 is in 2 of 6 places, class 1 in 4; 35 mm in 2 of 3 pairs.
        let objects = [on_a_line(&[0.0, 35.0, 70.0])];
        let weights = MatchWeights::new(&objects, MatchPriors::ClassesAndDistances);
        let (of_0, of_1) = (N_CLASSES as f64 * 2.0 / 6.0, N_CLASSES as f64 * 4.0 / 6.0);
        let short = 1.0 / (10.0 * 2.0 / 3.0); // ten bins
        let long = 1.0 / (10.0 / 3.0);
        let found = |a: u8, b: u8, bin: u16| weights.of(ClassIdx(a), ClassIdx(b), bin);
        assert!((found(0, 1, 3) - of_0 * of_1 * short).abs() < 1e-3, "{weights:?}");
        assert!((found(1, 1, 7) - of_1 * of_1 * long).abs() < 1e-3, "{weights:?}");
        assert!(found(0, 1, 5).abs() < 1e-12); // no pair is 50 mm long
    }

    #[test]
    fn even_priors_change_nothing() {
        let weights = MatchWeights::new(&[on_a_line(&[0.0, 35.0])], MatchPriors::Even);
        assert!((weights.of(ClassIdx(0), ClassIdx(1), 3) - 1.0).abs() < f64::EPSILON);
        assert!((weights.of(ClassIdx(5), ClassIdx(5), 9) - 1.0).abs() < f64::EPSILON);
    }
}
