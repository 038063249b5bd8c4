//! Bags of features: histograms of an object's touches over the appearance classes.
//!
//! Source: section 4.3.1.2 (equations 4.1–4.4) and its reading as a maximum of likelihood
//! (4.18–4.22); smoothing and per-feature responsibilities as in `docs/equations.md`. Each
//! reading has mass 1, whatever the number of its features and of an object's readings. Not
//! here: the classes (`kmeans`, `gmm`).

use super::gmm::Mixture;
use super::kmeans::KMeans;
use crate::log_prob;

/// The classes of a vocabulary, and the membership of features in them.
#[derive(Clone, Debug, PartialEq)]
pub enum Clustering {
    /// A feature belongs to the class of the nearest centre.
    KMeans(KMeans),
    /// A feature belongs to every class by its responsibility.
    Mixture(Mixture),
}

impl Clustering {
    /// The number of classes.
    #[must_use]
    pub fn n_classes(&self) -> usize {
        match self {
            Self::KMeans(classes) => classes.centers.len(),
            Self::Mixture(mixture) => mixture.components().len(),
        }
    }

    /// The length of the features that can be classified.
    #[must_use]
    pub fn dimension(&self) -> usize {
        match self {
            Self::KMeans(classes) => classes.centers[0].len(),
            Self::Mixture(mixture) => mixture.dimension(),
        }
    }

    /// ln Pr(x|g_i)·Pr(g_i) of each class; with k-means 0 for the nearest, −∞ for others.
    #[must_use]
    pub fn log_joint(&self, feature: &[f64]) -> Vec<f64> {
        match self {
            Self::KMeans(classes) => {
                let mut logs = vec![f64::NEG_INFINITY; classes.centers.len()];
                logs[classes.nearest(feature)] = 0.0;
                logs
            }
            Self::Mixture(mixture) => mixture.log_joint(feature),
        }
    }

    /// The shares in which a feature belongs to the classes; they sum to 1.
    #[must_use]
    pub fn shares(&self, feature: &[f64]) -> Vec<f64> {
        log_prob::normalize(&self.log_joint(feature))
    }

    /// Prior probabilities Pr(g_i) of the classes whose shares come from densities; a share
    /// divided by its prior is a likelihood. 1 for every hard class.
    #[must_use]
    pub fn priors(&self) -> Vec<f64> {
        match self {
            Self::KMeans(classes) => vec![1.0; classes.centers.len()],
            Self::Mixture(mixture) => mixture.components().iter().map(|part| part.weight).collect(),
        }
    }
}

/// Mass of the readings in each class; every reading adds 1 in total.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClassHistogram {
    /// Mass of each class, at least 0.
    pub mass: Vec<f64>,
}

impl ClassHistogram {
    /// The histogram of readings, each given by its shares.
    #[must_use]
    pub fn of(n_classes: usize, readings: &[Vec<f64>]) -> Self {
        let mut mass = vec![0.0; n_classes];
        for shares in readings {
            mass.iter_mut().zip(shares).for_each(|(mass, share)| *mass += share);
        }
        Self { mass }
    }

    /// Number of readings.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.mass.iter().sum()
    }

    /// Pr(c_i|O): the histogram with `smoothing` more readings in every class, summing to 1.
    ///
    /// One reading, the default, is 1/n of an object's n readings; 0 leaves empty classes at
    /// probability 0. Without any mass all classes are equal.
    #[must_use]
    pub fn probabilities(&self, smoothing: f64) -> Vec<f64> {
        let total = self.total() + smoothing * self.mass.len() as f64;
        if total <= 0.0 {
            return vec![(self.mass.len().max(1) as f64).recip(); self.mass.len()];
        }
        self.mass.iter().map(|mass| (mass + smoothing) / total).collect()
    }
}

/// The shares of a reading: the mean over its features, with mass 1.
#[must_use]
pub fn reading_shares(features: &[Vec<f64>]) -> Vec<f64> {
    let n_classes = features.first().map_or(0, Vec::len);
    let mut shares = ClassHistogram::of(n_classes, features).mass;
    shares.iter_mut().for_each(|share| *share /= features.len() as f64);
    shares
}

/// Equation 4.17 as printed: sums joint densities of all features (given as logs), so that
/// features in dense regions dominate. Sums to 1.
#[must_use]
pub fn joint_shares(n_classes: usize, log_joints: &[Vec<f64>]) -> Vec<f64> {
    let logs: Vec<f64> = (0..n_classes)
        .map(|class| log_prob::log_sum_exp(log_joints.iter().map(|logs| logs[class])))
        .collect();
    log_prob::normalize(&logs)
}

