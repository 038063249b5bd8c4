//! Tactile array sensors: their description, calibration and point spread.

pub mod calibration;
pub mod covering;
pub mod defaults;
pub mod description;
pub mod line;
pub mod point_spread;
pub mod response;
pub mod spread_fit;

pub use calibration::{Calibration, TaxelResponse, TaxelState};
pub use description::{
    ForceCurve, ImageOrder, SensorDescription, SensorError, SensorParameters, TaxelGrid,
};
