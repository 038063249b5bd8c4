//! Beliefs: probabilities of identities and poses.

pub mod answer;
pub mod orbits;
pub mod prior;

pub use answer::{Answer, PoseMode, WeightedPose};
pub use prior::{MismatchError, log_prior};
