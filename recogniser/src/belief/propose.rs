//! Proposals: poses of an object that a pair of touches may have come from.
//!
//! Beyond the dissertation; the key is that of Drost et al. (2010). Every stored
//! pair of like geometry gives one pose in closed form: axis onto axis, normals onto normals,
//! middle onto middle. Its weight is what the two appearances and the misfit of the geometry
//! say. When both normals lie along the axis the turn about it is open and is sampled.

use std::cmp::Ordering;

use glam::{Mat3, Quat, Vec3};

use super::options::SurfaceOptions;
use super::pair_fit::{alignment, fit};
use super::sighting::Sighting;
use crate::surface::SurfaceMap;
use crate::surface::pair_geometry::{PairGeometry, PairTolerance};

/// Turns about the axis that are tried when the normals do not fix it.
const FREE_TURNS: usize = 8;

/// However unsteadily the sensors stood, angles are looked for this far around (deviation, rad):
/// to go through all pairs costs more than it finds.
const UNSTEADY_MAX: f32 = 0.3;

/// A pose that a pair of touches proposes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proposal {
    pub(super) rotation: Quat,
    pub(super) translation: Vec3,
    /// What appearance and geometry of the stored pair weigh.
    pub(super) weight: f32,
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

impl Match {
    /// Likelier pairs first.
    fn likelier(&self, other: &Self) -> Ordering {
        other.weight.total_cmp(&self.weight).then(self.patches.cmp(&other.patches))
    }
}

/// Leaves the `n` likeliest, in any order.
fn keep_likeliest(matches: &mut Vec<Match>, n: usize) {
    if matches.len() > n {
        matches.select_nth_unstable_by(n, Match::likelier);
        matches.truncate(n);
    }
}

/// How far an object is asked for a pair of touches.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// At most so many of its pairs propose.
    pub(super) proposals: usize,
    /// At most so many proposals are judged by all touches.
    pub(super) judged: usize,
    /// They are pairs of its first so many patches, which cover its surface evenly.
    pub(super) patches: usize,
    /// Of the pairs that look alike so many are compared in their geometry, likeliest first.
    pub(super) fitted: usize,
    /// Pairs whose two appearances together are less likely, relative to touches anywhere,
    /// propose nothing.
    pub(super) appearance_min: f32,
}

impl Effort {
    /// How many of the map's patches, the first ones, are asked.
    fn n_asked(&self, map: &SurfaceMap) -> usize {
        n_tabled(map).min(self.patches)
    }

    /// What a touch looks like beside each of the patches that are asked.
    pub(super) fn looks(&self, map: &SurfaceMap, touch: &Sighting) -> Vec<f32> {
        let mut looks = Vec::new();
        touch.appearances(map.features(), 0..self.n_asked(map), &mut looks);
        looks
    }
}

/// Of how many of a map's patches, the first ones, pairs are tabled.
fn n_tabled(map: &SurfaceMap) -> usize {
    map.layout().pair_patches_max.min(map.patches().len())
}

