//! Whether motions are symmetries of a map: they explain the patches as they explain each other.
//!
//! Each patch is left out and explained by the rest; under a true symmetry a moved patch is
//! one more touch of the same surface, so its misfit has the same distribution. Misfits count
//! relative to what is usual around a patch: more on thin rods than on plates. All motions of a
//! hypothesis, and their inverses, are judged together: a patch that lies on a feature is
//! misfitted by every one of them, one that is merely noisy by few. Two things are asked of the
//! mean over the motions: its mean over all patches, and its mean over each place, which is what
//! a handle or a notch spoils. A single motion is left early when too many patches are
//! unexplained.

use super::cloud::{Cloud, quantile};
use crate::pose::Pose;

/// The share of patches that counts as explained when each is left out.
const EXPLAINED: f64 = 0.97;

/// How many standard errors the mean may be above that of patches left out: those of true
/// symmetries are at most 5 above it. Fitted: `palpate experiment symmetry`, seeds 101 to 103.
const MEAN_ERRORS: f64 = 6.0;

/// How many standard errors more than 3 % of the patches may be unexplained.
const SHARE_ERRORS: f64 = 4.0;

/// A turn that is not quite fitted yet may leave so many times as many unexplained.
const HOPELESS: f64 = 3.0;

/// A hypothesis whose excess is below this is not refuted clearly. Chosen.
pub(super) const UNCLEAR: f64 = 1.5;

/// How many patches of one side make a place, the middle one included: fewer than a feature as
/// large as a contact has where 300 touches cover an object of 80 mm.
const PLACE: usize = 8;

/// How much more than when left out a place may be misfitted in the mean over all motions: those
/// of true symmetries reach 2.0, features as large as a contact exceed it from about five touches
/// on. Fitted as [`MEAN_ERRORS`].
const PLACE_EXCESS_MAX: f64 = 2.2;

/// Patches around each patch that tell how well it can be explained at all.
const AROUND: usize = 16;

/// Patches belong to one side of a wall when their normals have this cosine.
const SAME_SIDE: f64 = 0.5;

/// No place is usually misfitted by less than this, in units of scatter.
const USUAL_MIN: f64 = 0.5;

/// A relative misfit counts as at most this much.
const RELATIVE_MAX: f64 = 4.0;

/// Turns that an object only nearly has misfit its patches by this much more than those that it
/// has, in relative misfits, whose mean is about 1. Fitted as [`MEAN_ERRORS`]: any turn of a round
/// object misfits by up to 0.06 more than the best finite order, of one of sixteen sides by 0.09.
const WORSE_SHARE: f64 = 0.07;

/// Differences of so many standard errors are beyond chance.
const CHANCE: f64 = 4.0;

/// What the patches of a map leave of each other.
pub(super) struct Baseline {
    /// The patches around each patch, and itself.
    places: Vec<Vec<usize>>,
    /// The mean misfit of each place, in units of scatter.
    usual: Vec<f64>,
    /// The mean relative misfit of each place.
    of_places: Vec<f64>,
    /// Of the relative misfits: mean, variance, and up to where a patch is explained.
    mean: f64,
    variance: f64,
    explained: f64,
}

/// How some motions fit, taken together.
pub(super) struct Judged {
    /// How badly: 1 at the bound, up to which they are symmetries.
    pub(super) excess: f64,
    /// The relative misfit of each patch, in the mean over the motions.
    misfits: Vec<f64>,
}

impl Judged {
    /// How much worse these motions fit than others do, patch by patch: 1 when the difference of
    /// the means is as large as [`WORSE_SHARE`] of what patches left out leave, and beyond chance.
    pub(super) fn worse_than(&self, other: &Self) -> f64 {
        let differences: Vec<f64> =
            self.misfits.iter().zip(&other.misfits).map(|(a, b)| a - b).collect();
        let (mean, variance) = moments(&differences);
        let error = (variance / differences.len() as f64).sqrt();
        mean / WORSE_SHARE.max(CHANCE * error)
    }
}