/// Equations 4.2 and 4.3: the divergence of `known` from `observed`, both summing to 1, in
/// nats; infinite where an observed class is impossible.
#[must_use]
pub fn divergence(observed: &[f64], known: &[f64]) -> f64 {
    let terms = observed.iter().zip(known).filter(|(p, _)| **p > 0.0);
    terms.map(|(p, q)| p * (p / q).ln()).sum()
}

/// Equation 4.22 for one reading: Σ_i Pr(c_i|Z) ln Pr(c_i|O). Times the number of readings it
/// is the log-likelihood; equation 4.4 minimises its negative.
#[must_use]
pub fn log_likelihood(observed: &[f64], known: &[f64]) -> f64 {
    let terms = observed.iter().zip(known).filter(|(p, _)| **p > 0.0);
    terms.map(|(p, q)| p * q.ln()).sum()
}

/// ln of a feature's likelihood ratio: ln Σ_i Pr(g_i|x) Pr(c_i|O) / Pr(g_i), which is ln
/// Pr(x|O) − ln Pr(x) when an object is a mixture of the same Gaussians with its own weights.
/// With hard classes it is equation 4.19.
#[must_use]
pub fn log_mixture_ratio(shares: &[f64], known: &[f64], priors: &[f64]) -> f64 {
    let terms = shares.iter().zip(known).zip(priors);
    terms.map(|((share, known), prior)| share * known / prior).sum::<f64>().ln()
}

/// χ² between two histograms that sum to 1: Σ (p − q)² / (p + q), 0 when equal, 2 when apart.
#[must_use]
pub fn chi_squared(a: &[f64], b: &[f64]) -> f64 {
    let terms = a.iter().zip(b).filter(|(p, q)| **p + **q > 0.0);
    terms.map(|(p, q)| (p - q).powi(2) / (p + q)).sum()
}

/// The intersection of two histograms that sum to 1: Σ min(p, q), 1 when equal, 0 when apart.
#[must_use]
pub fn intersection(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(p, q)| p.min(*q)).sum()
}

/// The Jensen–Shannon divergence of two histograms that sum to 1, nats: the mean divergence of both
/// from their mean.
#[must_use]
pub fn jensen_shannon(a: &[f64], b: &[f64]) -> f64 {
    let mean: Vec<f64> = a.iter().zip(b).map(|(p, q)| 0.5 * (p + q)).collect();
    0.5 * (divergence(a, &mean) + divergence(b, &mean))
}

