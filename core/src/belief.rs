//! What the service answers: identities, poses, and how sure it is.

pub mod answer;
pub mod orbits;
pub mod refine;

pub use answer::{Answer, PoseMode, WeightedPose};
