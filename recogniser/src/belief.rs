//! Belief: the state of a session, and its answers.
//!
//! [`SurfaceBelief`] owns the state; the files here that are not `surface_belief` or `component`
//! are functions from values to values.

mod answers;
pub mod calibrate;
mod checkpoint;
mod common;
mod component;
mod evidence_fit;
mod felt;
mod first_touch;
pub mod hold_out;
mod image_doubt;
mod misfit;
mod motion;
mod object;
mod pair_weight;
mod places;
mod positions;
mod posterior;
mod predictive;
mod quality;
pub mod recalibrate;
mod replay;
mod retrieval;
mod samples;
mod search;
mod stage;
mod stated_pair;
mod stated_search;
mod stop_fit;
mod surface_belief;

pub use checkpoint::NotCheckpoint;
pub use common::prepare;
pub use misfit::Misfit;
pub use quality::{Quality, RISKS, Stops};
pub use replay::{PastSession, READINGS_MAX};
pub use samples::PoseSample;
pub use surface_belief::SurfaceBelief;
