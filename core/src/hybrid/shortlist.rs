//! The shortlist: of which of many objects poses are worth proposing.
//!
//! Source: section 5.6.4 names the idea. In a large catalogue each new touch, paired with
//! earlier ones, asks the table of all objects' pairs (`surface::joint_pairs`) how dense each
//! object's pairs are about what was felt. The estimates are multiplied up from touch to touch
//! for every object, so that one that was left out before may come in later; poses are proposed
//! for those that stand best. Their number grows as the root of the number of objects.

use rayon::prelude::*;

use super::options::HybridOptions;
use super::pair_fit::{alignment, misfit};
use super::propose::{loosened, unsteady};
use super::sighting::Sighting;
use super::{HybridBelief, PairEvidence};
use crate::exponential::exp;
use crate::surface::joint_pairs::{JointPairs, JointTable, OBJECTS_PER_TABLE};
use crate::surface::pair_geometry::PairGeometry;

/// After the second touch so many times the listed objects are asked for.
const ASKED: usize = 4;

/// What the table says of an object, for one pair of touches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Estimate {
    /// The share of the object's pairs that have about this geometry.
    geometry: f32,
    /// Mean over the object's pairs of what the pair's geometry and appearance weigh.
    evidence: f32,
}

impl HybridBelief {
    /// How many objects are listed by the table; `None` when there is none to be asked, and
    /// all objects are.
    pub(super) fn n_listed(&self) -> Option<usize> {
        self.model.joint_pairs().map(|_| self.options.budget.n_listed(self.objects.len()))
    }

    /// The newest touch and each partner ask the table how each object stands: all of them, or
    /// those that stand best. Whoever is not asked is taken to have no such pair.
    pub(super) fn take_census(&mut self, partners: &[usize], all: bool) {
        let Some(joint) = self.model.joint_pairs() else { return };
        let [earlier @ .., newest] = self.touches.as_slice() else { return };
        let n_asked = self.n_listed().map_or(usize::MAX, |n| n.saturating_mul(ASKED));
        let bar = if all { f64::NEG_INFINITY } else { self.standing_of(n_asked) };
        let wanted: Vec<bool> = self.objects.iter().map(|state| state.standing >= bar).collect();
        for partner in partners {
            let pair = [newest, &earlier[*partner]];
            let Some(estimates) = estimate(joint, pair, &wanted, &self.options) else { continue };
            let total: f32 = estimates.iter().map(|estimate| estimate.evidence).sum();
            let mean = total / estimates.len().max(1) as f32;
            if mean <= 0.0 {
                continue;
            }
            for (state, Estimate { geometry, evidence }) in self.objects.iter_mut().zip(&estimates)
            {
                state.standing += f64::from((evidence / mean + self.options.standing_floor).ln());
                if state.pair.looks <= 0.0 {
                    // Looks are 1 in the mean over all objects.
                    let looks = state.log_evidence.exp() as f32;
                    state.pair = PairEvidence { geometry: *geometry, evidence: *evidence, looks };
                }
            }
        }
    }

    /// The least standing of the `n` objects that stand best.
    pub(super) fn standing_of(&self, n: usize) -> f64 {
        let mut all: Vec<f64> = self.objects.iter().map(|state| state.standing).collect();
        all.sort_unstable_by(|a, b| b.total_cmp(a));
        all.get(n.saturating_sub(1)).copied().unwrap_or(f64::NEG_INFINITY)
    }
}

