//! Trials on held-out readings: accuracy, the calibrated exponent, confusion and affinity.
//!
//! A trial draws readings of one object without replacement and identifies the object. Draws
//! depend on the seed and the object alone.

use std::sync::Arc;

use rayon::prelude::*;

use crate::appearance::model::{
    AppearanceReport, AppearanceRule, NearDuplicate, ObjectAppearance, ObjectShares,
};
use palpate_core::log_prob;
use palpate_core::object::ObjectIdx;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::vocabulary::bag::correlation;
use palpate_core::vocabulary::choice::ClassCount;

/// Number of trials of each object.
const N_TRIALS: usize = 50;

/// Correlation of histograms from which two objects are reported as nearly equal.
pub const NEAR_DUPLICATE: f64 = 0.95;

/// Share of the probability that held-out readings give to the other object of a pair, from
/// which the pair is reported too. Readings of one object trained as two would give 0.5, even
/// with the noise of few readings in the histograms.
pub const CONFUSED_SHARE: f64 = 0.4;

/// One trial: the true object, and the sum of its readings' ln likelihoods by object.
struct Trial {
    truth: usize,
    log_likelihoods: Vec<f64>,
}

/// Trials of `n_readings` of every object, or of all its held-out readings if those are
/// fewer; none for an object without any.
fn trials(
    objects: &[Arc<ObjectAppearance>],
    shares: &ObjectShares,
    n_readings: usize,
    seed: u64,
) -> Vec<Trial> {
    let of_object = |(truth, object): (usize, &Arc<ObjectAppearance>)| -> Vec<Trial> {
        let evidence: Vec<Vec<f64>> = object
            .held_back
            .iter()
            .map(|reading| shares.log_likelihoods(reading, AppearanceRule::Divergence))
            .collect();
        if evidence.is_empty() {
            return Vec::new();
        }
        let mut stream = Stream::new(seed, Purpose::ReadingChoice, truth as u64);
        let mut order: Vec<usize> = (0..evidence.len()).collect();
        let mut draw = || {
            let n = n_readings.min(order.len());
            let mut sum = vec![0.0; objects.len()];
            for place in 0..n {
                let other = place + stream.index(order.len() - place);
                order.swap(place, other);
                let reading = &evidence[order[place]];
                sum.iter_mut().zip(reading).for_each(|(sum, log)| *sum += log);
            }
            Trial { truth, log_likelihoods: sum }
        };
        (0..N_TRIALS).map(|_| draw()).collect()
    };
    let parts: Vec<Vec<Trial>> = objects.par_iter().enumerate().map(of_object).collect();
    parts.into_iter().flatten().collect()
}

fn probabilities(trial: &Trial, exponent: f64) -> Vec<f64> {
    let logs: Vec<f64> = trial.log_likelihoods.iter().map(|log| exponent * log).collect();
    log_prob::normalize(&logs)
}

fn is_right(trial: &Trial) -> bool {
    let own = trial.log_likelihoods[trial.truth];
    let others = trial.log_likelihoods.iter().enumerate().filter(|(o, _)| *o != trial.truth);
    others.fold(true, |right, (_, log)| right && *log < own)
}

fn share_right(trials: &[Trial]) -> f64 {
    trials.iter().filter(|trial| is_right(trial)).count() as f64 / trials.len().max(1) as f64
}

/// Result of a number of classes: section 4.4.2.1.
pub(super) fn count(
    objects: &[Arc<ObjectAppearance>],
    shares: &ObjectShares,
    n_classes: usize,
    n_readings: usize,
    seed: u64,
) -> ClassCount {
    let trials = trials(objects, shares, n_readings, seed);
    let weights: f64 = trials.iter().map(|trial| probabilities(trial, 1.0)[trial.truth]).sum();
    ClassCount {
        n_classes,
        accuracy: share_right(&trials),
        reliability: weights / trials.len().max(1) as f64,
    }
}

