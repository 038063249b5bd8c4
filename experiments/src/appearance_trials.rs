//! Trials of appearance models: trained on some readings of each object, tested on others.
//!
//! A trial takes readings of one object, drawn at random without replacement or in the order
//! they were taken, and identifies the object after each count of readings. Evidence of a
//! reading does not depend on the others (`core::appearance`), so each test reading is
//! classified once. Figures of chapter 4 plot the share of trials that are right.

use std::sync::Arc;

use palpate_core::contact::touches;
use palpate_core::log_prob;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_dissertation::appearance::model::{AppearanceModel, AppearanceRule, ObjectShares};
use palpate_dissertation::appearance::train::{
    AppearanceConfig, AppearanceSet, appearance_model, learn_appearance_vocabulary,
    object_histogram,
};
use palpate_sim::plot;
use rayon::prelude::*;
use serde::Serialize;

use crate::statistics::standard_error_over_groups;

/// Learns vocabulary, histograms and exponent from `readings`, one list an object.
///
/// # Errors
/// When the readings or the configuration cannot be learnt from.
pub fn train(
    readings: &[Vec<Reading>],
    sensor: &SensorDescription,
    config: &AppearanceConfig,
    seed: u64,
) -> anyhow::Result<AppearanceModel> {
    train_with_vocabulary_of(usize::MAX, readings, sensor, config, seed)
}

/// Trains with a vocabulary from only the first `n` readings of each object: classes need
/// fewer readings than histograms, and their time grows with them.
///
/// # Errors
/// When the readings or the configuration cannot be learnt from.
pub fn train_with_vocabulary_of(
    n: usize,
    readings: &[Vec<Reading>],
    sensor: &SensorDescription,
    config: &AppearanceConfig,
    seed: u64,
) -> anyhow::Result<AppearanceModel> {
    let sets = |n: usize| -> Vec<AppearanceSet<'_>> {
        let first = readings.iter().map(|readings| &readings[..n.min(readings.len())]);
        first.map(|readings| AppearanceSet::Readings(TrainingSet { readings, sensor })).collect()
    };
    let vocabulary = Arc::new(learn_appearance_vocabulary(&sets(n), config, seed)?);
    let histogram =
        |set: &AppearanceSet<'_>| Ok(Arc::new(object_histogram(set, &vocabulary, config)?));
    let objects = sets(usize::MAX).iter().map(histogram).collect::<anyhow::Result<_>>()?;
    Ok(appearance_model(vocabulary, objects, config, seed))
}

/// Evidence of every test reading for every object.
pub struct Evidence {
    /// By true object, then by reading: ln likelihood of each object.
    by_object: Vec<Vec<Vec<f64>>>,
    /// The model's exponent, for probabilities.
    exponent: f64,
}

/// Figures of trials after some number of readings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Number of readings.
    pub readings: usize,
    /// Share of the trials in which the true object was the most likely one.
    pub accuracy: f64,
    /// Its standard error over the objects; NaN for one object.
    #[serde(rename = "standard_error_over_objects")]
    pub standard_error: f64,
    /// Mean probability of the most likely object.
    #[serde(rename = "stated_probability_mean")]
    pub stated: f64,
    /// Trials that named another object: true object, named object, number of trials; most
    /// frequent first.
    #[serde(skip)]
    pub confusions: Vec<(usize, usize, usize)>,
}

/// Confusions of two objects.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Confused {
    /// After this many readings.
    pub readings: usize,
    /// In this many trials.
    pub trials: usize,
}

/// One trial after one count of readings.
pub(crate) struct Verdict {
    pub(crate) truth: usize,
    pub(crate) named: usize,
    /// Probability of the named object; NaN for rules that state none.
    pub(crate) stated: f64,
}

impl Evidence {
    /// Classifies test readings, one list an object in the model's order; presses without
    /// contact are left out.
    #[must_use]
    pub fn of(
        model: &AppearanceModel,
        readings: &[Vec<Reading>],
        sensor: &SensorDescription,
        rule: AppearanceRule,
    ) -> Self {
        Self::weighed(model, readings, sensor, rule, |_| 1.0)
    }

    /// As [`Evidence::of`], with the evidence of each reading multiplied by its weight.
    #[must_use]
    pub fn weighed(
        model: &AppearanceModel,
        readings: &[Vec<Reading>],
        sensor: &SensorDescription,
        rule: AppearanceRule,
        weight: impl Fn(&Reading) -> f64 + Sync,
    ) -> Self {
        let clustering = &model.vocabulary.clustering;
        let shares = ObjectShares::new(&model.objects, clustering, model.smoothing);
        let of_reading = |reading: &Reading| {
            let touching = touches(reading, sensor).then(|| reading.image());
            let features = model.vocabulary.describe(touching?)?;
            let logs = shares.log_likelihoods(&model.vocabulary.classify(&features), rule);
            let weight = weight(reading);
            Some(logs.into_iter().map(|log| weight * log).collect())
        };
        let by_object = readings
            .par_iter()
            .map(|readings| readings.iter().filter_map(of_reading).collect())
            .collect();
        Self { by_object, exponent: model.exponent }
    }

