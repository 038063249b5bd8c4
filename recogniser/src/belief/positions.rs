//! Poses from positions alone: three touches whose normals are unknown are laid onto three patches.
//!
//! A pair of touches proposes poses by its normals (`propose::proposals`). Contacts without a
//! normal do not: three of them fix a pose up to the spacing of the patches. All triples of
//! patches with the triangle's sides are laid onto it, the other touches judge by a wide kernel,
//! and the best few are refined. Equation R10a of docs/recogniser.md.

use std::ops::ControlFlow;

use glam::{Mat3, Quat, Vec3};

use super::object::{ObjectBelief, for_each_object};
use super::search::Scope;
use crate::model::SurfaceMap;
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::{Observation, Says};
use crate::options::SurfaceOptions;
use crate::refine::gauss_newton::refine;
use crate::refine::merge::merge;
use crate::refine::settle::settle;
use crate::verify::density::Kernel;
use crate::verify::evidence::Evidence;
use crate::verify::hypothesis::Hypothesis;

/// Patches whose triples are laid onto touches, the first ones.
const PATCHES: usize = 160;

/// Cap on the triples of an object that are tried.
const TRIPLES_MAX: usize = 40_000;

/// Objects from which a catalogue is large: each gets less work.
const MANY: usize = 64;

/// [`PATCHES`] in a large catalogue.
const PATCHES_IF_MANY: usize = 80;

/// [`TRIPLES_MAX`] in a large catalogue.
const TRIPLES_MAX_IF_MANY: usize = 4_000;

/// Poses that are left for the slower steps.
const KEPT: usize = 24;

/// Share of the poses that a judge leaves to the next one.
const LEFT: usize = 4;

/// Distance of a touch from the line through two others (m) from which three fix a pose.
const ARM_MIN: f32 = 0.005;

/// Newest touches among which the three are chosen.
const RECENT: usize = 16;

/// Deviation of a pose from three patches, in spacings of the patches tried.
const COARSE_SPACINGS: f32 = 0.5;

/// Deviations of a position beyond which a side of the triangle does not fit.
const DEVIATIONS: f32 = 2.0;

/// Whether poses need positions: pairs of normals cannot propose, since at most one touch has one.
pub(super) fn are_needed(touches: &[Observation]) -> bool {
    touches.iter().filter(|touch| touch.says != Says::Position).count() < 2
}

/// Three touches propose poses of the objects in scope; all touches judge them.
pub(super) fn propose_by_positions(
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    scope: &Scope,
) {
    let Some(three) = widest(evidence.touches) else { return };
    let effort = match objects.len() {
        0..MANY => (PATCHES, TRIPLES_MAX),
        _ => (PATCHES_IF_MANY, TRIPLES_MAX_IF_MANY),
    };
    for_each_object(objects, evidence.maps, evidence.stop, |object, map| {
        if !scope.has(object) {
            return;
        }
        let known = object.known(map);
        let mut new = coarse(map, evidence, three, effort);
        for hypothesis in &mut new {
            let score = evidence.score(known, &hypothesis.inverse_pose(), f32::NEG_INFINITY);
            hypothesis.score = score.unwrap_or(f32::NEG_INFINITY);
            settle(evidence, hypothesis, known);
        }
        object.hypotheses.extend(new);
        merge(&mut object.hypotheses, evidence.options);
    });
}

/// The newest touch and the two of the recent ones that span the widest triangle with it.
fn widest(touches: &[Observation]) -> Option<[usize; 3]> {
    let newest = touches.len().checked_sub(1)?;
    let recent = newest.saturating_sub(RECENT)..newest;
    let at = |index: usize| touches[index].position;
    let area = |b: usize, c: usize| {
        let (b, c) = (at(b) - at(newest), at(c) - at(newest));
        b.cross(c).length()
    };
    let pairs = recent.clone().flat_map(|b| (recent.start..b).map(move |c| [newest, b, c]));
    let best = pairs.max_by(|x, y| area(x[1], x[2]).total_cmp(&area(y[1], y[2])))?;
    let longest = at(best[1]).distance(at(best[0])).max(at(best[2]).distance(at(best[0])));
    (area(best[1], best[2]) > ARM_MIN * longest).then_some(best)
}

