//! How the surface recogniser works: its deviations, tolerances and budgets.

use super::pattern::PatternScale;
use super::propose::Effort;
use crate::surface::pair_geometry::PairTolerance;
use palpate_core::reading::Looseness;
use palpate_core::units::MM;

/// Deviations of a touch from the touches of a map that explain it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchScale {
    /// Along the normal of the mapped touch, metres.
    pub across: f32,
    /// Along the surface, metres.
    pub along: f32,
    /// Of the observed normal about either axis, rad; the mapped touch's own scatter comes on
    /// top.
    pub normal: f32,
    /// The share of touches whose normal says little: at edges and tips a sensor may stand
    /// almost any way round.
    pub normal_outliers: f32,
    /// The concentration of the stretch's double angle: so many times the product of the two
    /// contacts' elongations, as long as that is small.
    pub direction: f32,
    /// The share of touches that fit nowhere.
    pub outliers: f32,
    /// The volume in which a touch may lie that fits nowhere, cubic metres.
    pub workspace: f32,
    /// Variance of the appearance of two touches of one place, in units of the training's, for
    /// telling where a touch may be.
    pub appearance: f32,
    /// The same for judging a pose: larger, since among many poses some look alike by chance.
    pub appearance_of_pose: f32,
}

/// How refinement weighs what it lays onto the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefinementScale {
    /// Deviation of a touch from the surface, metres: less than that of
    /// [`TouchScale::across`], which also has to bear poses that are not refined yet.
    pub across: f32,
    /// Touches of the map this far along the surface still say how high it is, metres.
    pub smoothing: f32,
    /// Normals are trusted less than their scatter, by this factor.
    pub normal_factor: f32,
}

/// How many hypotheses there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Poses that one pair may propose for an object.
    pub proposals_per_object: usize,
    /// Earlier touches that a new one is paired with while no pose is likelier than not.
    pub partners: usize,
    /// The same once one is.
    pub partners_if_likely: usize,
    /// The same while no hypothesis explains the touches well.
    pub partners_if_poor: usize,
    /// Objects that a pair proposes poses for after the second touch, likeliest first.
    pub objects: usize,
    /// Hypotheses that an object keeps.
    pub per_object: usize,
    /// Hypotheses that all objects keep together.
    pub total: usize,
    /// Hypotheses that are refined after a touch.
    pub refined: usize,
    /// The likeliest objects, whose proposals are refined before they are judged.
    pub refined_objects: usize,
    /// Proposals of a pair that are refined for each of them.
    pub refined_proposals: usize,
    /// In a large catalogue.
    pub many: ManyBudget,
}

/// How much is looked at in a large catalogue, where a table of all pairs lists objects for
/// proposals. From the third touch on it bounds what is looked at, however common what was felt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ManyBudget {
    /// Objects are listed so many times the root of their number.
    pub listed_per_root: usize,
    /// From the fourth touch on so many in eight of them: more partners ask each.
    pub listed_later_in_eight: usize,
    /// After the second touch poses are proposed of at most so many objects: most of them will
    /// not last.
    pub listed_for_pair: usize,
    /// Likeliest objects that are asked besides those that are listed.
    pub explored: usize,
    /// Earlier touches that a new one is paired with while no pose is likelier than not.
    pub partners: usize,
    /// Poses that one pair may propose for an object.
    pub proposals: usize,
    /// Of them, those that fit the other touches best are judged by all.
    pub judged: usize,
    /// From the third touch on pairs of at most so many patches of an object propose.
    pub paired: usize,
    /// Of fewer patches where, in the mean over objects, more than so many stored pairs would be
    /// about the observed one.
    pub visited: usize,
    /// The rarest pairs of a touch are asked first, as many as have together so many stored pairs
    /// about them.
    pub visited_in_all: usize,
    /// Of the pairs that look alike so many are compared in their geometry, likeliest first.
    pub fitted: usize,
}

impl Budget {
    /// How many of `n` objects are listed for proposals, at most `n`.
    #[must_use]
    pub fn n_listed(&self, n: usize) -> usize {
        let root = (n as f64).sqrt().ceil() as usize;
        self.many.listed_per_root.saturating_mul(root).min(n)
    }
}

/// How the recogniser works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// How touches deviate from a map.
    pub scale: TouchScale,
    /// How contradictions of free and occupied space count.
    pub pattern: PatternScale,
    /// How poses are refined.
    pub refinement: RefinementScale,
    /// How far a stored pair may be from an observed one.
    pub pairs: PairTolerance,
    /// Deviation of a pair's distance, metres, and of its cosines.
    pub pair_deviation: PairTolerance,
    /// Stored pairs whose two appearances together are less likely than this, relative to
    /// touches anywhere, propose nothing.
    pub appearance_min: f32,
    /// The same in a large catalogue.
    pub appearance_min_if_many: f32,
    /// The bounds.
    pub budget: Budget,
    /// Added to how dense an object's pairs are beside the mean of all objects: what the table
    /// of all pairs does not have may still be.
    pub standing_floor: f32,
    /// Nearer poses of an object are one hypothesis: metres.
    pub merge_distance: f32,
    /// Nearer poses of an object are one hypothesis: rad.
    pub merge_angle: f32,
    /// A hypothesis this much (ln) below the best of its object is dropped.
    pub drop_within: f32,
    /// An object this much (ln) less likely than the best gets no new poses.
    pub drop_between: f32,
    /// With one pose at least so probable, and explaining the touches well, nothing is proposed.
    pub certain: f64,
    /// The probability, before any touch, that the object is none of the catalogue's.
    pub unknown: f64,
    /// A touch that the best hypothesis explains worse than this (ln, in the mean over the
    /// touches) makes it a poor explanation.
    pub poor: f32,
    /// How far the object moves between any two touches: deviations along and about each axis.
    pub motion: Option<Looseness>,
}

