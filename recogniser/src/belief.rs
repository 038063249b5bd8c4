//! Belief: the state of a session, and its answers.
//!
//! [`SurfaceBelief`] owns the state; the files here that are not `surface_belief` or `component`
//! are functions from values to values.

mod answers;
pub mod calibrate;
mod checkpoint;
mod common;
mod component;
mod felt;
mod misfit;
mod motion;
mod object;
mod positions;
mod posterior;
mod predictive;
mod retrieval;
mod samples;
mod search;
mod stage;
mod surface_belief;

pub use checkpoint::NotCheckpoint;
pub use common::prepare;
pub use misfit::Misfit;
pub use samples::PoseSample;
pub use surface_belief::SurfaceBelief;
