//! Settling: refinement and new score of a hypothesis.

use super::gauss_newton::refine;
use crate::verify::evidence::{Evidence, Known};
use crate::verify::hypothesis::Hypothesis;

/// Refines a hypothesis and scores it anew; it stays unchanged if its score falls by more than
/// [`ScoreScale::refined_loss_max`](crate::options::ScoreScale::refined_loss_max).
pub(crate) fn settle(evidence: &Evidence<'_>, hypothesis: &mut Hypothesis, object: Known<'_>) {
    let mut tried = *hypothesis;
    refine(&mut tried, object.map, evidence.touches, evidence.kernel, evidence.options);
    let bar = hypothesis.score - evidence.options.score.refined_loss_max;
    if let Some(score) = evidence.score(object, &tried.inverse_pose(), bar)
        && score >= bar
    {
        *hypothesis = Hypothesis { score, ..tried };
    }
}
