//! The shortlist: of which of many objects poses are worth proposing.
//!
//! Section 5.6.4 leaves large sets of objects open. In a large catalogue each new touch, paired
//! with earlier ones, asks the table of all objects' pairs (`surface::joint_pairs`) how dense
//! each object's pairs are about what was felt, by the same measure as an object's own pairs do.
//! The estimates are multiplied up from touch to touch; an object that is not asked keeps its
//! standing, so that it may come in later; poses are proposed for those that stand best. Their
//! number grows as the root of the number of objects.

use rayon::prelude::*;

use super::options::SurfaceOptions;
use super::pair_fit::{alignment, fit};
use super::propose::loosened;
use super::sighting::Sighting;
use super::{ObjectState, PairEvidence, SurfaceBelief};
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
    /// Mean over the object of how well each of the two appearances fits, multiplied.
    looks: f32,
}

impl SurfaceBelief {
    /// How many objects are listed by the table; `None` when there is none to be asked, and
    /// all objects are.
    pub(super) fn n_listed(&self) -> Option<usize> {
        self.model.joint_pairs().map(|_| self.options.budget.n_listed(self.n_searched()))
    }

    /// How many objects are listed after the second touch.
    pub(super) fn n_listed_for_pair(&self) -> Option<usize> {
        self.n_listed().map(|most| most.min(self.options.budget.many.listed_for_pair))
    }

