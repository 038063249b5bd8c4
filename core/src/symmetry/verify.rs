//! Whether a motion is a symmetry of a map: it explains the patches as they explain each other.
//!
//! Each patch is left out and explained by the rest; under a true symmetry a moved patch is
//! one more touch of the same surface, so its misfit has the same distribution. Misfits count
//! relative to what is usual around a patch: more on thin rods than on plates. Three things
//! are asked of the motion and of its inverse: the mean, how many patches are worse off than
//! nearly all were when left out, and whether such patches lie close together, as on a handle.

use super::cloud::{Cloud, nearest, quantile};
use crate::pose::Pose;

/// The share of patches that counts as explained when each is left out.
const EXPLAINED: f64 = 0.97;

/// How many standard errors the mean may be above that of patches left out. Symmetries are
/// 2 to 4 below it, since the fit is to the same patches; a shallow flute is 2 above.
const MEAN_ERRORS: f64 = 1.5;

/// How many standard errors more than 3 % of the patches may be unexplained.
const SHARE_ERRORS: f64 = 4.0;

/// A turn that is not quite fitted yet may leave so many times as many unexplained.
const HOPELESS: f64 = 3.0;

/// How many patches make a place, the middle one included.
const PLACE: usize = 16;

/// How much more than when left out a place may be misfitted: symmetries reach 1.7, a handle
/// laid onto nothing 2.9.
const PLACE_EXCESS_MAX: f64 = 2.0;

/// No place is usually misfitted by less than this, in units of scatter.
const USUAL_MIN: f64 = 0.5;

/// A relative misfit counts as at most this much.
const RELATIVE_MAX: f64 = 4.0;

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

/// How a motion that explains enough patches compares with the baseline; each is 1 at its
/// bound.
#[derive(Clone, Copy)]
struct Excess {
    mean: f64,
    place: f64,
}

impl Baseline {
    /// The baseline of a map.
    pub(super) fn new(cloud: &Cloud) -> Self {
        let misfits: Vec<f64> =
            (0..cloud.len()).map(|patch| cloud.explain_left_out(patch).misfit).collect();
        let place = |at| {
            let mut place = nearest(&cloud.positions, at, PLACE - 1);
            place.push(at);
            place
        };
        let places: Vec<Vec<usize>> = (0..cloud.len()).map(place).collect();
        let usual: Vec<f64> =
            places.iter().map(|place| mean_at(&misfits, place).max(USUAL_MIN)).collect();
        let relative: Vec<f64> =
            misfits.iter().zip(&usual).map(|(misfit, usual)| relative(*misfit, *usual)).collect();
        let of_places = places.iter().map(|place| mean_at(&relative, place)).collect();
        let (mean, variance) = moments(&relative);
        let explained = quantile(&relative, EXPLAINED);
        Self { places, usual, of_places, mean, variance, explained }
    }

    /// How badly `motion` (object to object) and its inverse fit: 1 at the bound, up to which it
    /// is a symmetry; `None` when too many patches are unexplained.
    pub(super) fn excess_of(&self, cloud: &Cloud, motion: &Pose) -> Option<f64> {
        let compare = |motion: &Pose| {
            let excess = self.excess(&self.explained_by(cloud, motion, 1, 1.0)?);
            Some(excess.mean.max(excess.place))
        };
        Some(compare(motion)?.max(compare(&motion.inverse())?))
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

    /// How relative misfits compare.
    fn excess(&self, misfits: &[f64]) -> Excess {
        let n = misfits.len() as f64;
        let (mean, variance) = moments(misfits);
        let error = ((variance + self.variance) / n).sqrt();
        let worst = self
            .places
            .iter()
            .zip(&self.of_places)
            .map(|(place, left_out)| mean_at(misfits, place) - left_out)
            .fold(f64::NEG_INFINITY, f64::max);
        Excess { mean: mean / (self.mean + MEAN_ERRORS * error), place: worst / PLACE_EXCESS_MAX }
    }
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
