//! Occupancy grids: the cells around an object that generate contact (chapter 3).

pub mod classify;
pub mod grid;
pub mod likelihood;
pub mod mapping;
mod shifted;
pub mod table;

pub use classify::{CONTACT_THRESHOLD, ContactClass, classify};
pub use grid::{GridError, GridShape, MergeError, OccupancyGrid};
pub use likelihood::{ClassifiedPress, log_likelihood};
pub use mapping::{InverseModel, Peak, SpreadForm, map_occupancy};
pub use table::{ClassTable, ClassTableError, TABLE_LOG_ODDS, learn_table};
