//! The predictive likelihood of a reading that the belief does not contain.
//!
//! Density of the reading under the hypotheses, weighted by their shares, relative to that of a
//! touch anywhere, given that the object is a known one. Low values reveal wrong readings and
//! wrong beliefs.

use palpate_core::log_prob::{log_sum_exp, normalize};

use super::object::ObjectBelief;
use crate::verify::evidence::Evidence;

/// Objects less probable than this are left out of the prediction.
const PROBABILITY_MIN: f64 = 1e-6;

/// ln of the density of a reading, which is the only `evidence`, under the hypotheses of `objects`.
/// `posterior` has the probability of each object and then of "none of these".
pub(super) fn log_predictive(
    evidence: &Evidence<'_>,
    objects: &[ObjectBelief],
    posterior: &[f64],
) -> Option<f64> {
    let (_, probabilities) = posterior.split_last()?;
    let known: f64 = probabilities.iter().sum();
    let mut logs = Vec::new();
    for ((object, map), probability) in objects.iter().zip(evidence.maps).zip(probabilities) {
        let share = probability / known;
        if share.is_nan() || share < PROBABILITY_MIN {
            continue;
        }
        let scores: Vec<f64> = object.hypotheses.iter().map(|h| f64::from(h.score)).collect();
        for (hypothesis, weight) in object.hypotheses.iter().zip(normalize(&scores)) {
            let score = evidence.newest(map, &hypothesis.inverse_pose());
            logs.push((share * weight).ln() + f64::from(score));
        }
    }
    (!logs.is_empty()).then(|| log_sum_exp(logs.into_iter()))
}
