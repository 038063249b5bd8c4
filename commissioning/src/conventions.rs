//! Conventions of poses: which meaning of the sent numbers puts the touches on the object.
//!
//! Each convention is scored by the best place of the object. Equation C3.

use glam::DVec3;
use palpate_core::convention::{PoseConvention, PositionUnit};
use palpate_core::pose::Pose;

use crate::estimate::{Choice, posterior};
use crate::surface::{Placed, SurfaceSearch};
use crate::touch::SentTouch;

/// Prior probability of the stated convention. Chosen: as for the unit of pressure.
const STATED: f64 = 0.9;

/// Log-likelihood of a touch with misfit 1. Chosen: misfits of neighbouring touches are dependent,
/// so a touch counts less than its two residuals would.
const PER_TOUCH: f64 = 3.0;

/// Extent of the touches as a share of the object's diagonal that a convention may have. Chosen:
/// another unit changes the extent at least 25-fold, and touches of one spot determine nothing.
const EXTENT: (f64, f64) = (0.08, 1.3);

/// A convention with its places of the object.
#[derive(Clone, Debug)]
pub(crate) struct Scored {
    pub(crate) convention: PoseConvention,
    pub(crate) probability: f64,
    /// Best first; empty when the touches are larger than the object.
    pub(crate) places: Vec<Placed>,
}

/// Every convention, the likeliest first.
pub(crate) fn score(
    touches: &[SentTouch],
    object_from_session: Option<Pose>,
    search: &SurfaceSearch<'_>,
    seed: u64,
) -> Vec<Scored> {
    let n = touches.len() as f64;
    let mut scored = Vec::new();
    let mut alternatives = Vec::new();
    for convention in PoseConvention::all() {
        let poses: Vec<Pose> =
            touches.iter().map(|touch| convention.read(touch.position, touch.quaternion)).collect();
        let extent = extent(&poses) / search.diagonal();
        let fits = (EXTENT.0..EXTENT.1).contains(&extent);
        let places = match object_from_session {
            _ if !fits => Vec::new(),
            Some(given) => search.refine_given(&poses, given),
            None => search.search(&poses, seed),
        };
        let misfit = places.first().map_or(1.2, |placed| placed.misfit);
        let log = -PER_TOUCH * n * misfit;
        let n_others = (PoseConvention::all().len() - 1) as f64;
        let is_stated = convention == PoseConvention::STATED;
        alternatives.push((log, if is_stated { STATED } else { (1.0 - STATED) / n_others }));
        scored.push(Scored { convention, probability: 0.0, places });
    }
    for (one, probability) in scored.iter_mut().zip(posterior(&alternatives)) {
        one.probability = probability;
    }
    scored.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    scored
}

/// Weighs the conventions whose images were fitted by their losses as well.
pub(crate) fn weigh(scored: &mut [Scored], losses: &[f64]) {
    let fitted = &mut scored[..losses.len()];
    let whole: f64 = fitted.iter().map(|one| one.probability).sum();
    let prior =
        |one: &Scored| if one.convention == PoseConvention::STATED { STATED } else { 1.0 - STATED };
    let alternatives: Vec<(f64, f64)> =
        fitted.iter().zip(losses).map(|(one, loss)| (-loss, prior(one))).collect();
    for (one, share) in fitted.iter_mut().zip(posterior(&alternatives)) {
        one.probability = share * whole;
    }
}

/// Number of the likeliest conventions whose images must be compared: those that the surface
/// does not exclude, which it does not on thin objects.
pub(crate) fn n_open(scored: &[Scored]) -> usize {
    let best = scored[0].probability;
    let is_open = |one: &&Scored| one.probability > OPEN * best && !one.places.is_empty();
    scored.iter().take(FITTED_MAX).take_while(is_open).count().max(1)
}

/// Odds against the likeliest convention below which one is excluded without its images, and most
/// conventions whose images are fitted.
const OPEN: f64 = 1e-4;
const FITTED_MAX: usize = 4;

/// Largest distance of two touches, metres.
fn extent(poses: &[Pose]) -> f64 {
    let mean = poses.iter().map(|pose| pose.translation).sum::<DVec3>() / poses.len() as f64;
    let away = |pose: &Pose| pose.translation.distance(mean);
    2.0 * poses.iter().map(away).fold(0.0, f64::max)
}

/// The choice of one part of a convention, summed over the others.
pub(crate) fn part<T: PartialEq + Copy>(
    scored: &[Scored],
    best: PoseConvention,
    of: impl Fn(&PoseConvention) -> T,
) -> Choice<T> {
    let value = of(&best);
    let is_alike = |one: &&Scored| of(&one.convention) == value;
    let probability = scored.iter().filter(is_alike).map(|one| one.probability).sum();
    Choice { value, probability, stated: of(&PoseConvention::STATED) }
}

/// The choice of the unit of positions.
pub(crate) fn unit(scored: &[Scored], best: PoseConvention) -> Choice<PositionUnit> {
    part(scored, best, |convention| convention.unit)
}