    /// Smallest number of readings of any object.
    #[must_use]
    pub fn n_readings_min(&self) -> usize {
        self.by_object.iter().map(Vec::len).min().unwrap_or(0)
    }

    /// Trials on readings drawn without replacement, `trials` of each object, after each of
    /// the rising `counts`; an object with fewer readings than that takes no part.
    #[must_use]
    pub fn drawn(&self, counts: &[usize], trials: usize, seed: u64) -> Vec<Point> {
        let lengths: Vec<usize> = self.by_object.iter().map(Vec::len).collect();
        drawn(&lengths, counts, trials, seed, |truth, order| self.trial(truth, order, counts))
    }

    /// One trial of each object, on its readings in the order they were taken.
    #[must_use]
    pub fn in_order(&self, counts: &[usize]) -> Vec<Point> {
        let trial = |truth: usize| {
            let order: Vec<usize> = (0..self.by_object[truth].len()).collect();
            self.trial(truth, &order, counts)
        };
        points(counts, (0..self.by_object.len()).map(trial).collect())
    }

    /// The verdict after each count for which there are readings.
    fn trial(&self, truth: usize, order: &[usize], counts: &[usize]) -> Vec<Verdict> {
        let readings = &self.by_object[truth];
        let mut sum = vec![0.0; self.by_object.len()];
        let mut verdicts = Vec::with_capacity(counts.len());
        let mut taken = 0;
        for &count in counts.iter().filter(|count| **count <= order.len()) {
            for &reading in &order[taken..count] {
                sum.iter_mut().zip(&readings[reading]).for_each(|(sum, log)| *sum += log);
            }
            taken = count;
            let logs: Vec<f64> = sum.iter().map(|log| self.exponent * log).collect();
            let best = (1..logs.len()).fold(0, |a, b| if logs[b] > logs[a] { b } else { a });
            let stated = log_prob::normalize(&logs)[best];
            verdicts.push(Verdict { truth, named: best, stated });
        }
        verdicts
    }
}

/// Trials on readings drawn without replacement, `trials` of each object. `lengths` are the
/// objects' numbers of readings; `trial` gives the verdicts of an object's readings in a drawn
/// order, after each of the rising `counts` for which there are readings.
pub(crate) fn drawn(
    lengths: &[usize],
    counts: &[usize],
    trials: usize,
    seed: u64,
    trial: impl Fn(usize, &[usize]) -> Vec<Verdict> + Sync,
) -> Vec<Point> {
    let of_object = |truth: usize| -> Vec<Vec<Verdict>> {
        let mut stream = Stream::new(seed, Purpose::ReadingChoice, truth as u64);
        let n = lengths[truth];
        let mut order: Vec<usize> = (0..n).collect();
        let mut next = || {
            for place in 0..n {
                order.swap(place, place + stream.index(n - place));
            }
            trial(truth, &order)
        };
        (0..trials).map(|_| next()).collect()
    };
    let verdicts: Vec<Vec<Verdict>> =
        (0..lengths.len()).into_par_iter().flat_map(of_object).collect();
    points(counts, verdicts)
}

/// Gathers trials by count.
fn points(counts: &[usize], trials: Vec<Vec<Verdict>>) -> Vec<Point> {
    let mut by_count: Vec<Vec<Verdict>> = counts.iter().map(|_| Vec::new()).collect();
    for trial in trials {
        by_count.iter_mut().zip(trial).for_each(|(all, verdict)| all.push(verdict));
    }
    let gathered = counts.iter().zip(by_count).filter(|(_, verdicts)| !verdicts.is_empty());
    gathered.map(|(readings, verdicts)| point(*readings, &verdicts)).collect()
}

fn point(readings: usize, verdicts: &[Verdict]) -> Point {
    let n = verdicts.len() as f64;
    let wrong = verdicts.iter().filter(|verdict| verdict.named != verdict.truth);
    let mut pairs: Vec<(usize, usize)> = wrong.map(|v| (v.truth, v.named)).collect();
    let right = |v: &Verdict| (v.truth as u64, f64::from(u8::from(v.named == v.truth)));
    pairs.sort_unstable();
    let mut confusions: Vec<(usize, usize, usize)> =
        pairs.chunk_by(|a, b| a == b).map(|same| (same[0].0, same[0].1, same.len())).collect();
    confusions.sort_by(|a, b| b.2.cmp(&a.2).then(a.cmp(b)));
    Point {
        readings,
        accuracy: 1.0 - pairs.len() as f64 / n,
        standard_error: standard_error_over_groups(verdicts.iter().map(right)),
        stated: verdicts.iter().map(|verdict| verdict.stated).sum::<f64>() / n,
        confusions,
    }
}

