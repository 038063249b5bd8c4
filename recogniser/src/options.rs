//! Options of the recogniser: deviations, tolerances, the scale of the score, and budgets.
//!
//! Every number here is in the table of `docs/constants.md`.

use palpate_core::reading::Looseness;
use palpate_core::units::MM;

/// Deviations of a touch from the patch that explains it (equations R4 to R7).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchScale {
    /// Across the surface, metres.
    pub across: f32,
    /// Along the surface, metres.
    pub along: f32,
    /// Observed normal about either axis, rad, without the patch's own scatter.
    pub normal: f32,
    /// Share of touches whose normal gives only the side of the surface.
    pub normal_outliers: f32,
    /// Concentration of the stretch's double angle per product of the two elongations.
    pub direction: f32,
    /// Share of touches that come from the null distribution.
    pub outliers: f32,
    /// Volume of the null distribution, cubic metres.
    pub workspace: f32,
    /// Softness of appearance for finding pairs: the variance of two touches of one place, in
    /// units of training.
    pub appearance: f32,
    /// Softness of appearance for scoring a pose; larger, since among many poses some match by
    /// chance.
    pub appearance_of_pose: f32,
}

/// All constants in units of the score, ln density. They depend on each other: a change of the
/// density of a touch changes the meaning of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreScale {
    /// Expected maximum score of one touch. Poses that cannot reach the bar with it are dropped.
    /// It is not a strict bound: a rare appearance on a map of few patches can exceed it.
    pub touch_max: f32,
    /// Mean score a touch below which the best pose is a poor explanation.
    pub poor: f32,
    /// A hypothesis this far below the best of its object is dropped.
    pub drop_within: f32,
    /// An object this far below the best gets no new poses.
    pub drop_between: f32,
    /// Poses this far below the best add nothing to its share.
    pub alike_within: f32,
    /// Maximum loss of score by refinement: scores prefer poses on which touches lie on patches
    /// instead of between them.
    pub refined_loss_max: f32,
    /// Loss for each point that contradicts a pose (equation R11).
    pub contradiction: f32,
    /// Maximum loss of one press by contradictions, since sensors and maps have errors.
    pub contradictions_max: f32,
    /// Typical self-match score of a map, per touch (equation R13).
    pub self_match: f64,
    /// Share of the excess of the self-match score that counts for "none of these".
    pub self_match_share: f64,
    /// Loss of a loosely placed touch for each e-fold of its variance.
    pub loose_loss: f32,
    /// Evidence this far below the best is left out of a calibration.
    pub negligible: f64,
}

/// Deviations that refinement uses (equation R21).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefinementScale {
    /// Deviation of a touch from the surface, metres; less than [`TouchScale::across`], which
    /// also allows for poses that are not refined yet.
    pub across: f32,
    /// Distance along the surface within which patches determine its height, metres; more where they
    /// lie far apart (`refine::surface_point`).
    pub smoothing: f32,
    /// Factor by which the deviation of normals is enlarged.
    pub normal_factor: f32,
    /// Usual error of a tool centre along each axis, metres (equation R21a).
    pub tool: f32,
}

/// Distance of a stored pair from an observed one: tolerance, or deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairTolerance {
    /// Difference of distances, metres.
    pub distance: f32,
    /// Difference of each cosine and of the chirality.
    pub cosine: f32,
}

/// Bounds on hypotheses and proposals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Poses that one pair proposes for an object.
    pub proposals_per_object: usize,
    /// Partners of a new touch while no pose is likelier than not.
    pub partners: usize,
    /// Partners once a pose is likelier than not.
    pub partners_if_likely: usize,
    /// Partners while no hypothesis explains the touches well.
    pub partners_if_poor: usize,
    /// Hypotheses of an object.
    pub per_object: usize,
    /// Hypotheses of all objects together.
    pub total: usize,
    /// Hypotheses that are refined after a touch.
    pub refined: usize,
    /// Likeliest objects whose proposals are refined before they are merged.
    pub refined_objects: usize,
    /// Proposals of a pair that are refined for each of them.
    pub refined_proposals: usize,
    /// Bounds in a large catalogue.
    pub many: ManyBudget,
}

