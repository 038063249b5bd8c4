//! Observation: a reading becomes a touch, the touch an observation about the session's anchor.
//!
//! Values only; no object of the catalogue is looked at here.

pub mod inverse_pose;
pub mod observation;
pub mod placement;
pub mod press_space;
pub mod steadiness;
pub mod stretch;
pub mod touch;