/// The mean of equally long curves over the same counts; confusions are added up.
#[must_use]
pub fn mean_of(curves: &[Vec<Point>]) -> Vec<Point> {
    let length = curves.iter().map(Vec::len).min().unwrap_or(0);
    let mean = |at: usize| {
        let mean_of = |value: fn(&Point) -> f64| {
            curves.iter().map(|curve| value(&curve[at])).sum::<f64>() / curves.len() as f64
        };
        let mut totals = std::collections::BTreeMap::new();
        for (truth, named, n) in curves.iter().flat_map(|curve| &curve[at].confusions) {
            *totals.entry((*truth, *named)).or_insert(0) += n;
        }
        let mut confusions: Vec<_> = totals.into_iter().map(|((t, n), k)| (t, n, k)).collect();
        confusions.sort_by(|a, b| b.2.cmp(&a.2).then(a.cmp(b)));
        Point {
            readings: curves[0][at].readings,
            accuracy: mean_of(|point| point.accuracy),
            standard_error: mean_of(|point| point.standard_error),
            stated: mean_of(|point| point.stated),
            confusions,
        }
    };
    (0..length).map(mean).collect()
}

/// The accuracy after `readings`, if that was counted.
#[must_use]
pub fn accuracy_at(curve: &[Point], readings: usize) -> Option<f64> {
    curve.iter().find(|point| point.readings == readings).map(|point| point.accuracy)
}

/// A curve as a line of a plot, in per cent.
#[must_use]
pub fn line(name: &str, curve: &[Point]) -> plot::Line {
    let points = curve.iter().map(|point| (point.readings as f64, 100.0 * point.accuracy));
    plot::Line { name: name.to_owned(), points: points.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two objects. Evidence for the first is 1 nat per reading, but −2 nats in every third
    /// reading; for the second it is 1 nat in every reading.
    fn evidence() -> Evidence {
        let first = |n: usize| if n % 3 == 2 { vec![0.0, 2.0] } else { vec![1.0, 0.0] };
        let by_object = vec![(0..6).map(first).collect(), vec![vec![0.0, 1.0]; 6]];
        Evidence { by_object, exponent: 1.0 }
    }

    #[test]
    fn readings_in_order_are_counted_one_after_the_other() {
        // After 2: 2 against 0, right. After 3: a tie of 2, which the first object keeps.
        // After 6: a tie again. The second object is always right.
        let curve = evidence().in_order(&[2, 3, 6, 7]);
        let accuracies: Vec<f64> = curve.iter().map(|point| point.accuracy).collect();
        assert_eq!(accuracies, [1.0, 1.0, 1.0]); // nobody has 7 readings
        assert!(curve[0].standard_error.abs() < 1e-12); // both objects are always right
        // Probability of the best after 2: e²/(1 + e²) for both.
        let stated = 2.0_f64.exp() / (1.0 + 2.0_f64.exp());
        assert!((curve[0].stated - stated).abs() < 1e-12);
        let stated = 0.5 * (0.5 + 3.0_f64.exp() / (1.0 + 3.0_f64.exp()));
        assert!((curve[1].stated - stated).abs() < 1e-12);
    }

    #[test]
    fn single_drawn_readings_are_wrong_as_often_as_they_mislead() {
        // A third of the first object's readings mislead: (2/3 + 1) / 2 are right.
        let curve = evidence().drawn(&[1], 4_000, 1);
        assert!((curve[0].accuracy - 5.0 / 6.0).abs() < 0.02, "{curve:?}");
        // Shares right of 2/3 and 1: the error over the two objects is half their difference,
        // however many trials there are.
        assert!((curve[0].standard_error - 1.0 / 6.0).abs() < 0.02, "{curve:?}");
        assert_eq!(curve[0].confusions.len(), 1);
        assert_eq!((curve[0].confusions[0].0, curve[0].confusions[0].1), (0, 1));
        assert_eq!(evidence().n_readings_min(), 6);
    }

    #[test]
    fn curves_of_several_runs_have_a_mean() {
        let curve = |accuracy: f64, wrong: usize| {
            let confusions = vec![(0, 1, wrong)];
            vec![Point { readings: 5, accuracy, standard_error: 0.1, stated: 0.5, confusions }]
        };
        let mean = mean_of(&[curve(0.5, 2), curve(1.0, 1)]);
        assert_eq!(accuracy_at(&mean, 5), Some(0.75));
        assert_eq!(mean[0].confusions, [(0, 1, 3)]);
        assert_eq!(accuracy_at(&mean, 6), None);
    }
}
