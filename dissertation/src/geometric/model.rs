//! What chapter 3 knows of the objects: where contact is, and with what pressure.
//!
//! One part of a catalogue, trained when asked for. Maps are in the same object frames as the
//! rest of the catalogue. What belongs to a sensor (gains) or to the classifier (the table of
//! class probabilities) is shared by all objects.

use std::sync::Arc;

use crate::mosaic::ForceMosaic;
use crate::occupancy::OccupancyGrid;
use palpate_core::reading::SensorId;

pub use crate::occupancy::table::{ClassTable, ClassTableError, TABLE_LOG_ODDS};

/// The geometry of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct GeometricMap {
    /// Which cells generate contact; planar or solid.
    pub occupancy: OccupancyGrid,
    /// The pressures of a planar map, when it was trained with force.
    pub mosaic: Option<ForceMosaic>,
}

/// The relative gains of one sensor's taxels, learnt from its training presses.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorGains {
    /// The sensor.
    pub sensor: SensorId,
    /// One gain a taxel, row-major, mean 1; a pressure is divided by it.
    pub gains: Vec<f64>,
}

/// The geometry of all objects of a catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct GeometricModel {
    /// Pr(class | log-odds), learnt from the training presses.
    pub table: ClassTable,
    /// Gains of the sensors that took the training presses; others have gain 1.
    pub gains: Vec<SensorGains>,
    /// The maps, in the order of the catalogue's objects.
    pub maps: Vec<Arc<GeometricMap>>,
}