/// Proposes poses of an object for two touches; `None` when they are at one place. `looks` are
/// what they look like beside the patches that are asked ([`Effort::looks`]).
pub(super) fn propose(
    map: &SurfaceMap,
    touches: [&Sighting; 2],
    looks: [&[f32]; 2],
    effort: Effort,
    options: &SurfaceOptions,
) -> Option<Proposed> {
    let place = |touch: &Sighting| (touch.position, touch.normal);
    let options = &loosened(options, touches);
    let query = PairGeometry::new(place(touches[0]), place(touches[1]))?;
    let (facets, n_asked) = (map.facets(), effort.n_asked(map));
    let mut alike = Vec::new();
    let mut n_visited = 0;
    map.pairs().matches(query, options.pairs, |first, second| {
        let [Some(a), Some(b)] =
            [looks[0].get(usize::from(first)), looks[1].get(usize::from(second))]
        else {
            return;
        };
        n_visited += 1;
        let weight = a * b;
        if weight >= effort.appearance_min {
            alike.push(Match { weight, patches: [first, second] });
        }
    });
    keep_likeliest(&mut alike, effort.fitted);
    let mut matches = Vec::with_capacity(alike.len());
    let mut total = 0.0;
    for Match { weight: appearance, patches: [first, second] } in alike {
        let (a, b) = (&facets[usize::from(first)], &facets[usize::from(second)]);
        let Some(stored) = PairGeometry::new((a.position, a.normal), (b.position, b.normal)) else {
            continue;
        };
        let Some(fit) = fit(touches, &query, &stored, [a, b], options) else { continue };
        let weight = appearance * fit * alignment(touches, [a, b], options);
        total += weight;
        matches.push(Match { weight, patches: [first, second] });
    }
    // In a mean over all pairs those too short to be tabled have none like the observed one.
    let n_pairs = (n_asked * n_asked.saturating_sub(1)).max(1) as f32;
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
    let geometry = n_visited as f32 / n_pairs;
    let looks = looks.map(|looks| looks.iter().sum::<f32>() / looks.len() as f32);
    Some(Proposed { geometry, evidence: total / n_pairs, looks, proposals })
}

/// The options for two touches: wider as far as their bases and their normals are loose.
pub(super) fn loosened(options: &SurfaceOptions, touches: [&Sighting; 2]) -> SurfaceOptions {
    let mut options = *options;
    let (position, angle) = touches[0].looseness_to(touches[1]);
    let wider = |known: PairTolerance| PairTolerance {
        distance: known.distance.hypot(2.0 * position.sqrt()),
        cosine: known.cosine.hypot(2.0 * angle.sqrt()),
    };
    if position > 0.0 || angle > 0.0 {
        options.pairs = wider(options.pairs);
        options.pair_deviation = wider(options.pair_deviation);
    }
    options.pairs.cosine = options.pairs.cosine.hypot(2.0 * unsteady(touches).sqrt());
    options
}

/// By what variance (rad²) the angles of a pair are looked for around, since its sensors may not
/// have stood as the surface lies.
fn unsteady(touches: [&Sighting; 2]) -> f32 {
    let variance: f32 = touches.iter().map(|touch| touch.steadiness.normal_variance).sum();
    variance.min(UNSTEADY_MAX * UNSTEADY_MAX)
}

/// The poses that lay a stored pair, which weighs so much, onto an observed one.
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
    let turns = if sin.hypot(cos) > 0.15 { 1 } else { FREE_TURNS };
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
    use crate::belief::test_support::{error, map_of, places, seen, single, some_pose};
    use crate::surface::SurfacePatch;
    use crate::surface::Touch;
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
                assert!(proposed.evidence > 0.0 && proposed.geometry > 0.0);
                assert!((proposed.looks[0] - 1.0).abs() < 1e-4, "all look alike");
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
        touches: [&Sighting; 2],
        effort: Effort,
        options: &SurfaceOptions,
    ) -> Option<Proposed> {
        let [a, b] = touches.map(|touch| effort.looks(map, touch));
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
        // Its other end looks the same: a pose for either order.
        assert_eq!(count(&pair([DVec3::Z, tilted])), 2);
        assert_eq!(count(&mirrored), 0);
    }

    #[test]
    fn normals_along_the_axis_leave_the_turn_open_and_all_turns_are_tried() {
        let places = pair([DVec3::NEG_X, DVec3::X]);
        let map = map_of(&places);
        let pose = some_pose(3);
        let touches = [&places[0], &places[1]].map(|place| seen(place, &pose));
        let options = SurfaceOptions::default();
        let proposed = proposed_by(&map, [&touches[0], &touches[1]], ALL, &options).unwrap();
        // Eight turns for either order of the pair, which looks the same from both ends.
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
        // What is not asked is not missed: shares are of the pairs asked.
        let (few, all) = (asked([10, 60], 100), asked([10, 60], 300));
        assert!((0.3..3.0).contains(&(few.geometry / all.geometry)), "{few:?} {all:?}");
    }

    #[test]
    fn of_pairs_that_look_alike_the_likeliest_are_compared_in_their_geometry() {
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
