//! The surface of an object as touches know it: what the surface recogniser looks things up in.
//!
//! A [`SurfaceMap`] holds thinned touches ([`SurfacePatch`]), each of them once more with the
//! surface bent about it ([`facet::Facet`]), a grid of voxels that finds the touches near a point,
//! a grid of what is material (`solid`), and a table of touch pairs by their geometry
//! (`pair_table`); some pairs of all objects are in one table (`joint_pairs`).
//! What a touch looks like is a point of a catalogue-wide [`AppearanceSpace`].
//! Frames: the object's. Lengths in metres, single precision: 80 mm are known to 10 nm.
//! Beyond the dissertation; sections 5.6.3–5.6.6 say what is wanted.

pub mod appearance;
pub mod bend;
pub mod facet;
pub mod features;
pub mod joint_pairs;
pub mod map;
pub mod near;
mod pair_cells;
pub mod pair_geometry;
pub mod pair_table;
pub mod solid;
pub mod thinning;
pub mod touch;
pub mod voxels;

pub use appearance::AppearanceSpace;
pub use map::{SurfaceMap, SurfacePatch};
pub use touch::Touch;
