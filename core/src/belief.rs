//! Beliefs: identities, poses, and how sure they are.

pub mod answer;
pub mod orbits;
pub mod prior;

pub use answer::{Answer, PoseMode, WeightedPose};
pub use prior::{MismatchError, log_prior};
