//! Bayes filters over identity and pose.

pub mod adaptive;
pub mod pose_bins;
pub mod sparse;
