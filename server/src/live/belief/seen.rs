//! What a camera said in a session, as its belief begins.

use palpate_recogniser::belief::SurfaceBelief;

use super::BeliefError;
use crate::model::Model;
use crate::wire::camera::stated;
use crate::wire::session::Options;

/// A new belief with what a camera said in its session; objects that the model lacks are left out.
pub(crate) fn seen(
    belief: SurfaceBelief,
    options: &Options,
    model: &Model,
) -> Result<SurfaceBelief, BeliefError> {
    let Some(stored) = &options.pose_prior else { return Ok(belief) };
    match stated(stored, model)? {
        Some(prior) => Ok(belief.with_pose_prior(&prior)?),
        None => Ok(belief),
    }
}
