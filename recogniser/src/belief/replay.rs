//! Replays of ended sessions whose true object is known, by a model that is to be judged.
//!
//! A session of a known object makes two trials: one with the whole catalogue, and one without the
//! object, which is then an unknown one. A session of an object that the catalogue lacks makes
//! the second kind alone.

use std::sync::Arc;

use palpate_core::reading::{Felt, Looseness};
use palpate_core::sensor::SensorDescription;

use super::evidence_fit::{Sample, sample};
use super::surface_belief::SurfaceBelief;
use crate::model::SurfaceModel;
use crate::options::SurfaceOptions;

/// Maximum number of readings of a session that are replayed: its first ones.
pub const READINGS_MAX: usize = 16;

/// An ended session: an object at rest, or with the drift that the session announced.
#[derive(Clone, Debug)]
pub struct PastSession<'a> {
    /// Its readings with their sensors, in folding order; poses in one frame.
    pub readings: Vec<(&'a Felt, &'a SensorDescription)>,
    /// Index of the touched object; `None` if the catalogue lacks it.
    pub truth: Option<usize>,
    /// Announced drift between any two touches.
    pub motion: Option<Looseness>,
}

/// A trial to run: a session, and whether the catalogue has its object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Task {
    /// Index of the session.
    pub(super) session: usize,
    pub(super) is_known: bool,
}

/// The belief of a trial after one of its touches, by some prior of "none of these".
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    /// Number of touches.
    pub(super) n_touches: usize,
    /// Probability of the truth, an object or "none of these".
    pub(super) truth: f64,
    /// Probability of the likeliest object.
    pub(super) best: f64,
    /// Whether that object is the true one.
    pub(super) is_best_true: bool,
    /// Probability of "none of these".
    pub(super) unknown: f64,
    /// Whether the catalogue has the true object.
    pub(super) is_known: bool,
}

/// A trial that has run.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    pub(super) task: Task,
    /// The evidence after each touch.
    pub(super) samples: Vec<Sample>,
    /// The beliefs after each touch, by the default prior.
    pub(super) steps: Vec<Step>,
}

/// The trials of all sessions, in their order.
pub(super) fn tasks(past: &[PastSession<'_>]) -> Vec<Task> {
    let of = |(session, past): (usize, &PastSession<'_>)| {
        let known = past.truth.map(|_| Task { session, is_known: true });
        known.into_iter().chain([Task { session, is_known: false }])
    };
    past.iter().enumerate().flat_map(of).collect()
}

/// Runs a trial. `with_samples`: whether its evidence is needed.
pub(super) fn replay(
    model: &Arc<SurfaceModel>,
    past: &PastSession<'_>,
    task: Task,
    with_samples: bool,
) -> Trial {
    let options = SurfaceOptions { motion: past.motion, ..SurfaceOptions::default() };
    let (mut samples, mut steps) = (Vec::new(), Vec::new());
    let ruled_out = past.truth.filter(|_| !task.is_known);
    let prior: Vec<f64> =
        (0..model.n_objects()).map(|o| f64::from(u8::from(Some(o) != ruled_out))).collect();
    let Ok(mut belief) = SurfaceBelief::new(Arc::clone(model), options, Some(&prior)) else {
        return Trial { task, samples, steps };
    };
    let truth = past.truth.filter(|_| task.is_known);
    for (felt, sensor) in past.readings.iter().take(READINGS_MAX) {
        match felt {
            Felt::Press(reading) => belief.add(reading, sensor),
            Felt::Contact(contact) => belief.add_contact(contact),
        }
        if belief.n_touches() == 0 {
            continue;
        }
        if with_samples {
            let negligible = options.score.negligible;
            samples.extend(sample(&belief, past.truth, task.is_known, negligible));
        }
        steps.push(step(&belief, truth));
    }
    Trial { task, samples, steps }
}

fn step(belief: &SurfaceBelief, truth: Option<usize>) -> Step {
    let mut all = belief.posterior();
    let unknown = all.pop().unwrap_or(0.0);
    let best = (0..all.len()).max_by(|a, b| all[*a].total_cmp(&all[*b]));
    Step {
        n_touches: belief.n_touches(),
        truth: truth.map_or(unknown, |object| all[object]),
        best: best.map_or(0.0, |object| all[object]),
        is_best_true: best.is_some() && best == truth,
        unknown,
        is_known: truth.is_some(),
    }
}

impl Step {
    /// The same belief if "none of these" had been as probable as all objects together, instead of
    /// its default prior: odds multiply.
    pub(super) fn at_even_prior(&self) -> Self {
        let prior = SurfaceOptions::default().unknown;
        let more = (1.0 - prior) / prior;
        let total = 1.0 - self.unknown + more * self.unknown;
        let truth = if self.is_known { self.truth } else { more * self.truth };
        Self {
            truth: truth / total,
            best: self.best / total,
            unknown: more * self.unknown / total,
            ..*self
        }
    }

    /// Whether the likeliest answer, an object or "none of these", is the true one.
    pub(super) fn is_right(&self) -> bool {
        let names_object = self.best > self.unknown;
        names_object == self.is_known && (self.is_best_true || !self.is_known)
    }

    /// The probability of the likeliest answer.
    pub(super) fn likeliest(&self) -> f64 {
        self.best.max(self.unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A belief with these probabilities of the likeliest object and of "none of these".
    fn belief(best: f64, unknown: f64, is_known: bool) -> Step {
        let truth = if is_known { best } else { unknown };
        Step { n_touches: 3, truth, best, is_best_true: is_known, unknown, is_known }
    }

    #[test]
    fn an_even_prior_multiplies_the_odds_by_nineteen() {
        // Odds of none of these of 0.01 : 0.99 at a prior of 0.05 are 0.19 : 0.99 at one of 0.5.
        let even = belief(0.9, 0.01, true).at_even_prior();
        let total = 0.99 + 0.19;
        assert!((even.unknown - 0.19 / total).abs() < 1e-12);
        assert!((even.best - 0.9 / total).abs() < 1e-12 && (even.truth - even.best).abs() < 1e-12);
        let foreign = belief(0.9, 0.01, false).at_even_prior();
        assert!((foreign.truth - 0.19 / total).abs() < 1e-12);
    }

    #[test]
    fn the_likeliest_answer_is_right_or_wrong() {
        assert!(belief(0.6, 0.3, true).is_right());
        assert!(!belief(0.3, 0.6, true).is_right(), "none of these");
        assert!(belief(0.3, 0.6, false).is_right());
        assert!(!belief(0.6, 0.3, false).is_right());
        let another = Step { is_best_true: false, truth: 0.1, ..belief(0.6, 0.3, true) };
        assert!(!another.is_right());
        assert!((another.likeliest() - 0.6).abs() < 1e-12);
    }
}
