//! The shortlist: of which of many objects poses are worth proposing.
//!
//! Section 5.6.4 leaves large sets of objects open. In a large catalogue each new touch, paired
//! with earlier ones, asks the table of all objects' pairs (`surface::joint_pairs`) how dense
//! each object's pairs are about what was felt. The estimates are multiplied up from touch to
//! touch for every object, so that one that was left out before may come in later; poses are
//! proposed for those that stand best. Their number grows as the root of the number of objects.

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
const ASKED: usize = 2;

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

    /// How many objects are listed after the second touch.
    pub(super) fn n_listed_for_pair(&self) -> Option<usize> {
        self.n_listed().map(|most| most.min(self.options.budget.many.listed_for_pair))
    }

    /// The newest touch and each partner ask the table how each object stands: all of them, or
    /// those that stand best. Whoever is not asked is taken to have no such pair. Says of each
    /// partner what share of an object's pairs are about the observed one, in the mean over all
    /// objects; `None` when there is no table.
    pub(super) fn take_census(&mut self, partners: &[usize], all: bool) -> Option<Vec<f32>> {
        let joint = self.model.joint_pairs()?;
        let [earlier @ .., newest] = self.touches.as_slice() else { return None };
        let mut shares = Vec::with_capacity(partners.len());
        let n_asked = self.n_listed().map_or(usize::MAX, |n| n.saturating_mul(ASKED));
        let bar = if all { f64::NEG_INFINITY } else { self.standing_of(n_asked) };
        let wanted: Vec<bool> = self.objects.iter().map(|state| state.standing >= bar).collect();
        let partners: Vec<&Sighting> = partners.iter().map(|n| &earlier[*n]).collect();
        for estimates in estimate(joint, newest, &partners, &wanted, &self.options) {
            let n_objects = estimates.len().max(1) as f32;
            let mean =
                |value: fn(&Estimate) -> f32| estimates.iter().map(value).sum::<f32>() / n_objects;
            shares.push(mean(|estimate| estimate.geometry));
            let mean = mean(|estimate| estimate.evidence);
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
        Some(shares)
    }

    /// The least standing of the `n` objects that stand best.
    pub(super) fn standing_of(&self, n: usize) -> f64 {
        let mut all: Vec<f64> = self.objects.iter().map(|state| state.standing).collect();
        all.sort_unstable_by(|a, b| b.total_cmp(a));
        all.get(n.saturating_sub(1)).copied().unwrap_or(f64::NEG_INFINITY)
    }
}

/// A pair of touches that the table is asked for.
struct Query<'a> {
    touches: [&'a Sighting; 2],
    geometry: PairGeometry,
    unsteady: f32,
    options: HybridOptions,
}

