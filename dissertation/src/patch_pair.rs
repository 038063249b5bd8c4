//! Pairs of surface patches: their geometry and appearance, invariant to the object's pose.
//!
//! Source: sections 5.3 and 5.4.

pub mod alignment;
pub mod distance;
pub mod index;

pub use distance::DistanceBins;
pub use index::{PairIndex, Posting};