/// The exponent, 0.01 to 1, that maximises the likelihood of the true objects in trials of 1,
/// 3, 10, … readings; 1 without held-out readings or with a single object.
///
/// The loss is convex in the exponent, so a ternary search finds its minimum.
pub(super) fn fit_exponent(
    objects: &[Arc<ObjectAppearance>],
    shares: &ObjectShares,
    n_readings: usize,
    seed: u64,
) -> f64 {
    let sizes = [1, 3, 10, 30, 100, 300].into_iter().take_while(|n| *n < n_readings);
    let all: Vec<Trial> = sizes
        .chain(std::iter::once(n_readings))
        .flat_map(|n| trials(objects, shares, n, seed))
        .collect();
    if all.is_empty() || objects.len() < 2 {
        return 1.0;
    }
    let loss = |exponent: f64| -> f64 {
        let one = |trial: &Trial| {
            let logs = trial.log_likelihoods.iter().map(|log| exponent * log);
            log_prob::log_sum_exp(logs) - exponent * trial.log_likelihoods[trial.truth]
        };
        all.iter().map(one).sum()
    };
    let (mut low, mut high) = (0.01, 1.0);
    for _step in 0..40 {
        let third = (high - low) / 3.0;
        if loss(low + third) < loss(high - third) { high -= third } else { low += third }
    }
    0.5 * (low + high)
}

/// Confusion, affinity and near duplicates (figures 4.9 and 4.10).
pub(super) fn report(
    objects: &[Arc<ObjectAppearance>],
    shares: &ObjectShares,
    exponent: f64,
    n_readings: usize,
    seed: u64,
) -> AppearanceReport {
    let n = objects.len();
    let trials = trials(objects, shares, n_readings, seed);
    let mut confusion = vec![vec![0.0; n]; n];
    let mut counts = vec![0usize; n];
    for trial in &trials {
        counts[trial.truth] += 1;
        let row = &mut confusion[trial.truth];
        row.iter_mut().zip(probabilities(trial, exponent)).for_each(|(sum, p)| *sum += p);
    }
    for (row, count) in confusion.iter_mut().zip(counts) {
        row.iter_mut().for_each(|sum| *sum /= count.max(1) as f64);
    }
    let known = &shares.known;
    let affinity: Vec<Vec<f64>> =
        known.iter().map(|a| known.iter().map(|b| correlation(a, b)).collect()).collect();
    let near_duplicates = near_duplicates(&affinity, &confusion);
    AppearanceReport {
        n_readings,
        confusion,
        accuracy: share_right(&trials),
        near_duplicates,
        affinity,
    }
}

