//! The geometric model of chapter 3: maps of contact and pressure.
//!
//! One part of a catalogue, trained on request. Maps are in the same object frames as the
//! rest of the catalogue. The properties of sensors (gains) and of the classifier (the table
//! of class probabilities) are shared by all objects.

use std::sync::Arc;

use crate::mosaic::ForceMosaic;
use crate::occupancy::OccupancyGrid;
use palpate_core::reading::SensorId;

pub use crate::occupancy::table::{ClassTable, ClassTableError, TABLE_LOG_ODDS};

/// The geometry of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct GeometricMap {
    /// Occupancy: the cells that generate contact; planar or solid.
    pub occupancy: OccupancyGrid,
    /// Pressures of a planar map that was trained with force.
    pub mosaic: Option<ForceMosaic>,
}

/// The relative gains of one sensor's taxels, learnt from its training presses.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorGains {
    /// The sensor.
    pub sensor: SensorId,
    /// One gain per taxel, row-major, mean 1; a pressure is divided by it.
    pub gains: Vec<f64>,
}

/// The geometry of all objects of a catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct GeometricModel {
    /// Pr(class | log-odds), learnt from the training presses.
    pub table: ClassTable,
    /// Gains of the sensors of the training presses; other sensors have gain 1.
    pub gains: Vec<SensorGains>,
    /// The maps, in the order of the catalogue's objects.
    pub maps: Vec<Arc<GeometricMap>>,
}
