//! Bayes filters over identity and pose.

pub mod adaptive;
pub mod class_field;
pub mod histogram;
pub mod kld;
pub mod particle;
pub mod planes;
pub mod pose_bins;
pub mod sparse;