fn near_duplicates(affinity: &[Vec<f64>], confusion: &[Vec<f64>]) -> Vec<NearDuplicate> {
    let is_confused = |a: usize, b: usize| {
        let other = confusion[a][b] + confusion[b][a];
        let both = confusion[a][a] + confusion[b][b] + other;
        both > 0.0 && other >= CONFUSED_SHARE * both
    };
    let mut pairs: Vec<NearDuplicate> = (0..affinity.len())
        .flat_map(|second| (0..second).map(move |first| (first, second)))
        .filter(|(first, second)| {
            affinity[*first][*second] >= NEAR_DUPLICATE || is_confused(*first, *second)
        })
        .map(|(first, second)| NearDuplicate {
            first: ObjectIdx(first as u32),
            second: ObjectIdx(second as u32),
            affinity: affinity[first][second],
        })
        .collect();
    pairs.sort_by(|a, b| {
        let order = b.affinity.total_cmp(&a.affinity);
        order.then(a.first.cmp(&b.first)).then(a.second.cmp(&b.second))
    });
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::appearance::model::ReadingClasses;
    use palpate_core::vocabulary::bag::ClassHistogram;

    /// An object with these shares and `held` hard held-out readings of each class.
    fn object(mass: [f64; 2], held: [usize; 2]) -> Arc<ObjectAppearance> {
        let hard = |class: usize| {
            let shares = if class == 0 { vec![1.0, 0.0] } else { vec![0.0, 1.0] };
            ReadingClasses { shares: vec![shares] }
        };
        let held_back = [0, 1].iter().flat_map(|c| vec![hard(*c); held[*c]]).collect();
        let histogram = ClassHistogram { mass: mass.to_vec() };
        Arc::new(ObjectAppearance { histogram, joint: vec![0.5; 2], held_back })
    }

    fn shares(objects: &[Arc<ObjectAppearance>]) -> ObjectShares {
        let known = objects.iter().map(|o| o.histogram.probabilities(0.0)).collect();
        ObjectShares { known, priors: vec![1.0; 2] }
    }

    #[test]
    fn confusion_is_the_probability_after_the_readings() {
        // One reading, always class 0: 0.9 / (0.9 + 0.3) and 0.1 / (0.1 + 0.7) for class 1.
        let objects = [object([9.0, 1.0], [5, 0]), object([3.0, 7.0], [0, 5])];
        let report = report(&objects, &shares(&objects), 1.0, 1, 1);
        assert!((report.confusion[0][0] - 0.75).abs() < 1e-12);
        assert!((report.confusion[1][0] - 0.125).abs() < 1e-12);
        assert!((report.accuracy - 1.0).abs() < 1e-12);
        // cos((0.9, 0.1), (0.3, 0.7)) = 0.34 / √(0.82 · 0.58)
        assert!((report.affinity[0][1] - 0.34 / (0.82_f64 * 0.58).sqrt()).abs() < 1e-12);
        assert!(report.near_duplicates.is_empty());
    }

    #[test]
    fn objects_with_similar_histograms_are_reported() {
        let objects =
            [object([9.0, 1.0], [0, 0]), object([1.0, 9.0], [0, 0]), object([8.8, 1.2], [0, 0])];
        let found = report(&objects, &shares(&objects), 1.0, 1, 1).near_duplicates;
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].first, found[0].second), (ObjectIdx(0), ObjectIdx(2)));
    }

    #[test]
    fn objects_with_confused_readings_are_reported() {
        // Histograms differ (cos = 0.48 / 0.52 = 0.92), but every held-out reading of both is
        // of class 0: 0.6 / (0.6 + 0.4) and 0.4, so the other gets half of the probability of
        // the pair.
        let objects = [object([6.0, 4.0], [5, 0]), object([4.0, 6.0], [5, 0])];
        let found = report(&objects, &shares(&objects), 1.0, 1, 1);
        assert!((found.affinity[0][1] - 0.48 / 0.52).abs() < 1e-12);
        assert_eq!(found.near_duplicates.len(), 1);
        // 0.9 / 1.0 and 0.1: the other gets a tenth.
        let objects = [object([9.0, 1.0], [5, 0]), object([1.0, 9.0], [0, 5])];
        assert!(report(&objects, &shares(&objects), 1.0, 1, 1).near_duplicates.is_empty());
    }

    #[test]
    fn the_exponent_falls_for_overconfident_histograms() {
        // Predicted 90 to 10, held out 60 to 40: the likeliest exponent for single readings
        // solves 9^e = 1.5: e = ln 1.5 / ln 9 = 0.185.
        let objects = [object([9.0, 1.0], [60, 40]), object([1.0, 9.0], [40, 60])];
        let found = fit_exponent(&objects, &shares(&objects), 1, 3);
        assert!((found - 0.185).abs() < 0.12, "{found}");
        let honest = [object([6.0, 4.0], [90, 10]), object([4.0, 6.0], [10, 90])];
        assert!((fit_exponent(&honest, &shares(&honest), 1, 3) - 1.0).abs() < 1e-3);
        let nothing = [object([6.0, 4.0], [0, 0]), object([4.0, 6.0], [0, 0])];
        assert!((fit_exponent(&nothing, &shares(&nothing), 1, 3) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_candidate_is_rated_by_accuracy_and_reliability() {
        let objects = [object([9.0, 1.0], [5, 0]), object([3.0, 7.0], [0, 5])];
        let found = count(&objects, &shares(&objects), 2, 1, 1);
        assert!((found.accuracy - 1.0).abs() < 1e-12);
        assert!((found.reliability - 0.5 * (0.75 + 0.875)).abs() < 1e-12);
    }
}
