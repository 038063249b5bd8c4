//! Tactile array sensors: their description, calibration, passport and point spread.

pub mod arrays;
pub mod coupling;
pub mod covering;
pub mod defaults;
pub mod force_curve;
pub mod grid;
pub mod layout;
pub mod unrolling;
pub mod description;
pub mod line;
pub mod response_curve;
pub mod calibration;
pub mod point_spread;
pub mod presets;
pub mod ranges;
pub mod family;
pub mod passport;
pub mod correction;
pub mod response;
pub mod spread_fit;

pub use calibration::{Calibration, TaxelResponse, TaxelState};
pub use correction::Correction;
pub use coupling::{Coupling, CoveringEdge, SpreadKernel};
pub use description::{ImageOrder, SensorDescription, SensorError, SensorParameters};
pub use family::{SensorFamily, SensorKnowledge};
pub use force_curve::ForceCurve;
pub use grid::TaxelGrid;
pub use layout::{Layout, LayoutError, Taxel};
pub use passport::{Estimate, Passport};
pub use presets::Preset;
pub use ranges::{SensorRanges, StatedRanges};
