//! Proposals: poses of an object that explain a pair of touches.
//!
//! Every stored pair of similar geometry gives one pose in closed form: axis onto axis, normals
//! onto normals, midpoint onto midpoint. Its weight is the pair's density and appearance. If
//! both normals lie along the axis, the rotation about it is undetermined and is sampled.

use std::cmp::Ordering;

use glam::{Mat3, Quat, Vec3};

use super::effort::Effort;
use super::pair_density::{pair_density, pair_stretch_ratio, widened};
use crate::model::SurfaceMap;
use crate::model::pair_geometry::PairGeometry;
use crate::observe::observation::{Observation, Says};
use crate::options::SurfaceOptions;

/// Number of rotations about the axis that are tried if the normals do not determine it.
const FREE_TURNS: usize = 8;

/// Product of the two normals' sines with the axis below which they do not determine the rotation.
const TURN_FIXED: f32 = 0.15;

/// A pose that a pair of touches proposes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Proposal {
    pub(crate) rotation: Quat,
    pub(crate) translation: Vec3,
    /// Density and appearance of the stored pair.
    pub(crate) weight: f32,
}

/// Evidence and proposals of a pair of touches for one object.
#[derive(Clone, Debug, Default)]
pub(crate) struct Proposed {
    /// Evidence of the pair, which needs no pose.
    pub(crate) pair: PairEvidence,
    /// The best proposals.
    pub(crate) proposals: Vec<Proposal>,
}

/// The evidence of a pair of touches for one object.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PairEvidence {
    /// Share of the object's pairs in the cells visited.
    pub(crate) geometry: f32,
    /// Mean over the object's pairs of density and appearance: equation R10.
    pub(crate) evidence: f32,
    /// Product of the mean appearance ratios of both touches.
    pub(crate) appearance: f32,
}

/// A stored pair of similar geometry.
#[derive(Clone, Copy)]
struct Match {
    weight: f32,
    patches: [u16; 2],
}

impl Match {
    /// Likelier pairs first.
    fn likelier(&self, other: &Self) -> Ordering {
        other.weight.total_cmp(&self.weight).then(self.patches.cmp(&other.patches))
    }
}

/// Keeps the `n` likeliest, in any order.
fn keep_likeliest(matches: &mut Vec<Match>, n: usize) {
    if matches.len() > n {
        matches.select_nth_unstable_by(n, Match::likelier);
        matches.truncate(n);
    }
}

/// Proposes poses of an object for two touches; `None` when they are at one place or a normal is
/// missing (`belief::positions` proposes without). `appearances`
/// are the ratios of both at the patches that are looked up ([`Effort::appearance_ratios`]).
///
/// Equation R10 of docs/recogniser.md.
pub(crate) fn propose(
    map: &SurfaceMap,
    touches: [&Observation; 2],
    appearances: [&[f32]; 2],
    effort: Effort,
    options: &SurfaceOptions,
) -> Option<Proposed> {
    if touches.iter().any(|touch| touch.says == Says::Position) {
        return None;
    }
    let place = |touch: &Observation| (touch.position, touch.normal);
    let options = &widened(options, touches);
    let query = PairGeometry::new(place(touches[0]), place(touches[1]))?;
    let (facets, n_patches) = (map.facets(), effort.n_patches(map));
    let mut alike = Vec::new();
    let mut n_visited = 0;
    map.pairs().matches(query, options.pairs, |first, second| {
        let [Some(a), Some(b)] =
            [appearances[0].get(usize::from(first)), appearances[1].get(usize::from(second))]
        else {
            return;
        };
        n_visited += 1;
        let weight = a * b;
        if weight >= effort.appearance_min {
            alike.push(Match { weight, patches: [first, second] });
        }
    });
    // Without appearance all pairs are alike, and which of them fit only their geometry says.
    if touches.iter().any(|touch| touch.says == Says::All) {
        keep_likeliest(&mut alike, effort.fitted);
    }
    let mut matches = Vec::with_capacity(alike.len());
    let mut total = 0.0;
    for Match { weight: appearance, patches: [first, second] } in alike {
        let (a, b) = (&facets[usize::from(first)], &facets[usize::from(second)]);
        let Some(stored) = PairGeometry::new((a.position, a.normal), (b.position, b.normal)) else {
            continue;
        };
        let Some(density) = pair_density(touches, &query, &stored, [a, b], options) else {
            continue;
        };
        let weight = appearance * density * pair_stretch_ratio(touches, [a, b], options);
        total += weight;
        matches.push(Match { weight, patches: [first, second] });
    }
    // Pairs too short to be tabled have a density of 0 in the mean over all pairs.
    let n_pairs = (n_patches * n_patches.saturating_sub(1)).max(1) as f32;
    keep_likeliest(&mut matches, effort.proposals);
    matches.sort_unstable_by(Match::likelier);
    let mut proposals = Vec::with_capacity(matches.len());
    for found in &matches {
        let stored = found.patches.map(|patch| {
            let facet = &facets[usize::from(patch)];
            (facet.position, facet.normal)
        });
        poses(touches.map(place), stored, found.weight, &mut proposals);
    }
    let mean = |ratios: &[f32]| ratios.iter().sum::<f32>() / ratios.len() as f32;
    let pair = PairEvidence {
        geometry: n_visited as f32 / n_pairs,
        evidence: total / n_pairs,
        appearance: mean(appearances[0]) * mean(appearances[1]),
    };
    Some(Proposed { pair, proposals })
}

