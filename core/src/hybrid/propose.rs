//! Proposals: poses of an object that a pair of touches may have come from.
//!
//! Source: section 5.6.4 names the idea; the key is that of Drost et al. (2010). Every stored
//! pair of like geometry gives one pose in closed form: axis onto axis, normals onto normals,
//! middle onto middle. Its weight is what the two appearances and the misfit of the geometry
//! say. When both normals lie along the axis the turn about it is open and is sampled.

use glam::{Mat3, Quat, Vec2, Vec3};

use super::options::HybridOptions;
use super::score::log_aligned;
use super::sighting::Sighting;
use crate::surface::pair_table::PairGeometry;
use crate::surface::{SurfaceMap, SurfacePatch};

/// Turns about the axis that are tried when the normals do not fix it.
const FREE_TURNS: usize = 8;

/// A pose that a pair of touches proposes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proposal {
    pub(super) rotation: Quat,
    pub(super) translation: Vec3,
}

/// What a pair of touches says of one object.
#[derive(Clone, Debug, Default)]
pub(super) struct Proposed {
    /// The share of the object's pairs that have about this geometry.
    pub(super) geometry: f32,
    /// Mean over the object of how well each of the two appearances fits.
    pub(super) looks: [f32; 2],
    /// Mean over the object's pairs of what the pair's geometry and appearance weigh.
    pub(super) evidence: f32,
    /// The best proposals.
    pub(super) proposals: Vec<Proposal>,
}

/// A stored pair of like geometry.
#[derive(Clone, Copy)]
struct Match {
    weight: f32,
    patches: [u16; 2],
}

/// Proposes poses of an object for two touches; `None` when they are at one place.
pub(super) fn propose(
    map: &SurfaceMap,
    touches: [&Sighting; 2],
    options: &HybridOptions,
) -> Option<Proposed> {
    let place = |touch: &Sighting| (touch.position, touch.normal);
    let query = PairGeometry::new(place(touches[0]), place(touches[1]))?;
    let patches = map.patches();
    let paired = &patches[..map.layout().pair_patches_max.min(patches.len())];
    let looks = touches.map(|touch| -> Vec<f32> {
        paired.iter().map(|patch| touch.appearance(&patch.feature)).collect()
    });
    let mut matches = Vec::new();
    let (mut total, mut n_visited) = (0.0, 0);
    map.pairs().matches(query, options.pairs, |first, second| {
        n_visited += 1;
        let appearance = looks[0][usize::from(first)] * looks[1][usize::from(second)];
        if appearance < options.appearance_min {
            return;
        }
        let (a, b) = (&patches[usize::from(first)], &patches[usize::from(second)]);
        let Some(stored) = PairGeometry::new((a.position, a.normal), (b.position, b.normal)) else {
            return;
        };
        let Some(misfit) = misfit(&query, &stored, options) else { return };
        let weight = appearance * (-0.5 * misfit).exp() * alignment(touches, [a, b], options);
        total += weight;
        matches.push(Match { weight, patches: [first, second] });
    });
    let n_pairs = (2 * map.pairs().len().max(1)) as f32;
    let order =
        |a: &Match, b: &Match| b.weight.total_cmp(&a.weight).then(a.patches.cmp(&b.patches));
    let n = options.budget.proposals_per_object;
    if matches.len() > n {
        matches.select_nth_unstable_by(n, order);
        matches.truncate(n);
    }
    matches.sort_unstable_by(order);
    let mut proposals = Vec::with_capacity(matches.len());
    for found in &matches {
        let stored = found.patches.map(|patch| {
            let patch = &patches[usize::from(patch)];
            (patch.position, patch.normal)
        });
        poses(touches.map(place), stored, &mut proposals);
    }
    let geometry = n_visited as f32 / n_pairs;
    let looks = looks.map(|looks| looks.iter().sum::<f32>() / looks.len() as f32);
    Some(Proposed { geometry, evidence: total / n_pairs, looks, proposals })
}

/// How much likelier the stretch of both contacts, seen from the axis between them, is on a
/// stored pair than in any direction.
fn alignment(touches: [&Sighting; 2], patches: [&SurfacePatch; 2], options: &HybridOptions) -> f32 {
    let seen_axis = touches[1].position - touches[0].position;
    let axis = patches[1].position - patches[0].position;
    let mut log = 0.0;
    for (touch, patch) in touches.into_iter().zip(patches) {
        let stretch = options.scale.direction * touch.elongation * patch.elongation;
        let along = |normal: Vec3, direction: Vec3, axis: Vec3| {
            Vec2::new(direction.dot(axis), direction.dot(normal.cross(axis))).normalize_or_zero()
        };
        let seen = along(touch.normal, touch.direction, seen_axis);
        let known = along(patch.normal, patch.direction, axis);
        let cosine = seen.dot(known);
        log += log_aligned(stretch, cosine);
    }
    log.exp()
}

/// The squared misfit of two pairs in deviations; `None` beyond the tolerance.
fn misfit(query: &PairGeometry, stored: &PairGeometry, options: &HybridOptions) -> Option<f32> {
    let distance = (query.distance - stored.distance).abs();
    if distance > options.pairs.distance {
        return None;
    }
    let mut sum = (distance / options.pair_deviation.distance).powi(2);
    let cosines = query.cosines.iter().zip(&stored.cosines).map(|(a, b)| a - b);
    for difference in cosines.chain([query.chirality - stored.chirality]) {
        if difference.abs() > options.pairs.cosine {
            return None;
        }
        sum += (difference / options.pair_deviation.cosine).powi(2);
    }
    Some(sum)
}

/// The poses that lay a stored pair onto an observed one.
fn poses(observed: [(Vec3, Vec3); 2], stored: [(Vec3, Vec3); 2], found: &mut Vec<Proposal>) {
    let axis = (observed[1].0 - observed[0].0).normalize();
    let onto_axis = Quat::from_rotation_arc((stored[1].0 - stored[0].0).normalize(), axis);
    let (mut sin, mut cos) = (0.0, 0.0);
    for (seen, known) in observed.iter().zip(&stored) {
        let known = onto_axis * known.1;
        let flat = known - axis * known.dot(axis);
        sin += axis.dot(flat.cross(seen.1));
        cos += flat.dot(seen.1 - axis * seen.1.dot(axis));
    }
    let angle = sin.atan2(cos);
    let turns = if sin.hypot(cos) > 0.15 { 1 } else { FREE_TURNS };
    let middle = 0.5 * (observed[0].0 + observed[1].0);
    let stored_middle = 0.5 * (stored[0].0 + stored[1].0);
    for turn in 0..turns {
        let angle = angle + std::f32::consts::TAU * turn as f32 / turns as f32;
        let rotation = (Quat::from_axis_angle(axis, angle) * onto_axis).normalize();
        let translation = middle - Mat3::from_quat(rotation) * stored_middle;
        found.push(Proposal { rotation, translation });
    }
}