/// The best poses of an object that lay three of its patches onto three touches, roughly refined.
/// `n_patches` and `n_triples` bound the work.
fn coarse(
    map: &SurfaceMap,
    evidence: &Evidence<'_>,
    three: [usize; 3],
    (n_patches, n_triples): (usize, usize),
) -> Vec<Hypothesis> {
    let touches = evidence.touches;
    let patches: Vec<Vec3> =
        map.patches().iter().take(n_patches).map(|patch| patch.position).collect();
    // A part of n patches of N lies √(N/n) times as far apart.
    let thinner = (map.patches().len() as f32 / patches.len().max(1) as f32).sqrt();
    let coarse = COARSE_SPACINGS * map.spacing() * thinner;
    let options = widened(evidence.options, coarse);
    let kernel = Kernel::new(&options);
    let mut poses = Vec::new();
    triples(&patches, touches, three, coarse, |stored| {
        if let Some(pose) = laid(three.map(|index| touches[index].position), stored) {
            poses.push((pose, 0.0f32));
        }
        if poses.len() < n_triples { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    // The touches that did not propose judge first: the three fit by construction.
    let others = (0..touches.len()).filter(|index| !three.contains(index));
    for judge in others.chain(three) {
        let inverse = |(pose, _): &(Hypothesis, f32)| pose.inverse_pose();
        let looked_up: Vec<InversePose> = poses.iter().map(inverse).collect();
        let scores = kernel.score_each(map, &looked_up, &[&touches[judge]]);
        poses.iter_mut().zip(scores).for_each(|(pose, score)| pose.1 += score);
        let left = (poses.len() / LEFT).max(LEFT * KEPT);
        keep_best(&mut poses, left);
    }
    keep_best(&mut poses, KEPT);
    let mut found: Vec<Hypothesis> = poses.into_iter().map(|(pose, _)| pose).collect();
    found.iter_mut().for_each(|pose| refine(pose, map, touches, &kernel, &options));
    found
}

/// The options of a kernel for poses that are off by this deviation (m).
fn widened(options: &SurfaceOptions, coarse: f32) -> SurfaceOptions {
    let mut wide = *options;
    wide.scale.across = wide.scale.across.hypot(coarse);
    wide.scale.along = wide.scale.along.hypot(coarse);
    wide.refinement.across = wide.refinement.across.hypot(coarse);
    wide
}

/// Keeps the `n` poses with the highest scores; equal scores keep their order.
fn keep_best(poses: &mut Vec<(Hypothesis, f32)>, n: usize) {
    if poses.len() > n {
        poses.sort_by(|a, b| b.1.total_cmp(&a.1));
        poses.truncate(n);
    }
}

/// Calls `found` with the places of every ordered triple of patches whose sides are those of the
/// three touches, until it breaks.
fn triples(
    patches: &[Vec3],
    touches: &[Observation],
    three: [usize; 3],
    coarse: f32,
    mut found: impl FnMut([Vec3; 3]) -> ControlFlow<()>,
) {
    let side = |a: usize, b: usize| {
        let (a, b) = (&touches[three[a]], &touches[three[b]]);
        let (variance, _) = a.looseness_to(b);
        (a.position.distance(b.position), coarse.hypot(DEVIATIONS * variance.sqrt()))
    };
    let sides = [side(0, 1), side(0, 2), side(1, 2)];
    let fits = |a: Vec3, b: Vec3, (distance, tolerance): (f32, f32)| {
        (a.distance(b) - distance).abs() <= tolerance
    };
    for a in patches {
        // Those at the third corner's distance from the first, for all second corners.
        let thirds: Vec<Vec3> =
            patches.iter().copied().filter(|c| fits(*a, *c, sides[1])).collect();
        for b in patches.iter().filter(|b| fits(*a, **b, sides[0])) {
            for c in thirds.iter().filter(|c| fits(*b, **c, sides[2])) {
                if found([*a, *b, *c]).is_break() {
                    return;
                }
            }
        }
    }
}

/// The pose that lays a stored triangle onto an observed one: middle onto middle, plane onto
/// plane; `None` for a triangle without a plane.
fn laid(observed: [Vec3; 3], stored: [Vec3; 3]) -> Option<Hypothesis> {
    let frame = |[a, b, c]: [Vec3; 3]| {
        let x = (b - a).try_normalize()?;
        let z = x.cross(c - a).try_normalize()?;
        Some(Mat3::from_cols(x, z.cross(x), z))
    };
    let rotation = frame(observed)? * frame(stored)?.transpose();
    let middle = |[a, b, c]: [Vec3; 3]| (a + b + c) / 3.0;
    let translation = middle(observed) - rotation * middle(stored);
    let rotation = Quat::from_mat3(&rotation).normalize();
    Some(Hypothesis::new(rotation, translation, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::touch::{PointDeviations, Touch};
    use crate::test_support::{error, map_of, places, seen, some_pose};

    #[test]
    fn a_triangle_of_patches_gives_its_pose() {
        let places = places(3, 4);
        let pose = some_pose(1);
        let stored = [0, 1, 2].map(|n| places[n].position.as_vec3());
        let observed = [0, 1, 2].map(|n| (pose * places[n].position).as_vec3());
        let laid = laid(observed, stored).unwrap();
        let (moved, turned) = error(laid.rotation, laid.translation, &pose);
        assert!(moved < 1e-5 && turned < 1e-3, "{moved} {turned}");
        assert!(super::laid([Vec3::ZERO; 3], stored).is_none());
    }

    #[test]
    fn only_sessions_without_a_pair_of_normals_need_them() {
        let touch = |normal: Option<f64>| {
            let point = Some(PointDeviations { position: 0.001, normal });
            seen(&Touch { point, ..places(1, 0).remove(0) }, &some_pose(0))
        };
        assert!(are_needed(&[touch(None), touch(Some(0.1)), touch(None)]));
        assert!(!are_needed(&[touch(Some(0.2)), touch(Some(0.1)), touch(None)]));
    }

    #[test]
    fn triples_have_the_sides_of_the_triangle() {
        let places = places(400, 0);
        let map = map_of(&places);
        let patches: Vec<Vec3> =
            map.patches().iter().take(100).map(|patch| patch.position).collect();
        let touches = [5, 40, 90].map(|n| seen(&places[n], &some_pose(2)));
        let mut exact = false;
        triples(&patches, &touches, [0, 1, 2], 0.001, |stored| {
            let sides = |[a, b, c]: [Vec3; 3]| [a.distance(b), a.distance(c), b.distance(c)];
            let (found, expected) = (sides(stored), sides([0, 1, 2].map(|n| touches[n].position)));
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 0.001 + 1e-6);
            }
            exact |= stored == [5, 40, 90].map(|n: usize| patches[n]);
            ControlFlow::Continue(())
        });
        assert!(exact, "the true one is among them");
    }
}
