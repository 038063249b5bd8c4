//! Surface matching, the service's own recogniser: readings and surface maps in, beliefs out.
//!
//! The model is written down in `docs/recogniser.md`; "equation R4" refers to it. Pure: no HTTP,
//! no storage, no clock, and no randomness except from a seed. The modules are listed in the
//! order in which they may use each other; only `belief` has state. Not here: the dissertation's
//! methods.

pub mod options;
pub mod pose_prior;
pub mod model;
pub mod observe;
pub mod train;
pub mod propose;
pub mod verify;
pub mod refine;
pub mod belief;

pub mod next_touch;
#[cfg(test)]
mod test_support;
