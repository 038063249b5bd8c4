//! Occupancy grids: which cells around an object generate contact (chapter 3).

pub mod grid;

pub use grid::{GridError, GridShape, OccupancyGrid};
