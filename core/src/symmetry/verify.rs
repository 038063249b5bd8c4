//! Test whether motions are symmetries of a map: their misfits are those of patches left out.
//!
//! Each patch is left out and matched with the rest. Under a true symmetry a moved patch is
//! one more touch of the same surface, so its misfit has the same distribution. Misfits are
//! relative to the usual one around a patch: larger on thin rods than on plates. All motions
//! of a hypothesis, and their inverses, are judged together: a patch on a feature misfits
//! under every one of them, a noisy patch under few. Two statistics of the mean over the
//! motions decide: its mean over all patches, and its mean over each place, which a handle or
//! a notch raises. A single motion is abandoned early when too many patches are unexplained.

use super::cloud::{Cloud, quantile};
use crate::pose::Pose;

/// Share of patches that count as explained when each is left out.
const EXPLAINED: f64 = 0.97;

/// Largest excess of the mean over that of patches left out, in standard errors; true
/// symmetries exceed it by at most 5. Fitted: `palpate experiment symmetry`, seeds 101 to
/// 103.
const MEAN_ERRORS: f64 = 6.0;

/// Standard errors by which the share of unexplained patches may exceed 3 %.
const SHARE_ERRORS: f64 = 4.0;

/// Factor of unexplained patches permitted for a turn that is not fitted yet.
const HOPELESS: f64 = 3.0;

/// Excess below which a hypothesis is not refuted clearly. Chosen.
pub(super) const UNCLEAR: f64 = 1.5;

/// Number of patches of one side in a place, the middle one included: fewer than a feature as
/// large as a contact has where 300 touches cover an object of 80 mm.
const PLACE: usize = 8;

/// Largest ratio of a place's misfit, in the mean over all motions, to that of patches left
/// out: true symmetries reach 2.0, features as large as a contact exceed it from about five
/// touches on. Fitted as [`MEAN_ERRORS`].
const PLACE_EXCESS_MAX: f64 = 2.2;

/// Number of patches around each patch from which its usual misfit is estimated.
const AROUND: usize = 16;

/// Smallest cosine of the normals of patches on one side of a wall.
const SAME_SIDE: f64 = 0.5;

/// Smallest usual misfit of a place, in units of scatter.
const USUAL_MIN: f64 = 0.5;

/// Largest relative misfit that counts.
const RELATIVE_MAX: f64 = 4.0;

/// Excess of the relative misfits (mean about 1) of a near symmetry's turns over those of a
/// true one. Fitted as [`MEAN_ERRORS`]: any turn of a round object misfits by up to 0.06 more
/// than the best finite order, of one of sixteen sides by 0.09.
const WORSE_SHARE: f64 = 0.07;

/// Standard errors beyond which a difference is not chance.
const CHANCE: f64 = 4.0;

/// Misfits of a map's patches when each is left out.
pub(super) struct Baseline {
    /// The patches around each patch, and itself.
    places: Vec<Vec<usize>>,
    /// The mean misfit of each place, in units of scatter.
    usual: Vec<f64>,
    /// The mean relative misfit of each place.
    of_places: Vec<f64>,
    /// Mean, variance and limit of explanation of the relative misfits.
    mean: f64,
    variance: f64,
    explained: f64,
}

/// Joint fit of some motions.
pub(super) struct Judged {
    /// Misfit; symmetries are at most 1.
    pub(super) excess: f64,
    /// The relative misfit of each patch, in the mean over the motions.
    misfits: Vec<f64>,
}

impl Judged {
    /// Excess of these motions' misfit over another's, patch by patch: 1 when the difference
    /// of the means is as large as [`WORSE_SHARE`] of that of patches left out, and beyond
    /// chance.
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

    /// The joint misfit of some motions (object to object) and their inverses; `None` when
    /// one of them leaves too many patches unexplained.
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

    /// Whether `motion` leaves too many patches unexplained, on one in `stride` of them, for
    /// any small change to make it a symmetry.
    pub(super) fn is_hopeless(&self, cloud: &Cloud, motion: &Pose, stride: usize) -> bool {
        self.explained_by(cloud, motion, stride, HOPELESS).is_none()
    }

    /// The relative misfits under `motion` of one patch in `stride`; `None` as soon as
    /// `factor` times too many are unexplained: a few patches suffice to reject most motions.
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

    /// The excess of relative misfits, 1 at the bound.
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

/// A misfit relative to the usual one around its patch.
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
