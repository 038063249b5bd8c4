//! What the service must know of a tactile array sensor to understand its readings.

pub mod description;
pub mod point_spread;

pub use description::{
    ForceCurve, ImageOrder, SensorDescription, SensorError, SensorParameters, TaxelGrid,
};
