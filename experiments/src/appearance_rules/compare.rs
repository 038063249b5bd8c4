//! Comparison of the histogram of some readings with those of known objects.

use palpate_core::log_prob::{log_sum_exp, normalize};
use palpate_core::vocabulary::bag::{
    chi_squared, correlation, divergence, intersection, jensen_shannon, log_mixture_ratio,
};
use palpate_dissertation::appearance::model::{AppearanceModel, ObjectShares};

use crate::appearance_trials::{Point, Verdict, drawn};

/// A way to compare histograms; the object with the largest score is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// Least divergence of the known from the observed histogram (equations 4.1–4.4).
    Divergence,
    /// Least divergence the other way round.
    ReverseDivergence,
    /// Least Jensen–Shannon divergence.
    JensenShannon,
    /// Least χ².
    ChiSquared,
    /// Largest intersection.
    Intersection,
    /// Largest cosine.
    Cosine,
    /// Largest likelihood of a mixture with the object's weights: shares are divided by the priors
    /// of the classes, which the print leaves out.
    ClassPriors,
    /// Least divergence of histograms of summed joint densities, as equation 4.17 is printed.
    LiteralJoint,
}

impl Rule {
    pub(super) const ALL: [Self; 8] = [
        Self::Divergence,
        Self::ReverseDivergence,
        Self::JensenShannon,
        Self::ChiSquared,
        Self::Intersection,
        Self::Cosine,
        Self::ClassPriors,
        Self::LiteralJoint,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Divergence => "divergence",
            Self::ReverseDivergence => "reverse_divergence",
            Self::JensenShannon => "jensen_shannon",
            Self::ChiSquared => "chi_squared",
            Self::Intersection => "intersection",
            Self::Cosine => "cosine",
            Self::ClassPriors => "class_priors",
            Self::LiteralJoint => "literal_joint",
        }
    }
}

/// One test reading in the classes.
pub(super) struct Seen {
    /// Its shares, which sum to 1.
    pub(super) shares: Vec<f64>,
    /// ln of its joint densities with the classes.
    pub(super) joint: Vec<f64>,
}

/// The histograms of the objects.
pub(super) struct Known {
    shares: ObjectShares,
    joint: ObjectShares,
}

impl Known {
    pub(super) fn new(model: &AppearanceModel) -> Self {
        let clustering = &model.vocabulary.clustering;
        Self {
            shares: ObjectShares::new(&model.objects, clustering, model.smoothing),
            joint: ObjectShares::joint(&model.objects, model.smoothing),
        }
    }
}

/// Known objects and test readings, one list an object.
pub(super) struct Comparison {
    pub(super) known: Known,
    pub(super) seen: Vec<Vec<Seen>>,
}

impl Comparison {
    /// Accuracy after each of the rising `counts`, over `trials` of each object. All rules draw the
    /// same readings.
    pub(super) fn accuracies(
        &self,
        rule: Rule,
        counts: &[usize],
        trials: usize,
        seed: u64,
    ) -> Vec<Point> {
        let lengths: Vec<usize> = self.seen.iter().map(Vec::len).collect();
        drawn(&lengths, counts, trials, seed, |truth, order| {
            let verdict = |count: &usize| {
                let readings: Vec<&Seen> =
                    order[..*count].iter().map(|at| &self.seen[truth][*at]).collect();
                Verdict { truth, named: self.named(rule, &readings), stated: f64::NAN }
            };
            counts.iter().filter(|count| **count <= order.len()).map(verdict).collect()
        })
    }

    /// The object whose histogram is nearest to that of some readings; the first of equals.
    fn named(&self, rule: Rule, drawn: &[&Seen]) -> usize {
        let scores = self.scores(rule, drawn);
        (1..scores.len()).fold(0, |a, b| if scores[b] > scores[a] { b } else { a })
    }

