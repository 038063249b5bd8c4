//! Observation: a reading becomes a touch, and the touch an observation relative to the
//! session's anchor.
//!
//! These values do not depend on the objects of the catalogue.

pub mod placement;
pub mod press_space;
pub mod stretch;
pub mod steadiness;
pub mod touch;
pub mod observation;
pub mod inverse_pose;