impl<'a> Query<'a> {
    /// `None` when both are at one place.
    fn new(touches: [&'a Sighting; 2], options: &HybridOptions) -> Option<Self> {
        let [a, b] = touches.map(|touch| (touch.position, touch.normal));
        Some(Self {
            touches,
            geometry: PairGeometry::new(a, b)?,
            unsteady: unsteady(touches),
            options: loosened(options, touches),
        })
    }

    /// What a table says of its objects that are wanted; `looks` are those of both touches at
    /// the tabled ones.
    fn ask(&self, table: &JointTable, wanted: &[bool], looks: [&[f32]; 2]) -> Vec<Estimate> {
        let mut estimates = vec![Estimate::default(); table.n_objects()];
        // Looks first: they differ more often.
        let mut alike = Vec::new();
        let least = self.options.appearance_min_if_many;
        table.matches(self.geometry, self.options.pairs, |object, [first, second]| {
            estimates[object].geometry += 1.0;
            let looks = looks[0][first] * looks[1][second];
            if looks >= least {
                alike.push((object, looks, [first, second]));
            }
        });
        for (object, looks, touches) in alike {
            let Some((facets, stored)) = table.pair(touches) else { continue };
            let misfit = misfit(&self.geometry, &stored, self.unsteady, &self.options);
            if let Some(misfit) = misfit {
                let turned = alignment(self.touches, facets, &self.options);
                estimates[object].evidence += looks * exp(-0.5 * misfit) * turned;
            }
        }
        for (object, estimate) in estimates.iter_mut().enumerate() {
            let n_pairs = table.n_pairs(object).max(1) as f32;
            let Estimate { geometry, evidence } = *estimate;
            *estimate = if wanted[object] {
                Estimate { geometry: geometry / n_pairs, evidence: evidence / n_pairs }
            } else {
                Estimate::default()
            };
        }
        estimates
    }
}

/// What the table says of all objects for the newest touch and each partner: of one at its place
/// nothing.
fn estimate(
    joint: &JointPairs,
    newest: &Sighting,
    partners: &[&Sighting],
    wanted: &[bool],
    options: &HybridOptions,
) -> Vec<Vec<Estimate>> {
    let pairs = partners.iter().map(|partner| [newest, *partner]);
    let queries: Vec<Option<Query<'_>>> = pairs.map(|pair| Query::new(pair, options)).collect();
    let of_table = |(table, wanted): (&JointTable, &[bool])| -> Vec<Vec<Estimate>> {
        let looks = |touch: &Sighting| {
            let mut looks = Vec::with_capacity(table.features().len());
            for (object, wanted) in wanted.iter().enumerate() {
                let touches = table.touches(object);
                if *wanted {
                    touch.appearances(table.features(), touches, &mut looks);
                } else {
                    looks.resize(touches.end, 0.0);
                }
            }
            looks
        };
        let newest = looks(newest);
        let ask = |query: &Option<Query<'_>>| match query {
            Some(query) => query.ask(table, wanted, [&newest, &looks(query.touches[1])]),
            None => vec![Estimate::default(); table.n_objects()],
        };
        queries.iter().map(ask).collect()
    };
    let tables = joint.tables().par_iter().zip(wanted.par_chunks(OBJECTS_PER_TABLE));
    let of_tables: Vec<Vec<Vec<Estimate>>> = tables.map(of_table).collect();
    let all = |query: usize| of_tables.iter().flat_map(|of| &of[query]).copied().collect();
    (0..queries.len()).map(all).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::hybrid::ObjectState;
    use crate::hybrid::partners::in_turn;
    use crate::hybrid::test_support::{belief_over, map_of, places, seen, some_pose};
    use crate::pose::Pose;
    use crate::surface::Touch;
    use crate::surface::pair_table::PairTable;

    /// What the table says of objects of 120 random places each, for touches of the third.
    fn estimates(touches: [usize; 2], wanted: [bool; 4]) -> Vec<Estimate> {
        let objects = [0, 1, 2, 3].map(|seed| places(120, seed));
        let maps = objects.each_ref().map(|places| Arc::new(map_of(places)));
        let pose = some_pose(5);
        let [a, b] = touches.map(|touch| seen(&objects[2][touch], &pose));
        let joint = JointPairs::build(&maps);
        let mut of_pairs = estimate(&joint, &a, &[&b], &wanted, &HybridOptions::default());
        of_pairs.remove(0)
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
        let estimates = estimate(&joint, &touch, &[&touch], &[true], &options);
        assert_eq!(estimates, [[Estimate::default()]]);
    }

    #[test]
    fn after_two_touches_few_objects_have_poses_and_all_have_a_standing() {
        let objects: Vec<Vec<Touch>> = (0..90).map(|index| places(60, index)).collect();
        let mut belief = belief_over(&objects, HybridOptions::default());
        assert_eq!((belief.n_listed(), belief.n_listed_for_pair()), (Some(90), Some(64)));
        let touches = [3, 50].map(|touch| seen(&objects[2][touch], &some_pose(5)));
        belief.touches = touches.to_vec();
        let shares = belief.take_census(&[0], true).unwrap();
        assert!(shares.len() == 1 && (1e-4..0.2).contains(&shares[0]), "{shares:?}");
        let asked = in_turn(&[0], Some(&shares), 2, &belief.options);
        belief.propose(&asked, f64::INFINITY, belief.n_listed_for_pair());
        let posed = belief.objects.iter().filter(|state| !state.hypotheses.is_empty()).count();
        assert!((32..=64).contains(&posed), "{posed}");
        let standing = |state: &ObjectState| state.standing.is_normal();
        assert_eq!(belief.objects.iter().filter(|state| standing(state)).count(), 90);
        // Who is not listed has no poses, whatever it is.
        let bar = belief.standing_of(64);
        let out = belief.objects.iter().filter(|state| state.standing < bar);
        assert!(out.clone().count() > 20 && out.clone().all(|state| state.hypotheses.is_empty()));
    }

    #[test]
    fn the_list_grows_as_the_root_of_the_catalogue() {
        let budget = HybridOptions::default().budget;
        // Sixteen times the root, never more than there are.
        assert_eq!([9, 400, 1_000, 10_000].map(|n| budget.n_listed(n)), [9, 320, 512, 1_600]);
    }
}