/// Bounds in a large catalogue, where candidates are retrieved from the joint pair table
/// (equations R19 and R20).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ManyBudget {
    /// Candidates per root of the number of objects.
    pub listed_per_root: usize,
    /// Eighths of that from the fourth touch on, when more partners propose.
    pub listed_later_in_eight: usize,
    /// Cap on candidates after the second touch.
    pub listed_for_pair: usize,
    /// Likeliest objects that get proposals besides the candidates.
    pub explored: usize,
    /// Partners of a new touch while no pose is likelier than not.
    pub partners: usize,
    /// Poses that one pair proposes for an object.
    pub proposals: usize,
    /// Proposals scored by all touches: those that fit the other touches best.
    pub judged: usize,
    /// Cap on patches of an object whose pairs propose from the third touch on.
    pub paired: usize,
    /// Cap on stored pairs visited per object (catalogue mean). A pair that would exceed it is
    /// looked up among fewer patches.
    pub visited: usize,
    /// Cap on stored pairs visited per object by all pairs of a touch, rarest pair first.
    pub visited_in_all: usize,
    /// Appearance-compatible pairs that get the geometric check, best first.
    pub fitted: usize,
}

impl Budget {
    /// The number of candidates among `n` objects, at most `n`.
    #[must_use]
    pub fn n_listed(&self, n: usize) -> usize {
        let root = (n as f64).sqrt().ceil() as usize;
        self.many.listed_per_root.saturating_mul(root).min(n)
    }
}

/// All options of the recogniser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// Deviations of touches.
    pub scale: TouchScale,
    /// Constants in units of the score.
    pub score: ScoreScale,
    /// Deviations of refinement.
    pub refinement: RefinementScale,
    /// Tolerance of a stored pair.
    pub pairs: PairTolerance,
    /// Deviation of a pair's distance, metres, and of its cosines (equation R9).
    pub pair_deviation: PairTolerance,
    /// Least appearance ratio of a stored pair that proposes.
    pub appearance_min: f32,
    /// Least appearance ratio of a stored pair that proposes in a large catalogue.
    pub appearance_min_if_many: f32,
    /// Bounds.
    pub budget: Budget,
    /// Added to the relative pair density in the retrieval score (equation R19).
    pub retrieval_floor: f32,
    /// Poses of an object nearer than this are one hypothesis: metres.
    pub merge_distance: f32,
    /// Poses of an object nearer than this are one hypothesis: rad.
    pub merge_angle: f32,
    /// Probability of a pose from which nothing more is proposed, if it explains the touches well.
    pub certain: f64,
    /// Prior probability that the object is not in the catalogue.
    pub unknown: f64,
    /// Announced drift between any two touches: deviations along and about each axis.
    pub motion: Option<Looseness>,
}

impl SurfaceOptions {
    /// The same options for a sensor of another width: the deviations of a touch from the surface
    /// and of its normal, and of pairs, times a factor above 0. Equation R4b.
    #[must_use]
    pub fn widened(mut self, width: f64) -> Self {
        let width = width as f32;
        let scaled = [
            &mut self.scale.across,
            &mut self.scale.normal,
            &mut self.refinement.across,
            &mut self.pairs.distance,
            &mut self.pair_deviation.distance,
        ];
        scaled.into_iter().for_each(|deviation| *deviation *= width);
        self
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
            score: ScoreScale {
                touch_max: 14.0,
                poor: 6.0,
                drop_within: 12.0,
                drop_between: 25.0,
                alike_within: 8.0,
                refined_loss_max: 3.0,
                contradiction: 0.5,
                contradictions_max: 3.0,
                self_match: 12.0,
                self_match_share: 0.8,
                loose_loss: 1.2,
                negligible: 60.0,
            },
            refinement: RefinementScale {
                across: 0.6 * mm,
                smoothing: 1.0 * mm,
                normal_factor: 1.9,
                tool: 2.0 * mm,
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
            retrieval_floor: 0.3,
            merge_distance: 3.0 * mm,
            merge_angle: 0.12,
            certain: 0.99,
            unknown: 0.05,
            motion: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidates_grow_as_the_root_of_the_catalogue() {
        let budget = SurfaceOptions::default().budget;
        // Sixteen times the root, at most the number of objects.
        assert_eq!([9, 400, 1_000, 10_000].map(|n| budget.n_listed(n)), [9, 320, 512, 1_600]);
    }
}
