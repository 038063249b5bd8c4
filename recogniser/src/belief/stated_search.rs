//! Poses from a stated prior: what it says of the objects after one and two touches, and the poses
//! that it proposes. Equations R35 and R36 of docs/recogniser.md.
//!
//! A hypothesis is turned in a few fixed ways within its covariance. In each of them every patch
//! that faces the way of the newest touch is laid onto it: the place of the object follows, and
//! the hypothesis says how likely it is there. So the integral over places is exact, and only
//! that over rotations is a sum.

use glam::Quat;
use palpate_core::log_prob::log_sum_exp;

use super::object::{ObjectBelief, for_each_object};
use super::search::judged;
use crate::model::SurfaceMap;
use crate::observe::inverse_pose::{InversePose, TouchInObject};
use crate::observe::observation::Observation;
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

/// κ₂ of equation R36: ln of the evidence of a pair (R17, k = 2) below that of its poses.
const PAIR_BELOW_POSES: f64 = 28.0;

/// Density below which a patch laid onto a touch counts nothing.
const NEGLIGIBLE: f32 = 1e-6;

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

    /// Mean density of a touch over an object's poses by a hypothesis; `found` gets every patch
    /// laid onto the touch with its share.
    fn lay(
        &self,
        hypothesis: usize,
        map: &SurfaceMap,
        evidence: &Evidence<'_>,
        ratios: &[f32],
        found: &mut dyn FnMut(f32, Quat, glam::Vec3),
    ) -> f32 {
        let Some(touch) = evidence.touches.last() else { return 0.0 };
        let drawn = &self.drawn[hypothesis];
        let width = evidence.kernel.width(map, touch);
        let part = ((drawn.poses.len() * ratios.len()) as f32).recip();
        let mut sum = 0.0;
        for (rotation, mean) in &drawn.poses {
            let inverse = InversePose::new(*rotation, glam::Vec3::ZERO);
            let at: TouchInObject = inverse.touch(touch);
            for (facet, appearance) in map.facets().iter().zip(ratios) {
                let place = touch.position - *rotation * facet.position;
                let near = appearance * drawn.density(place - *mean);
                if near < NEGLIGIBLE || !self.stated.holds(place) {
                    continue;
                }
                let directions = evidence.kernel.directions(width, facet, facet.normal, &at, touch);
                let share = part * near * directions;
                sum += share;
                found(share, *rotation, place);
            }
        }
        sum
    }

    fn ratios(&self, map: &SurfaceMap, touch: &Observation) -> Vec<f32> {
        let mut ratios = Vec::new();
        let n = self.n_patches.min(map.patches().len());
        touch.appearance_ratios(map.features(), 0..n, &mut ratios);
        ratios
    }
}

/// The evidence of the first touch beside a statement. `log_evidence` holds the evidence by the
/// uniform prior. Equation R35.
pub(super) fn weigh_first(
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    turned: &Turned<'_>,
) {
    let [touch] = evidence.touches else { return };
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        let Some(StatedOf { object: index, .. }) = object.motion_prior.stated else { return };
        let (posed, placed, wrong) = turned.stated.shares(index);
        let ratios = turned.ratios(map, touch);
        let uniform = object.log_evidence.exp();
        let variance = f64::from(map.radius()).powi(2) / 3.0;
        let mut sum = uniform * (wrong + placed * turned.stated.place(touch.position, variance));
        for (hypothesis, share) in posed {
            let mean = turned.lay(hypothesis, map, evidence, &ratios, &mut |_, _, _| ());
            let outliers = evidence.options.scale.outliers;
            sum += share * f64::from((1.0 - outliers) * mean + outliers);
        }
        object.log_evidence = sum.max(f64::MIN_POSITIVE).ln();
    });
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
        let ratios = turned.ratios(map, newest);
        let (posed, _, wrong) = turned.stated.shares(index);
        let mut proposals = Vec::with_capacity(PROPOSALS + 1);
        for (hypothesis, share) in posed {
            turned.lay(hypothesis, map, evidence, &ratios, &mut |weight, rotation, translation| {
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

/// What a statement adds to the evidence of a pair: the mean of its density over the poses that
/// explain the pair. Equation R36.
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
