//! What chapter 3 knows of the objects: where contact is, and with what pressure.
//!
//! One part of a catalogue, trained when asked for. Maps are in the same object frames as the
//! rest of the catalogue. What belongs to a sensor (gains) or to the classifier (the table of
//! class probabilities) is shared by all objects.

use std::sync::Arc;

use thiserror::Error;

use crate::mosaic::ForceMosaic;
use crate::occupancy::OccupancyGrid;
use crate::reading::SensorId;

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

/// How likely each contact class is where the map says so much: Pr(class | log-odds).
///
/// Row i belongs to the log-odds `-8 + 16·(i + ½)/n`; values between rows are interpolated,
/// beyond the first and last they are those. Classes: in contact, no contact, unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassTable(Vec<[f64; 3]>);

/// The largest log-odds that a [`ClassTable`] distinguishes, and minus the smallest.
pub const TABLE_LOG_ODDS: f64 = 8.0;

/// Why numbers are not a table of class probabilities.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ClassTableError {
    /// No or too many rows.
    #[error("{found} rows, expected 1 to 4096")]
    Rows {
        /// How many came.
        found: usize,
    },
    /// A row is not a distribution.
    #[error("row {row} is not three positive numbers that sum to 1")]
    Row {
        /// The first such row.
        row: usize,
    },
}

impl ClassTable {
    /// A table from its rows: (in contact, no contact, unknown).
    ///
    /// # Errors
    /// [`ClassTableError`] unless there are 1 to 4096 rows of positive numbers that sum to 1.
    pub fn new(rows: Vec<[f64; 3]>) -> Result<Self, ClassTableError> {
        if !(1..=4096).contains(&rows.len()) {
            return Err(ClassTableError::Rows { found: rows.len() });
        }
        let valid = |row: &[f64; 3]| {
            row.iter().all(|p| *p > 0.0) && (row.iter().sum::<f64>() - 1.0).abs() < 1e-6
        };
        match rows.iter().position(|row| !valid(row)) {
            Some(row) => Err(ClassTableError::Row { row }),
            None => Ok(Self(rows)),
        }
    }

    /// The rows, smallest log-odds first.
    #[must_use]
    pub fn rows(&self) -> &[[f64; 3]] {
        &self.0
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_a_table_are_distributions() {
        assert!(ClassTable::new(vec![[0.9, 0.05, 0.05]]).is_ok());
        assert_eq!(ClassTable::new(Vec::new()), Err(ClassTableError::Rows { found: 0 }));
        let bad = vec![[0.5, 0.25, 0.25], [0.5, 0.5, 0.0]];
        assert_eq!(ClassTable::new(bad), Err(ClassTableError::Row { row: 1 }));
    }
}
