//! How many places the touches show, and the evidence of fewer than three (equation R17a).
//!
//! Each kind of evidence is calibrated for touches of that many places, so the belief is the mean
//! of theirs, weighed by the probability of each number. Not here: the evidence of three and more
//! places, which is the objects' own.

use palpate_core::log_prob::log_sum_exp;

use super::object::ObjectBelief;
use super::stage::Stage;

/// Probability of a number of places, or of a new place, below which it is left out.
pub(super) const NEGLIGIBLE: f64 = 1e-3;

/// Probabilities of one and of two places, with their evidence; three and more have the rest.
/// The default: three and more, or no touch.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Places {
    pub(super) one: f64,
    pub(super) two: f64,
    /// The part of two places whose pair is long enough to be a stored one.
    pub(super) paired: f64,
    /// Stage after the first touch, and ln L_o of each object by it.
    pub(super) first: (Stage, Vec<f64>),
    /// ln L_o of each object by the pairs of the first touch with later ones.
    pub(super) pair: Vec<f64>,
}

impl Places {
    /// After the first touch.
    pub(super) fn first(stage: Stage, objects: &[ObjectBelief]) -> Self {
        let first = (stage, logs_of(objects));
        Self { one: 1.0, first, ..Self::default() }
    }

    /// Adds a touch that is of a new place with probability `new`, and far enough from the first
    /// for their pair to be a stored one with `pairs`. Returns the share of this pair among all
    /// pairs; `None` if it is negligible.
    pub(super) fn add(&mut self, new: f64, pairs: f64) -> Option<f64> {
        let newest = self.one * new.min(pairs);
        self.paired = (1.0 - new) * self.paired + newest;
        self.two = (1.0 - new) * self.two + new * self.one;
        self.one *= 1.0 - new;
        if self.one + self.two < NEGLIGIBLE {
            *self = Self::default();
            return None;
        }
        (newest >= NEGLIGIBLE).then(|| newest / self.paired)
    }

    /// Adds the evidence of the newest pair, which has this `share` among all pairs.
    pub(super) fn weigh_pair(&mut self, share: f64, objects: &[ObjectBelief]) {
        let newest = logs_of(objects);
        if self.pair.is_empty() {
            self.pair = newest;
            return;
        }
        for (mean, log) in self.pair.iter_mut().zip(newest) {
            *mean = log_sum_exp([(1.0 - share).ln() + *mean, share.ln() + log].into_iter());
        }
    }

    /// The kinds of evidence with their shares, which sum to 1. `stage` and `objects` are the newest.
    pub(super) fn kinds(&self, stage: Stage, objects: &[ObjectBelief]) -> Vec<Kind> {
        let few = self.one + self.two;
        let paired = if self.pair.is_empty() { 0.0 } else { self.paired };
        let kind = |share, stage, logs: &[f64]| {
            let both = logs.iter().zip(objects);
            let log = |(log, object): (&f64, &ObjectBelief)| match object.is_ruled_out {
                true => f64::NEG_INFINITY,
                false => *log,
            };
            Kind { share, stage, logs: both.map(log).collect() }
        };
        let newest = |share| Kind { share, stage, logs: logs_of(objects) };
        let first = |share| kind(share, self.first.0, &self.first.1);
        let pair = |share| kind(share, Stage::Pair, &self.pair);
        // Without a pose three places say no more than a pair, and without a pair no more than one.
        let mut kinds = match stage {
            _ if few <= 0.0 => vec![newest(1.0)],
            Stage::Poses => vec![first(few - paired), pair(paired), newest(1.0 - few)],
            Stage::Pair => vec![first(few - paired), pair(1.0 - (few - paired))],
            Stage::Prior | Stage::Appearance => vec![first(1.0)],
        };
        kinds.retain(|kind| kind.share >= NEGLIGIBLE);
        let total: f64 = kinds.iter().map(|kind| kind.share).sum();
        kinds.iter_mut().for_each(|kind| kind.share /= total);
        kinds
    }

    /// Probability that the touches are of places whose pairs tell the pose.
    pub(super) fn several(&self) -> f64 {
        let several = 1.0 - (self.one + self.two - self.paired);
        if several < NEGLIGIBLE { 0.0 } else { several }
    }

    /// Heap bytes of its lists.
    pub(super) fn bytes(&self) -> usize {
        (self.first.1.capacity() + self.pair.capacity()) * size_of::<f64>()
    }
}

/// A kind of evidence, with its share in the belief and ln L_o of each object.
#[derive(Clone, Debug)]
pub(super) struct Kind {
    pub(super) share: f64,
    pub(super) stage: Stage,
    pub(super) logs: Vec<f64>,
}

fn logs_of(objects: &[ObjectBelief]) -> Vec<f64> {
    objects.iter().map(|object| object.log_evidence).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_counted_as_computed_by_hand() {
        #[track_caller]
        fn check(places: &Places, expected: [f64; 3]) {
            let off = [places.one, places.two, places.paired].into_iter().zip(expected);
            assert!(off.map(|(a, b)| (a - b).abs()).sum::<f64>() < 1e-12, "{places:?}");
        }
        let mut places = Places::first(Stage::Appearance, &[]);
        // One place with 0.75; two with 0.25, of which 0.2 are a stored pair.
        assert_eq!(places.add(0.25, 0.2), Some(1.0));
        check(&places, [0.75, 0.25, 0.2]);
        // 0.75/2; (0.25 + 0.75)/2; 0.2/2 + 0.75/2, of which the newest pair has 0.375/0.475.
        let share = places.add(0.5, 1.0).unwrap();
        check(&places, [0.375, 0.5, 0.475]);
        assert!((share - 0.375 / 0.475).abs() < 1e-12 && (places.several() - 0.6).abs() < 1e-12);
        // Two more new places: three at least.
        assert_eq!(places.add(1.0, 1.0), Some(1.0));
        assert_eq!(places.add(1.0, 1.0), None);
        assert_eq!(places, Places::default());
    }
}
