//! Evidence of one pair of readings for one object: the poses of all matching stored pairs.
//!
//! Source: sections 5.3.5 and 5.4, equations 5.14 and 5.21–5.35.

use super::options::SvaOptions;
use super::priors::MatchWeights;
use crate::filter::sparse::PairEvidence;
use crate::patch::Patch;
use crate::patch_pair::alignment::{PairAxis, PairEnd, PairFrame};
use crate::sva::model::ObjectMap;
use palpate_core::object::MapPatch;
use palpate_core::vocabulary::Association;

/// An observed pair, prepared for look-up.
pub(super) struct PairQuery<'a> {
    axis: PairAxis,
    frame: PairFrame,
    distance: f64,
    classes: [&'a [Association]; 2],
}

impl<'a> PairQuery<'a> {
    /// The query of two patches; `None` when their positions are equal.
    pub(super) fn new(a: &'a Patch, b: &'a Patch) -> Option<Self> {
        let axis = PairAxis::new(&end(a), &end(b))?;
        Some(Self {
            frame: PairFrame::new(&axis, &end(a), &end(b)),
            axis,
            distance: a.position.distance(b.position),
            classes: [&a.classes, &b.classes],
        })
    }
}

/// Equations 5.14 and 5.21–5.25 for one pair and one object: the poses of all matches.
pub(super) fn find_poses(
    object: &ObjectMap,
    query: &PairQuery<'_>,
    options: &SvaOptions,
    weights: &MatchWeights,
) -> PairEvidence {
    let mut evidence = PairEvidence::default();
    let index = object.index();
    for (bin, distance_share) in index.distances().covering(query.distance).into_iter().flatten() {
        for a in query.classes[0] {
            for b in query.classes[1] {
                let prior = weights.of(a.class, b.class, bin);
                let observed = prior * distance_share * a.weight * b.weight;
                index.matches(a.class, b.class, bin, |first, second, stored| {
                    let pair = [first, second].map(|patch| object.patches()[usize::from(patch)]);
                    add_match(&mut evidence, query, &pair, observed * stored, options);
                });
            }
        }
    }
    evidence
}

/// Adds the poses of one match (section 5.4): sampled rotations about the pair's axis.
fn add_match(
    evidence: &mut PairEvidence,
    query: &PairQuery<'_>,
    pair: &[MapPatch; 2],
    weight: f64,
    options: &SvaOptions,
) {
    let [a, b] = pair.map(|patch| stored_end(&patch));
    let Some(axis) = PairAxis::new(&a, &b) else {
        return;
    };
    if options.normal_tolerance.is_some_and(|limit| !query.axis.normals_agree(&axis, limit)) {
        return;
    }
    let stored = PairFrame::new(&axis, &a, &b);
    let angle = query.frame.axis_angle(&stored, options.sigma_init);
    let turns = query.frame.turns(&stored);
    angle.for_each_sample(options.turn_step, options.turn_reach, |turn, share| {
        evidence.add(&options.bins, &turns.pose(turn), weight * share);
    });
}

fn end(patch: &Patch) -> PairEnd {
    PairEnd {
        position: patch.position,
        normal: patch.normal,
        normal_confidence: patch.normal_confidence,
    }
}

fn stored_end(patch: &MapPatch) -> PairEnd {
    let double = |v: [f32; 3]| glam::DVec3::from_array(v.map(f64::from));
    PairEnd {
        position: double(patch.position),
        normal: double(patch.normal),
        normal_confidence: f64::from(patch.normal_confidence),
    }
}

#[cfg(test)]
mod tests;
