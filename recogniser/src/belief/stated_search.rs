//! Poses from a stated prior: what it says of the objects after one and two touches, and the poses
//! that it proposes. Equations R35 and R36 of docs/camera-model.md.
//!
//! A hypothesis is turned in a few fixed ways within its covariance. In each of them every patch
//! that faces the way of the newest touch is laid onto it: the place of the object follows, and
//! the hypothesis says how likely it is there. So the integral over places is exact, and only
//! that over rotations is a sum. Both touches of a pair count by `stated_pair`.

use glam::{Quat, Vec3};
use palpate_core::log_prob::log_sum_exp;

use super::object::{ObjectBelief, for_each_object};
use super::search::judged;
use super::stated_pair::Pair;
use crate::model::SurfaceMap;
use crate::observe::inverse_pose::{InversePose, TouchInObject};
use crate::observe::observation::{Observation, Says};
use crate::propose::proposals::Proposal;
use crate::refine::merge::merge;
use crate::refine::settle::settle;
use crate::verify::evidence::Evidence;
use crate::verify::motion_prior::StatedOf;
use crate::verify::stated_prior::{Drawn, StatedPrior};

/// Rotations of all hypotheses together, and the least number of one.
const ROTATIONS: usize = 24;
const ROTATIONS_MIN: usize = 4;

/// Rotations of all hypotheses together in a large catalogue.
const ROTATIONS_IF_MANY: usize = 16;

/// Poses of an object that are proposed after a touch, and those of them that are refined.
const PROPOSALS: usize = 16;
const REFINED: usize = 3;

/// κ₂ of equation R36d: ln of the evidence of a pair (R17, k = 2) below that of its poses.
const PAIR_BELOW_POSES: f64 = 28.0;

/// The rotations of every hypothesis for the newest touch.
pub(super) struct Turned<'a> {
    stated: &'a StatedPrior,
    drawn: Vec<Drawn>,
    /// Patches that are laid onto a touch: the first ones, which cover the surface evenly.
    n_patches: usize,
}

impl<'a> Turned<'a> {
    /// New rotations for every touch. `n_patches` bounds the patches in a large catalogue.
    pub(super) fn new(stated: &'a StatedPrior, n_touches: usize, n_patches: Option<usize>) -> Self {
        let all = if n_patches.is_none() { ROTATIONS } else { ROTATIONS_IF_MANY };
        let n = all.checked_div(stated.n_poses()).unwrap_or(0).max(ROTATIONS_MIN);
        // The first rotation is the mean itself.
        let first = (n_touches - 1) * n;
        let draws = |hypothesis: usize| stated.draws(hypothesis, first, n);
        Self {
            stated,
            drawn: (0..stated.n_poses()).map(draws).collect(),
            n_patches: n_patches.unwrap_or(usize::MAX),
        }
    }
}

/// The evidence of one touch or of a pair beside a statement. `log_evidence` holds the evidence by
/// the uniform prior. `usual` is its unit: the density of a pair on a usual object over that of
/// two touches anywhere; 1 for one touch. Equations R35 and R36.
pub(super) fn weigh_stated(
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    turned: &Turned<'_>,
    usual: f64,
) {
    let touches = evidence.touches;
    let n = touches.len().max(1);
    let place = touches.iter().map(|touch| touch.position).sum::<Vec3>() / n as f32;
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        let Some(StatedOf { object: index, .. }) = object.motion_prior.stated else { return };
        let (posed, placed, wrong) = turned.stated.shares(index);
        let variance = f64::from(map.radius()).powi(2) / (3.0 * n as f64);
        let uniform = wrong + placed * turned.stated.place(place, variance);
        let mut sum = object.log_evidence.exp() * uniform;
        let felt = Felt::new(turned, map, touches);
        for (hypothesis, share) in posed {
            let stated = Stated { turned, hypothesis, map, evidence };
            let density = match &felt[..] {
                [touch] => stated.density(touch),
                [judge, laid] => stated.density_of_pair(laid, judge),
                _ => return,
            };
            sum += share * density / usual;
        }
        object.log_evidence = sum.max(f64::MIN_POSITIVE).ln();
    });
}

/// A touch with its appearance ratios at the patches that are laid onto it.
struct Felt<'a> {
    touch: &'a Observation,
    ratios: Vec<f32>,
}

impl<'a> Felt<'a> {
    /// The touches, the one that counts most last; of equal ones the newest. All patches are laid
    /// onto the last of a pair, since the other touch tells places that are near each other.
    fn new(turned: &Turned<'_>, map: &SurfaceMap, touches: &'a [Observation]) -> Vec<Self> {
        let mut all: Vec<&Observation> = touches.iter().collect();
        all.sort_by(|a, b| a.weight.total_cmp(&b.weight));
        let last = all.len().saturating_sub(1);
        let n =
            |index: usize| if index > 0 && index == last { usize::MAX } else { turned.n_patches };
        let felt = |(index, touch): (usize, &'a Observation)| Self {
            touch,
            ratios: ratios(map, touch, n(index)),
        };
        all.into_iter().enumerate().map(felt).collect()
    }
}

/// A hypothesis of a statement, about an object.
#[derive(Clone, Copy)]
struct Stated<'a> {
    turned: &'a Turned<'a>,
    hypothesis: usize,
    map: &'a SurfaceMap,
    evidence: &'a Evidence<'a>,
}