/// Asks the table for two touches; `None` when they are at one place.
fn estimate(
    joint: &JointPairs,
    touches: [&Sighting; 2],
    wanted: &[bool],
    options: &HybridOptions,
) -> Option<Vec<Estimate>> {
    let place = |touch: &Sighting| (touch.position, touch.normal);
    let options = &loosened(options, touches);
    let unsteady = unsteady(touches);
    let query = PairGeometry::new(place(touches[0]), place(touches[1]))?;
    let of_table = |(table, wanted): (&JointTable, &[bool])| {
        let mut estimates = vec![Estimate::default(); table.n_objects()];
        table.matches(
            query,
            options.pairs,
            |object| wanted[object],
            |object, patches, stored| {
                let estimate = &mut estimates[object];
                estimate.geometry += 1.0;
                let Some(misfit) = misfit(&query, &stored, unsteady, options) else { return };
                let [a, b] = patches;
                let looks = touches[0].appearance(&a.feature) * touches[1].appearance(&b.feature);
                if looks >= options.appearance_min {
                    let turned = alignment(touches, patches, options);
                    estimate.evidence += looks * exp(-0.5 * misfit) * turned;
                }
            },
        );
        for (object, estimate) in estimates.iter_mut().enumerate() {
            let n_pairs = table.n_pairs(object).max(1) as f32;
            estimate.geometry /= n_pairs;
            estimate.evidence /= n_pairs;
        }
        estimates
    };
    let tables = joint.tables().par_iter().zip(wanted.par_chunks(OBJECTS_PER_TABLE));
    Some(tables.flat_map_iter(of_table).collect())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::hybrid::test_support::{map_of, places, seen, some_pose};
    use crate::pose::Pose;
    use crate::surface::pair_table::PairTable;

    /// What the table says of objects of 120 random places each, for touches of the third.
    fn estimates(touches: [usize; 2], wanted: [bool; 4]) -> Vec<Estimate> {
        let objects = [0, 1, 2, 3].map(|seed| places(120, seed));
        let maps = objects.each_ref().map(|places| Arc::new(map_of(places)));
        let pose = some_pose(5);
        let [a, b] = touches.map(|touch| seen(&objects[2][touch], &pose));
        let joint = JointPairs::build(&maps);
        estimate(&joint, [&a, &b], &wanted, &HybridOptions::default()).unwrap()
    }

    #[test]
    fn over_some_pairs_the_object_that_was_touched_stands_best() {
        let mut standing = [0.0f32; 4];
        for touch in 0..60 {
            let all = estimates([touch, touch + 55], [true; 4]);
            let mean = all.iter().map(|estimate| estimate.evidence).sum::<f32>() / 4.0;
            for (standing, estimate) in standing.iter_mut().zip(&all) {
                *standing += (estimate.evidence / mean + 0.3).ln();
            }
        }
        let others = standing[0].max(standing[1]).max(standing[3]);
        assert!(standing[2] > others + 1.0, "{standing:?}");
    }

    #[test]
    fn who_is_not_wanted_is_not_asked() {
        let all = estimates([3, 50], [true; 4]);
        let some = estimates([3, 50], [true, false, true, false]);
        assert_eq!((some[0], some[2]), (all[0], all[2]));
        assert_eq!((some[1], some[3]), (Estimate::default(), Estimate::default()));
    }

    #[test]
    fn the_estimate_of_geometry_is_the_share_of_pairs_in_the_cells_visited() {
        // All pairs of 120 places are tabled, in finer cells than those of the object's own
        // table: no more of them are visited, and none that is near is missed.
        let places = places(120, 2);
        let positions: Vec<_> =
            places.iter().map(|p| (p.position.as_vec3(), p.normal.as_vec3())).collect();
        let own = PairTable::build(&positions, 0.004, 0.002);
        let query = PairGeometry::new(positions[3], positions[50]).unwrap();
        let options = HybridOptions::default();
        let (mut visited, mut near) = (0.0f32, 0.0f32);
        own.matches(query, options.pairs, |first, second| {
            let [a, b] = [first, second].map(|place| positions[usize::from(place)]);
            visited += 1.0;
            let stored = PairGeometry::new(a, b).unwrap();
            near += f32::from(u8::from(misfit(&query, &stored, 0.0, &options).is_some()));
        });
        let n_pairs = (120 * 119) as f32;
        let share = estimates([3, 50], [true; 4])[2].geometry;
        assert!((near / n_pairs..=visited / n_pairs).contains(&share), "{near} {share} {visited}");
    }

    #[test]
    fn touches_at_one_place_are_no_pair() {
        let map = Arc::new(map_of(&places(20, 0)));
        let touch = seen(&places(20, 0)[0], &Pose::IDENTITY);
        let joint = JointPairs::build(&[map]);
        let options = HybridOptions::default();
        assert_eq!(estimate(&joint, [&touch, &touch], &[true], &options), None);
    }

    #[test]
    fn the_list_grows_as_the_root_of_the_catalogue() {
        let budget = HybridOptions::default().budget;
        // Eight times the root, never more than there are.
        assert_eq!([9, 100, 1_000, 10_000].map(|n| budget.n_listed(n)), [9, 80, 256, 800]);
    }
}