/// Appends the poses that map a stored pair of this weight onto an observed one.
fn poses(
    observed: [(Vec3, Vec3); 2],
    stored: [(Vec3, Vec3); 2],
    weight: f32,
    found: &mut Vec<Proposal>,
) {
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
    let turns = if sin.hypot(cos) > TURN_FIXED { 1 } else { FREE_TURNS };
    let middle = 0.5 * (observed[0].0 + observed[1].0);
    let stored_middle = 0.5 * (stored[0].0 + stored[1].0);
    for turn in 0..turns {
        let angle = angle + std::f32::consts::TAU * turn as f32 / turns as f32;
        let rotation = (Quat::from_axis_angle(axis, angle) * onto_axis).normalize();
        let translation = middle - Mat3::from_quat(rotation) * stored_middle;
        found.push(Proposal { rotation, translation, weight });
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::model::SurfacePatch;
    use crate::observe::touch::Touch;
    use crate::test_support::{error, map_of, places, seen, single, some_pose};
    use palpate_core::pose::Pose;

    #[test]
    fn an_exact_pair_proposes_the_exact_pose() {
        let options = SurfaceOptions::default();
        let places = places(200, 0);
        let map = map_of(&places);
        for (index, pair) in places.chunks_exact(2).take(20).enumerate() {
            let pose = some_pose(index as u64);
            let [a, b] = [&pair[0], &pair[1]].map(|place| seen(place, &pose));
            // In either order of the touches.
            for touches in [[&a, &b], [&b, &a]] {
                let proposed = proposed_by(&map, touches, ALL, &options).unwrap();
                let exact = proposed.proposals.iter().any(|proposal| {
                    let (moved, turned) = error(proposal.rotation, proposal.translation, &pose);
                    moved < 1e-5 && turned < 1e-3
                });
                assert!(exact, "pair {index} of {} proposals", proposed.proposals.len());
                assert!(proposed.pair.evidence > 0.0 && proposed.pair.geometry > 0.0);
                assert!((proposed.pair.appearance - 1.0).abs() < 1e-4, "all look alike");
            }
        }
    }

    const ALL: Effort = Effort {
        proposals: 60,
        judged: usize::MAX,
        patches: usize::MAX,
        fitted: usize::MAX,
        appearance_min: 0.5,
    };

    fn proposed_by(
        map: &SurfaceMap,
        touches: [&Observation; 2],
        effort: Effort,
        options: &SurfaceOptions,
    ) -> Option<Proposed> {
        let [a, b] = touches.map(|touch| effort.appearance_ratios(map, touch));
        propose(map, touches, [&a, &b], effort, options)
    }

    /// Two places 20 mm apart along x, with these normals.
    fn pair(normals: [DVec3; 2]) -> [Touch; 2] {
        let place = |x: f64, normal| Touch {
            position: DVec3::new(x, 0.0, 0.0),
            normal,
            ..places(1, 0).remove(0)
        };
        [place(-0.010, normals[0]), place(0.010, normals[1])]
    }

    #[test]
    fn the_mirror_image_of_a_pair_proposes_nothing() {
        let tilted = DVec3::new(0.0, 0.8, 0.6);
        let map = map_of(&pair([DVec3::Z, tilted]));
        let mirrored = pair([DVec3::Z, DVec3::new(0.0, -0.8, 0.6)]);
        let options = SurfaceOptions::default();
        let count = |places: &[Touch; 2]| {
            let touches = [&places[0], &places[1]].map(|place| seen(place, &Pose::IDENTITY));
            proposed_by(&map, [&touches[0], &touches[1]], ALL, &options).unwrap().proposals.len()
        };
        // The reversed pair has the same geometry: a pose for either order.
        assert_eq!(count(&pair([DVec3::Z, tilted])), 2);
        assert_eq!(count(&mirrored), 0);
    }

    #[test]
    fn all_turns_are_tried_when_normals_lie_along_the_axis() {
        let places = pair([DVec3::NEG_X, DVec3::X]);
        let map = map_of(&places);
        let pose = some_pose(3);
        let touches = [&places[0], &places[1]].map(|place| seen(place, &pose));
        let options = SurfaceOptions::default();
        let proposed = proposed_by(&map, [&touches[0], &touches[1]], ALL, &options).unwrap();
        // Eight rotations for either order of the pair, whose reverse has the same geometry.
        assert_eq!(proposed.proposals.len(), 16);
        let errors = proposed.proposals.iter().map(|p| error(p.rotation, p.translation, &pose));
        let nearest = errors.map(|(_, turned)| turned).fold(f64::INFINITY, f64::min);
        assert!(nearest < std::f64::consts::PI / 8.0 + 1e-3, "{nearest}");
    }

    #[test]
    fn with_less_effort_only_pairs_of_the_first_patches_propose() {
        let places = places(300, 0);
        let map = map_of(&places);
        let options = SurfaceOptions::default();
        let asked = |touches: [usize; 2], patches: usize| {
            let [a, b] = touches.map(|touch| seen(&places[touch], &Pose::IDENTITY));
            proposed_by(&map, [&a, &b], Effort { patches, ..ALL }, &options).unwrap()
        };
        let is_exact = |proposed: &Proposed| {
            let errors = proposed
                .proposals
                .iter()
                .map(|p| error(p.rotation, p.translation, &Pose::IDENTITY));
            errors.map(|(moved, _)| moved).fold(f64::INFINITY, f64::min) < 1e-5
        };
        assert!(is_exact(&asked([10, 60], 100)), "both among the first hundred");
        assert!(!is_exact(&asked([10, 160], 100)), "one is not");
        // Shares are relative to the pairs that are looked up.
        let (few, all) = (asked([10, 60], 100), asked([10, 60], 300));
        assert!((0.3..3.0).contains(&(few.pair.geometry / all.pair.geometry)), "{few:?} {all:?}");
    }

    #[test]
    fn the_likeliest_pairs_get_the_geometric_check() {
        let places = places(300, 0);
        let map = map_of(&places);
        // Half a deviation off, all but two.
        let look = |(index, patch): (usize, &SurfacePatch)| {
            let feature = if index == 10 || index == 60 { patch.feature } else { [2; 8] };
            SurfacePatch { feature, ..*patch }
        };
        let patches = map.patches().iter().enumerate().map(look).collect();
        let map = SurfaceMap::new(DVec3::ZERO, patches, map.layout());
        let options = SurfaceOptions::default();
        let [a, b] = [10, 60].map(|touch| seen(&places[touch], &Pose::IDENTITY));
        let fitted = |fitted| {
            let effort = Effort { fitted, ..ALL };
            proposed_by(&map, [&a, &b], effort, &options).unwrap().proposals
        };
        let exact = |proposals: &[Proposal]| {
            let errors =
                proposals.iter().map(|p| error(p.rotation, p.translation, &Pose::IDENTITY));
            errors.map(|(moved, _)| moved).fold(f64::INFINITY, f64::min) < 1e-5
        };
        let (few, all) = (fitted(2), fitted(usize::MAX));
        assert!(exact(&few) && few.len() <= 2, "{few:?}");
        assert!(exact(&all) && all.len() > 10, "{}", all.len());
    }

    #[test]
    fn a_pair_at_one_place_is_none_and_the_best_few_are_kept() {
        let places = places(300, 0);
        let map = map_of(&places);
        let [a, b] = [&places[0], &places[1]].map(|place| seen(place, &Pose::IDENTITY));
        let options = SurfaceOptions::default();
        assert!(proposed_by(&map, [&a, &a], ALL, &options).is_none());
        let all = proposed_by(&map, [&a, &b], ALL, &options).unwrap();
        let few = proposed_by(&map, [&a, &b], Effort { proposals: 3, ..ALL }, &options).unwrap();
        assert_eq!(few.proposals.len(), 3);
        let (first, best) = (&few.proposals[0], &all.proposals[0]);
        assert_eq!(first.translation, best.translation);
        let (rotation, translation) = single(&Pose::IDENTITY);
        assert!(first.translation.distance(translation) < 1e-5, "{first:?}");
        assert!(first.rotation.dot(rotation).abs() > 1.0 - 1e-5);
    }
}
