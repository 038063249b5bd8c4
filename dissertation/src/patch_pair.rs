//! Pairs of surface patches: the geometry and appearance that no pose of the object changes.
//!
//! Source: sections 5.3 and 5.4.

pub mod alignment;
pub mod distance;
pub mod index;

pub use distance::DistanceBins;
pub use index::{PairIndex, Posting};
