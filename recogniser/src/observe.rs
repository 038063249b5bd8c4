//! Observation: a reading becomes a touch, the touch an observation about the session's anchor.
//!
//! Values only; no object of the catalogue is looked at here.

pub mod placement;
pub mod press_space;
pub mod stretch;
pub mod steadiness;
pub mod touch;
pub mod observation;
pub mod inverse_pose;