impl SurfaceOptions {
    /// How far each object is asked for a pair of touches, after so many touches. In a large
    /// catalogue `share` is that of an object's pairs that are about the observed one, in the mean
    /// over objects; `None` in a small one.
    pub(super) fn effort(&self, share: Option<f32>, n_touches: usize) -> Effort {
        let (budget, all) = (&self.budget, usize::MAX);
        let Some(share) = share else {
            let (proposals, appearance_min) = (budget.proposals_per_object, self.appearance_min);
            return Effort { proposals, judged: all, patches: all, fitted: all, appearance_min };
        };
        let ManyBudget { proposals, judged, paired, visited, fitted, .. } = budget.many;
        let appearance_min = self.appearance_min_if_many;
        // How dense pairs are about the first two touches tells objects apart: all are asked.
        if n_touches <= 2 {
            return Effort { proposals, judged, patches: all, fitted: all, appearance_min };
        }
        // n patches have some n² pairs.
        let patches = (visited as f32 / share.max(f32::MIN_POSITIVE)).sqrt() as usize;
        Effort { proposals, judged, patches: patches.min(paired), fitted, appearance_min }
    }
}

impl Default for SurfaceOptions {
    fn default() -> Self {
        let mm = MM as f32;
        Self {
            scale: TouchScale {
                across: 0.7 * mm,
                along: 4.0 * mm,
                normal: 0.07,
                normal_outliers: 0.05,
                direction: 45.0,
                outliers: 0.01,
                workspace: 0.064,
                appearance: 1.0,
                appearance_of_pose: 4.0,
            },
            pattern: PatternScale { point: 0.5, press_max: 3.0 },
            refinement: RefinementScale {
                across: 0.6 * mm,
                smoothing: 1.0 * mm,
                normal_factor: 1.9,
            },
            pairs: PairTolerance { distance: 2.5 * mm, cosine: 0.18 },
            pair_deviation: PairTolerance { distance: 1.0 * mm, cosine: 0.1 },
            appearance_min: 0.5,
            appearance_min_if_many: 1.0,
            budget: Budget {
                proposals_per_object: 60,
                partners: 2,
                partners_if_likely: 1,
                partners_if_poor: 3,
                objects: 300,
                per_object: 60,
                total: 1_000,
                refined: 24,
                refined_objects: 4,
                refined_proposals: 8,
                many: ManyBudget {
                    listed_per_root: 16,
                    listed_later_in_eight: 4,
                    listed_for_pair: 64,
                    explored: 64,
                    partners: 4,
                    proposals: 16,
                    judged: 2,
                    paired: 400,
                    visited: 1_200,
                    visited_in_all: 3_600,
                    fitted: 96,
                },
            },
            standing_floor: 0.3,
            merge_distance: 3.0 * mm,
            merge_angle: 0.12,
            drop_within: 12.0,
            drop_between: 25.0,
            certain: 0.99,
            unknown: 0.05,
            poor: 6.0,
            motion: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_objects_are_asked_for_less_and_from_the_third_touch_on_for_fewer_pairs() {
        let options = SurfaceOptions::default();
        let many = options.budget.many;
        let all = usize::MAX;
        for n_touches in [2, 3, 9] {
            let few = options.effort(None, n_touches);
            assert_eq!([few.patches, few.fitted, few.judged], [all; 3]);
            assert_eq!(few.proposals, options.budget.proposals_per_object);
        }
        let pair = options.effort(Some(0.5), 2);
        assert_eq!([pair.patches, pair.fitted], [all; 2], "however common");
        let rare = options.effort(Some(0.001), 3);
        assert_eq!((rare.patches, rare.fitted), (many.paired, many.fitted));
        assert_eq!((rare.proposals, rare.judged), (many.proposals, many.judged));
        assert_eq!(options.effort(Some(0.0), 3).patches, many.paired);
        // 1,200 of 3 % are 40,000 pairs, of 200 patches.
        assert_eq!(options.effort(Some(0.03), 3).patches, 200);
        assert!(many.proposals < options.budget.proposals_per_object);
        let least = |share| options.effort(share, 3).appearance_min;
        assert!(least(Some(0.01)) > least(None), "pairs have to look alike more");
    }
}