    /// The newest touch and each partner ask the table how each object stands: all of them, or
    /// those that stand best. One that is not asked keeps its standing: those that are asked
    /// gain nothing in the mean (ln), so that it falls behind no further than they do. Says of
    /// each partner what share of an object's pairs are about the observed one, in the mean over
    /// the objects asked; `None` when there is no table.
    pub(super) fn take_census(&mut self, partners: &[usize], all: bool) -> Option<Vec<f32>> {
        let joint = self.model.joint_pairs()?;
        let [earlier @ .., newest] = self.touches.as_slice() else { return None };
        let mut shares = Vec::with_capacity(partners.len());
        let n_asked = self.n_listed().map_or(usize::MAX, |n| n.saturating_mul(ASKED));
        let bar = if all { f64::NEG_INFINITY } else { self.standing_of(n_asked) };
        let is_wanted = |state: &ObjectState| !state.is_ruled_out && state.standing >= bar;
        let wanted: Vec<bool> = self.objects.iter().map(is_wanted).collect();
        let n_wanted = wanted.iter().filter(|wanted| **wanted).count().max(1);
        let partners: Vec<&Sighting> = partners.iter().map(|n| &earlier[*n]).collect();
        for estimates in estimate(joint, newest, &partners, &wanted, &self.options) {
            let mean = |value: fn(&Estimate) -> f32| {
                estimates.iter().flatten().map(value).sum::<f32>() / n_wanted as f32
            };
            shares.push(mean(|estimate| estimate.geometry));
            let mean = mean(|estimate| estimate.evidence);
            if mean <= 0.0 {
                continue;
            }
            let floor = self.options.standing_floor;
            let gain = |estimate: &Estimate| f64::from((estimate.evidence / mean + floor).ln());
            let usual = estimates.iter().flatten().map(gain).sum::<f64>() / n_wanted as f64;
            for (state, estimate) in self.objects.iter_mut().zip(&estimates) {
                let Some(estimate) = estimate else { continue };
                state.standing += gain(estimate) - usual;
                if state.pair.looks <= 0.0 {
                    let Estimate { geometry, evidence, looks } = *estimate;
                    state.pair = PairEvidence { geometry, evidence, looks };
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
    options: SurfaceOptions,
}

impl<'a> Query<'a> {
    /// `None` when both are at one place.
    fn new(touches: [&'a Sighting; 2], options: &SurfaceOptions) -> Option<Self> {
        let [a, b] = touches.map(|touch| (touch.position, touch.normal));
        Some(Self {
            touches,
            geometry: PairGeometry::new(a, b)?,
            options: loosened(options, touches),
        })
    }

    /// What a table says of its objects that are wanted; `looks` are those of both touches at
    /// the tabled ones.
    fn ask(
        &self,
        table: &JointTable,
        wanted: &[bool],
        looks: [&[f32]; 2],
    ) -> Vec<Option<Estimate>> {
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
            let fit = fit(self.touches, &self.geometry, &stored, facets, &self.options);
            if let Some(fit) = fit {
                let turned = alignment(self.touches, facets, &self.options);
                estimates[object].evidence += looks * fit * turned;
            }
        }
        let of_object = |(object, estimate): (usize, &Estimate)| {
            let n_pairs = table.n_pairs(object).max(1) as f32;
            let mean = |looks: &[f32]| {
                let looks = &looks[table.touches(object)];
                looks.iter().sum::<f32>() / looks.len().max(1) as f32
            };
            wanted[object].then(|| Estimate {
                geometry: estimate.geometry / n_pairs,
                evidence: estimate.evidence / n_pairs,
                looks: mean(looks[0]) * mean(looks[1]),
            })
        };
        estimates.iter().enumerate().map(of_object).collect()
    }
}

/// What the table says of each object for the newest touch and each partner: `None` of those that
/// are not wanted, and of all for a partner at the newest touch's place.
fn estimate(
    joint: &JointPairs,
    newest: &Sighting,
    partners: &[&Sighting],
    wanted: &[bool],
    options: &SurfaceOptions,
) -> Vec<Vec<Option<Estimate>>> {
    let pairs = partners.iter().map(|partner| [newest, *partner]);
    let queries: Vec<Option<Query<'_>>> = pairs.map(|pair| Query::new(pair, options)).collect();
    let of_table = |(table, wanted): (&JointTable, &[bool])| -> Vec<Vec<Option<Estimate>>> {
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
            None => vec![None; table.n_objects()],
        };
        queries.iter().map(ask).collect()
    };
    let tables = joint.tables().par_iter().zip(wanted.par_chunks(OBJECTS_PER_TABLE));
    let of_tables: Vec<Vec<Vec<Option<Estimate>>>> = tables.map(of_table).collect();
    let all = |query: usize| of_tables.iter().flat_map(|of| &of[query]).copied().collect();
    (0..queries.len()).map(all).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::belief::partners::in_turn;
    use crate::belief::test_support::{belief_over, map_of, places, seen, some_pose};
    use crate::surface::Touch;
    use crate::surface::pair_table::PairTable;
    use palpate_core::pose::Pose;

    /// What the table says of objects of 120 random places each, for touches of the third.
    fn estimates(touches: [usize; 2], wanted: [bool; 4]) -> Vec<Option<Estimate>> {
        let objects = [0, 1, 2, 3].map(|seed| places(120, seed));
        let maps = objects.each_ref().map(|places| Arc::new(map_of(places)));
        let pose = some_pose(5);
        let [a, b] = touches.map(|touch| seen(&objects[2][touch], &pose));
        let joint = JointPairs::build(&maps);
        let mut of_pairs = estimate(&joint, &a, &[&b], &wanted, &SurfaceOptions::default());
        of_pairs.remove(0)
    }

    #[test]
    fn over_some_pairs_the_object_that_was_touched_stands_best() {
        let mut standing = [0.0f32; 4];
        for touch in 0..60 {
            let all = estimates([touch, touch + 55], [true; 4]);
            let mean = all.iter().flatten().map(|estimate| estimate.evidence).sum::<f32>() / 4.0;
            for (standing, estimate) in standing.iter_mut().zip(all.iter().flatten()) {
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
        assert_eq!((some[1], some[3]), (None, None));
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
        let options = SurfaceOptions::default();
        let (mut visited, mut near) = (0.0f32, 0.0f32);
        own.matches(query, options.pairs, |first, second| {
            let [a, b] = [first, second].map(|place| positions[usize::from(place)]);
            visited += 1.0;
            let stored = PairGeometry::new(a, b).unwrap();
            let is_near = (query.distance - stored.distance).abs() <= options.pairs.distance
                && (query.cosines.iter().zip(&stored.cosines))
                    .all(|(a, b)| (a - b).abs() <= options.pairs.cosine);
            near += f32::from(u8::from(is_near));
        });
        let n_pairs = (120 * 119) as f32;
        let share = estimates([3, 50], [true; 4])[2].unwrap().geometry;
        assert!((near / n_pairs..=visited / n_pairs).contains(&share), "{near} {share} {visited}");
    }

    #[test]
    fn touches_at_one_place_are_no_pair() {
        let map = Arc::new(map_of(&places(20, 0)));
        let touch = seen(&places(20, 0)[0], &Pose::IDENTITY);
        let joint = JointPairs::build(&[map]);
        let options = SurfaceOptions::default();
        let estimates = estimate(&joint, &touch, &[&touch], &[true], &options);
        assert_eq!(estimates, [[None]]);
    }

    #[test]
    fn after_two_touches_few_objects_have_poses_and_all_have_a_standing() {
        let objects: Vec<Vec<Touch>> = (0..90).map(|index| places(60, index)).collect();
        let mut belief = belief_over(&objects, SurfaceOptions::default());
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

    /// A belief over `n` objects of 60 random places each that sees two touches of the third.
    fn touched(n: u64) -> SurfaceBelief {
        let objects: Vec<Vec<Touch>> = (0..n).map(|index| places(60, index)).collect();
        let mut belief = belief_over(&objects, SurfaceOptions::default());
        belief.touches = [3, 50].map(|touch| seen(&objects[2][touch], &some_pose(5))).to_vec();
        belief
    }

    #[test]
    fn after_two_touches_the_table_and_an_objects_own_pairs_are_one_scale() {
        let mut belief = touched(40);
        let shares = belief.take_census(&[0], true).unwrap();
        let by_table: Vec<PairEvidence> = belief.objects.iter().map(|state| state.pair).collect();
        // All of so few touches are tabled: both are means over the very same pairs.
        let asked = in_turn(&[0], Some(&shares), 2, &belief.options);
        belief.propose(&asked, f64::INFINITY, belief.n_listed_for_pair());
        let mut n_asked = 0;
        for (state, table) in belief.objects.iter().zip(&by_table) {
            let PairEvidence { evidence, looks, .. } = state.pair;
            assert!((evidence - table.evidence).abs() <= 1e-4 * evidence, "{table:?} {state:?}");
            assert!((looks - table.looks).abs() <= 1e-4 * looks, "{table:?} {state:?}");
            n_asked += usize::from(!state.hypotheses.is_empty());
        }
        assert!(n_asked > 10 && by_table[2].evidence > 0.0, "{n_asked}");
    }

    #[test]
    fn an_object_that_is_not_asked_keeps_its_standing() {
        let mut belief = touched(40);
        // Lists of seven, asked for twice as many.
        belief.options.budget.many.listed_per_root = 1;
        for (index, state) in belief.objects.iter_mut().enumerate() {
            state.standing = -(index as f64);
        }
        belief.take_census(&[0], false).unwrap();
        let gained = |n: usize| belief.objects[n].standing + n as f64;
        assert!((14..40).all(|n| gained(n).abs() < 1e-12), "not asked");
        assert!((0..14).all(|n| gained(n).abs() > 1e-6), "asked");
        let sum: f64 = (0..14).map(gained).sum();
        assert!(sum.abs() < 1e-9 && gained(2) > 0.0, "{sum}");
    }

    #[test]
    fn the_list_grows_as_the_root_of_the_catalogue() {
        let budget = SurfaceOptions::default().budget;
        // Sixteen times the root, never more than there are.
        assert_eq!([9, 400, 1_000, 10_000].map(|n| budget.n_listed(n)), [9, 320, 512, 1_600]);
    }
}