impl Stated<'_> {
    /// Mean density of a touch over the stated poses.
    fn density(&self, felt: &Felt<'_>) -> f64 {
        let outliers = self.evidence.options.scale.outliers;
        let mean = self.lay(felt, &mut |_, _, _| ());
        f64::from((1.0 - outliers) * mean + outliers)
    }

    /// Mean density of two touches over the stated poses. Where the first one is an outlier only
    /// the other one counts.
    fn density_of_pair(&self, laid: &Felt<'_>, judge: &Felt<'_>) -> f64 {
        let (kernel, map) = (self.evidence.kernel, self.map);
        let Felt { touch, ratios } = laid;
        let pair = Pair { kernel, map, laid: touch, ratios, judge: judge.touch };
        let both = f64::from(pair.density(self.turned.stated, self.hypothesis));
        let outliers = f64::from(self.evidence.options.scale.outliers);
        (1.0 - outliers) * both + outliers * self.density(judge)
    }

    /// Lays patches onto a touch in each rotation; `found` gets every pose with its share of the
    /// mean density, which is returned.
    fn lay(&self, felt: &Felt<'_>, found: &mut dyn FnMut(f32, Quat, Vec3)) -> f32 {
        let Felt { touch, ratios } = felt;
        let (kernel, drawn) = (self.evidence.kernel, &self.turned.drawn[self.hypothesis]);
        let width = kernel.width(self.map, touch);
        let part = ((drawn.poses.len() * ratios.len()) as f32).recip();
        let mut sum = 0.0;
        for (rotation, mean) in &drawn.poses {
            let inverse = InversePose::new(*rotation, *mean);
            let at: TouchInObject = inverse.touch(touch);
            let near = drawn.near(&inverse.object_from_session);
            for (facet, appearance) in self.map.facets().iter().zip(ratios) {
                let Some(density) = near.density(at.point - facet.position) else { continue };
                if touch.says != Says::Position && facet.normal.dot(at.normal) <= 0.0 {
                    continue;
                }
                let place = touch.position - *rotation * facet.position;
                if !self.turned.stated.holds(place) {
                    continue;
                }
                let directions = kernel.directions(width, facet, facet.normal, &at, touch);
                let share = part * appearance * density * directions;
                sum += share;
                found(share, *rotation, place);
            }
        }
        sum
    }
}

/// Appearance ratios of a touch at the first patches of a map, at most `n`.
fn ratios(map: &SurfaceMap, touch: &Observation, n: usize) -> Vec<f32> {
    let mut ratios = Vec::new();
    touch.appearance_ratios(map.features(), 0..n.min(map.patches().len()), &mut ratios);
    ratios
}

/// The hypotheses propose poses of the objects of at least this evidence (ln); all touches judge
/// them. A pose that all touches contradict is left out.
pub(super) fn propose_stated(
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    turned: &Turned<'_>,
    evidence_min: f64,
) {
    let (touches, options) = (evidence.touches, evidence.options);
    let Some(newest) = touches.last() else { return };
    let judges: Vec<&Observation> = touches.iter().rev().collect();
    let floor: f32 = touches.iter().map(|touch| evidence.kernel.floor_of(touch)).sum();
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        let Some(StatedOf { object: index, .. }) = object.motion_prior.stated else { return };
        if object.log_evidence < evidence_min {
            return;
        }
        let felt = Felt { touch: newest, ratios: ratios(map, newest, turned.n_patches) };
        let (posed, _, wrong) = turned.stated.shares(index);
        let mut proposals = Vec::with_capacity(PROPOSALS + 1);
        for (hypothesis, share) in posed {
            let stated = Stated { turned, hypothesis, map, evidence };
            stated.lay(&felt, &mut |weight, rotation, translation| {
                let weight = share as f32 * weight;
                offer(&mut proposals, Proposal { rotation, translation, weight });
            });
        }
        let known = object.known(map);
        let bar = floor + wrong.max(f64::MIN_POSITIVE).ln() as f32;
        let mut new = judged(evidence, known, &proposals, &judges, bar);
        if touches.len() > 1 {
            merge(&mut new, options);
            new.truncate(REFINED);
            new.iter_mut().for_each(|hypothesis| settle(evidence, hypothesis, known));
        }
        object.hypotheses.extend(new);
        merge(&mut object.hypotheses, options);
    });
}

/// What a statement adds to the evidence of a pair by stored pairs: the mean of its density over
/// the poses that explain the pair. Equation R36d.
pub(super) fn pair_correction(object: &ObjectBelief, stated: &StatedPrior) -> f64 {
    let Some(StatedOf { object: index, .. }) = object.motion_prior.stated else { return 0.0 };
    let score = |h: &crate::verify::hypothesis::Hypothesis| f64::from(h.score);
    let without = object.hypotheses.iter().map(|hypothesis| {
        let stated = object.motion_prior.log_stated(&hypothesis.inverse_pose());
        score(hypothesis) - f64::from(stated)
    });
    let known = log_sum_exp(without);
    // Poses that the search has not found count as the pair's evidence says.
    let all = known.max(object.log_evidence + PAIR_BELOW_POSES);
    let (_, _, wrong) = stated.shares(index);
    let missed = wrong.max(f64::MIN_POSITIVE).ln() + (1.0 - (known - all).exp()).max(0.0).ln();
    log_sum_exp(object.hypotheses.iter().map(|h| score(h) - all).chain([missed]))
}

/// Keeps a proposal if it is among the best, which are in order; of equal ones the first.
///
/// Thousands of poses are laid for sixteen that stay, so sorting all would take as long as they do.
fn offer(best: &mut Vec<Proposal>, proposal: Proposal) {
    let is_behind = |kept: &Proposal| kept.weight.total_cmp(&proposal.weight).is_ge();
    if best.len() >= PROPOSALS && best.last().is_some_and(is_behind) {
        return;
    }
    let place = best.partition_point(is_behind);
    best.insert(place, proposal);
    best.truncate(PROPOSALS);
}

#[cfg(test)]
mod tests;
