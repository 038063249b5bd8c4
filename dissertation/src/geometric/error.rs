//! Errors of a belief over geometry.

use thiserror::Error;

/// Error of a catalogue, a prior or a reading that cannot be used.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum GeometricError {
    /// An object has no force mosaic.
    #[error("object {object} has no force mosaic, expected one for every object")]
    NoMosaic {
        /// The first such object.
        object: usize,
    },
    /// The pose prior is solid, the maps are planar.
    #[error("a bounded prior over solid poses, expected solid maps in the catalogue")]
    NotSolid,
    /// The pose prior is planar, the maps are solid.
    #[error("a prior over poses in a plane, expected planar maps in the catalogue")]
    NotPlanar,
    /// The printed histogram filter has no solid form.
    #[error("a bounded prior over solid poses, expected a planar one: the histogram is planar")]
    PlanarOnly,
    /// The printed filters need every turn to be possible.
    #[error("half_angle is {found}, expected π: the printed filters consider every turn")]
    EveryTurn {
        /// The given bound, rad.
        found: f64,
    },
    /// The shared tables have no room for one more.
    #[error("a table of {needed} bytes is needed, and tables have {in_use} of {max} bytes")]
    TablesFull {
        /// Bytes of the new table.
        needed: usize,
        /// Bytes of the present tables.
        in_use: usize,
        /// Limit of all tables, bytes.
        max: usize,
    },
    /// The prior over objects does not fit the catalogue.
    #[error(
        "prior over {found} objects, expected {expected} finite weights of at least 0, not all 0"
    )]
    Prior {
        /// Objects of the catalogue.
        expected: usize,
        /// Number of weights.
        found: usize,
    },
    /// A number of the pose prior or of the filter is out of range.
    #[error("{field} is {found}, expected a finite number from {low} to {high} (SI units)")]
    Range {
        /// The field's name.
        field: &'static str,
        /// The given value.
        found: f64,
        /// The smallest permitted value.
        low: f64,
        /// The largest permitted value.
        high: f64,
    },
    /// The image is not the sensor's.
    #[error("image of {found_rows}×{found_cols} taxels, expected the sensor's {rows}×{cols}")]
    Shape {
        /// Rows of the sensor.
        rows: usize,
        /// Columns of the sensor.
        cols: usize,
        /// Rows of the image.
        found_rows: usize,
        /// Columns of the image.
        found_cols: usize,
    },
    /// The sensor's axis is too far from the plane's normal.
    #[error("press tilted by {degrees:.1} degrees from the plane's normal, expected at most 30")]
    Tilt {
        /// Angle between the sensor's axis and the plane's normal, degrees.
        degrees: f64,
    },
}