/// The cosine between two histograms: the affinity of figure 4.9.
#[must_use]
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let norms = (dot(a, a) * dot(b, b)).sqrt();
    if norms > 0.0 { dot(a, b) / norms } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::vocabulary::gmm::Component;

    fn distribution(values: &[f64]) -> Vec<f64> {
        let total: f64 = values.iter().sum();
        values.iter().map(|value| value / total).collect()
    }

    #[test]
    fn the_divergence_is_the_written_out_sum() {
        // ½ ln(½/¼) + ½ ln(½/¾) = ½ ln 2 + ½ ln ⅔ = ½ ln(4/3).
        let found = divergence(&[0.5, 0.5], &[0.25, 0.75]);
        assert!((found - 0.5 * (4.0_f64 / 3.0).ln()).abs() < 1e-12);
        assert!(divergence(&[0.5, 0.5], &[1.0, 0.0]).is_infinite());
        assert!(divergence(&[1.0, 0.0], &[1.0, 0.0]).abs() < 1e-15);
    }

    #[test]
    fn other_comparisons_match_hand_computed_values() {
        let (a, b) = ([0.5, 0.5, 0.0], [0.25, 0.25, 0.5]);
        // 2 · (1/16) / (3/4) + (1/4) / (1/2) = 1/6 + 1/2.
        assert!((chi_squared(&a, &b) - 2.0 / 3.0).abs() < 1e-12);
        assert!((intersection(&a, &b) - 0.5).abs() < 1e-12);
        // Mean (⅜, ⅜, ¼): a gives ln(4/3), b gives ½ ln(2/3) + ½ ln 2.
        let expected = 0.5 * ((4.0_f64 / 3.0).ln() + 0.5 * (2.0_f64 / 3.0).ln() + 0.5 * 2f64.ln());
        assert!((jensen_shannon(&a, &b) - expected).abs() < 1e-12);
        let apart = [0.0, 0.0, 1.0];
        assert!((chi_squared(&a, &apart) - 2.0).abs() < 1e-12);
        assert!((jensen_shannon(&a, &apart) - 2f64.ln()).abs() < 1e-12);
        assert!(chi_squared(&a, &a).abs() < 1e-15 && jensen_shannon(&b, &b).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn least_divergence_is_greatest_likelihood(
            counts in prop::collection::vec(0_u32..9, 5),
            known in prop::collection::vec(prop::collection::vec(0.05..1.0_f64, 5), 2..6),
        ) {
            prop_assume!(counts.iter().sum::<u32>() > 0);
            let n = f64::from(counts.iter().sum::<u32>());
            let observed: Vec<f64> = counts.iter().map(|count| f64::from(*count) / n).collect();
            for pair in known.windows(2) {
                let [a, b] = [distribution(&pair[0]), distribution(&pair[1])];
                // Equation 4.19 feature by feature, against n times equation 4.22.
                let product = |known: &[f64]| -> f64 {
                    counts.iter().zip(known).map(|(k, p)| f64::from(*k) * p.ln()).sum()
                };
                prop_assert!((product(&a) - n * log_likelihood(&observed, &a)).abs() < 1e-9);
                // Equations 4.1 and 4.18 order any two objects equally, by the same margin.
                let less = divergence(&observed, &b) - divergence(&observed, &a);
                prop_assert!((n * less - (product(&a) - product(&b))).abs() < 1e-9);
            }
        }

        #[test]
        fn hard_classes_make_the_mixture_ratio_equation_4_19(
            class in 0_usize..4,
            known in prop::collection::vec(0.05..1.0_f64, 4),
        ) {
            let (known, mut shares) = (distribution(&known), vec![0.0; 4]);
            shares[class] = 1.0;
            let ratio = log_mixture_ratio(&shares, &known, &[1.0; 4]);
            prop_assert!((ratio - log_likelihood(&shares, &known)).abs() < 1e-12);
        }
    }

    #[test]
    fn an_object_as_a_mixture_has_the_density_of_that_mixture() {
        let part =
            |weight: f64, mean: f64| Component { weight, mean: vec![mean], covariance: vec![1.0] };
        let all = Mixture::new(vec![part(0.5, 0.0), part(0.5, 1.5)]).unwrap();
        let own = Mixture::new(vec![part(0.2, 0.0), part(0.8, 1.5)]).unwrap();
        let shares = all.responsibilities(&[0.7]);
        let ratio = log_mixture_ratio(&shares, &[0.2, 0.8], &[0.5, 0.5]);
        let expected = own.log_density(&[0.7]) - all.log_density(&[0.7]);
        assert!((ratio - expected).abs() < 1e-12);
    }

    #[test]
    fn smoothing_adds_readings_and_sizes_cancel() {
        // (3 + 1) and (0 + 1) of 5; ten times as many readings, unsmoothed, give the same.
        let few = ClassHistogram { mass: vec![3.0, 0.0] };
        assert_eq!(few.probabilities(1.0), [0.8, 0.2]);
        let many = ClassHistogram { mass: vec![30.0, 10.0] };
        let some = ClassHistogram { mass: vec![3.0, 1.0] };
        assert_eq!(many.probabilities(0.0), some.probabilities(0.0));
        assert_eq!(ClassHistogram { mass: vec![0.0; 2] }.probabilities(0.0), [0.5, 0.5]);
    }

    #[test]
    fn several_features_of_a_reading_have_mass_one() {
        let four = vec![vec![1.0, 0.0], vec![0.0, 1.0], vec![1.0, 0.0], vec![1.0, 0.0]];
        assert_eq!(reading_shares(&four), [0.75, 0.25]);
        let histogram = ClassHistogram::of(2, &[reading_shares(&four), vec![0.0, 1.0]]);
        assert!((histogram.total() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn printed_joint_densities_let_one_dense_touch_dominate() {
        // Three features of class 0 with small densities, one of class 1 with a large one.
        let logs = [vec![-9.0, -40.0], vec![-9.0, -40.0], vec![-9.0, -40.0], vec![-40.0, 9.0]];
        assert!(joint_shares(2, &logs)[1] > 0.999);
        let shares: Vec<Vec<f64>> = logs.iter().map(|logs| log_prob::normalize(logs)).collect();
        assert!((reading_shares(&shares)[0] - 0.75).abs() < 1e-9);
    }

    #[test]
    fn comparisons_agree_on_equal_and_disjoint_histograms() {
        let (a, b) = ([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]);
        assert!((correlation(&a, &a) - 1.0).abs() < 1e-12 && correlation(&a, &b).abs() < 1e-12);
    }
}
