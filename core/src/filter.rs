//! Bayes filters over identity and pose.

pub mod adaptive;
pub mod histogram;
pub mod kld;
pub mod particle;
pub mod planes;
pub mod pose_bins;
pub mod sparse;