    /// The score of every object.
    fn scores(&self, rule: Rule, drawn: &[&Seen]) -> Vec<f64> {
        let (observed, known) = match rule {
            Rule::LiteralJoint => (joint_shares(drawn), &self.known.joint),
            _ => (mean_shares(drawn), &self.known.shares),
        };
        let log_ratio =
            |object: &[f64], seen: &Seen| log_mixture_ratio(&seen.shares, object, &known.priors);
        let score = |object: &Vec<f64>| match rule {
            Rule::Divergence | Rule::LiteralJoint => -divergence(&observed, object),
            Rule::ReverseDivergence => -divergence(object, &smoothed(&observed, drawn.len())),
            Rule::JensenShannon => -jensen_shannon(&observed, object),
            Rule::ChiSquared => -chi_squared(&observed, object),
            Rule::Intersection => intersection(&observed, object),
            Rule::Cosine => correlation(&observed, object),
            Rule::ClassPriors => drawn.iter().map(|seen| log_ratio(object, seen)).sum(),
        };
        known.known.iter().map(score).collect()
    }
}

/// The histogram of some readings: the mean of their shares.
fn mean_shares(drawn: &[&Seen]) -> Vec<f64> {
    let mut mean = vec![0.0; drawn.first().map_or(0, |seen| seen.shares.len())];
    for seen in drawn {
        mean.iter_mut().zip(&seen.shares).for_each(|(sum, share)| *sum += share);
    }
    mean.iter_mut().for_each(|sum| *sum /= drawn.len() as f64);
    mean
}

/// A histogram of `n` readings with one more reading spread over all classes, as the divergence
/// from it needs no empty class.
fn smoothed(observed: &[f64], n: usize) -> Vec<f64> {
    let (n, even) = (n as f64, 1.0 / observed.len() as f64);
    observed.iter().map(|share| (n * share + even) / (n + 1.0)).collect()
}

/// Equation 4.17 as printed for some readings.
fn joint_shares(drawn: &[&Seen]) -> Vec<f64> {
    let n_classes = drawn.first().map_or(0, |seen| seen.joint.len());
    let sum = |class: usize| log_sum_exp(drawn.iter().map(|seen| seen.joint[class]));
    normalize(&(0..n_classes).map(sum).collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Objects of classes (0.8, 0.2) and (0.3, 0.7); readings of the first are four of class 0 and
    /// one of class 1, of the second the other way round.
    fn comparison() -> Comparison {
        let known =
            || ObjectShares { known: vec![vec![0.8, 0.2], vec![0.3, 0.7]], priors: vec![0.5, 0.5] };
        let seen = |class: usize| {
            let shares = vec![f64::from(u8::from(class == 0)), f64::from(u8::from(class == 1))];
            // The densities of class 1 are a thousand times those of class 0.
            let joint = shares.iter().zip([1.0_f64, 1e3]).map(|(s, d)| (s * d).ln()).collect();
            Seen { shares, joint }
        };
        let first = (0..5).map(|idx| seen(usize::from(idx == 4))).collect();
        let second = (0..5).map(|idx| seen(usize::from(idx > 0))).collect();
        Comparison { known: Known { shares: known(), joint: known() }, seen: vec![first, second] }
    }

    #[test]
    fn all_rules_but_the_literal_one_name_both_objects() {
        for rule in Rule::ALL {
            let points = comparison().accuracies(rule, &[5, 9], 3, 1);
            assert_eq!(points.len(), 1, "nobody has 9 readings");
            // One reading in the denser class outweighs four others.
            let expected = if rule == Rule::LiteralJoint { 0.5 } else { 1.0 };
            assert!((points[0].accuracy - expected).abs() < 1e-12, "{rule:?}: {points:?}");
        }
    }

    #[test]
    fn single_readings_are_right_as_often_as_they_are_typical() {
        // Four of five readings of each object are of its class.
        let points = comparison().accuracies(Rule::Divergence, &[1], 4_000, 1);
        assert!((points[0].accuracy - 0.8).abs() < 0.015, "{points:?}");
    }
}
