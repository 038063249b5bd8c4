//! Reasons for which a reading is refused.

use thiserror::Error;

use super::image::ImageShape;
use crate::units::Beyond;

/// Error of numbers that are not a reading.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ReadingError {
    /// The image does not have the sensor's shape.
    #[error("image has {found} taxels, expected {expected} ({shape})")]
    TaxelCount {
        /// Taxels of the sensor.
        expected: usize,
        /// Taxels of the image.
        found: usize,
        /// Order of the sensor's values.
        shape: ImageShape,
    },
    /// A pressure is not a finite number of pascals within the range.
    #[error(
        "pressure of taxel {taxel} is {}, expected a finite number within ±1e8 Pa",
        Beyond(*found, [-1e8, 1e8])
    )]
    Pressure {
        /// Index in the given order.
        taxel: usize,
        /// The given value.
        found: f64,
    },
    /// Too many taxels are missing.
    #[error("{missing} of {expected} taxels are missing, expected at most half")]
    Missing {
        /// Number of missing taxels.
        missing: usize,
        /// Number of taxels of the sensor.
        expected: usize,
    },
}