impl Baseline {
    /// The baseline of a map.
    pub(super) fn new(cloud: &Cloud) -> Self {
        let misfits: Vec<f64> =
            (0..cloud.len()).map(|patch| cloud.explain_left_out(patch).misfit).collect();
        let usual: Vec<f64> = (0..cloud.len())
            .map(|at| mean_at(&misfits, &around(cloud, at, AROUND, -1.0)).max(USUAL_MIN))
            .collect();
        let relative: Vec<f64> =
            misfits.iter().zip(&usual).map(|(misfit, usual)| relative(*misfit, *usual)).collect();
        let places: Vec<Vec<usize>> =
            (0..cloud.len()).map(|at| around(cloud, at, PLACE, SAME_SIDE)).collect();
        let of_places = places.iter().map(|place| mean_at(&relative, place)).collect();
        let (mean, variance) = moments(&relative);
        let explained = quantile(&relative, EXPLAINED);
        Self { places, usual, of_places, mean, variance, explained }
    }

    /// What some motions (object to object) and their inverses, taken together, leave of the
    /// patches; `None` when one of them leaves too many unexplained.
    pub(super) fn judge(&self, cloud: &Cloud, motions: &[Pose]) -> Option<Judged> {
        let mut misfits = vec![0.0; cloud.len()];
        let share = 0.5 / motions.len() as f64;
        for motion in motions {
            for motion in [*motion, motion.inverse()] {
                let of_motion = self.explained_by(cloud, &motion, 1, UNCLEAR)?;
                misfits.iter_mut().zip(of_motion).for_each(|(sum, misfit)| *sum += share * misfit);
            }
        }
        Some(Judged { excess: self.excess(&misfits), misfits })
    }

    /// Whether so many of the patches are unexplained under `motion`, by one in `stride` of
    /// them, that no small change makes it a symmetry.
    pub(super) fn is_hopeless(&self, cloud: &Cloud, motion: &Pose, stride: usize) -> bool {
        self.explained_by(cloud, motion, stride, HOPELESS).is_none()
    }

    /// The relative misfits under `motion` of one patch in `stride`; `None` as soon as `factor`
    /// times too many are unexplained: most motions are told from symmetries by few patches.
    fn explained_by(
        &self,
        cloud: &Cloud,
        motion: &Pose,
        stride: usize,
        factor: f64,
    ) -> Option<Vec<f64>> {
        let n = cloud.len().div_ceil(stride);
        let mut left = (factor * share_max(n as f64) * n as f64) as usize;
        let mut misfits = Vec::with_capacity(n);
        for patch in (0..cloud.len()).step_by(stride) {
            let misfit = relative(cloud.explain(motion, patch).misfit, self.usual[patch]);
            if misfit > self.explained {
                left = left.checked_sub(1)?;
            }
            misfits.push(misfit);
        }
        Some(misfits)
    }

    /// How relative misfits compare, 1 at the bound.
    fn excess(&self, misfits: &[f64]) -> f64 {
        let n = misfits.len() as f64;
        let mean = misfits.iter().sum::<f64>() / n;
        let worst = self
            .places
            .iter()
            .zip(&self.of_places)
            .map(|(place, left_out)| mean_at(misfits, place) - left_out)
            .fold(f64::NEG_INFINITY, f64::max);
        let error = (self.variance / n).sqrt().max(f64::MIN_POSITIVE);
        f64::max((mean - self.mean) / (MEAN_ERRORS * error), worst / PLACE_EXCESS_MAX)
    }
}

/// The `n` patches nearest to patch `at`, itself included, whose normals have at least this
/// `cosine` with its own.
fn around(cloud: &Cloud, at: usize, n: usize, cosine: f64) -> Vec<usize> {
    let mut near: Vec<(f64, usize)> = (0..cloud.len())
        .filter(|other| cloud.normals[at].dot(cloud.normals[*other]) >= cosine)
        .map(|other| (cloud.positions[at].distance_squared(cloud.positions[other]), other))
        .collect();
    if near.len() > n {
        near.select_nth_unstable_by(n - 1, |a, b| a.0.total_cmp(&b.0));
        near.truncate(n);
    }
    near.into_iter().map(|entry| entry.1).collect()
}

/// A misfit relative to what is usual around its patch.
fn relative(misfit: f64, usual: f64) -> f64 {
    (misfit / usual).min(RELATIVE_MAX)
}

/// The largest share of `n` patches that may be unexplained.
fn share_max(n: f64) -> f64 {
    let expected = 1.0 - EXPLAINED;
    // Both shares are of samples: the variance is that of a difference.
    expected + SHARE_ERRORS * (2.0 * expected * EXPLAINED / n).sqrt()
}

fn mean_at(values: &[f64], places: &[usize]) -> f64 {
    places.iter().map(|at| values[*at]).sum::<f64>() / places.len() as f64
}

/// Mean and variance.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n)
}
