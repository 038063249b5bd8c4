//! The description of a tactile array sensor: positions and responses of its taxels.
//!
//! Frame: origin at the centre of the covering's free surface, +z out of the sensor towards
//! the object, +x along columns, +y along rows. Images are row-major in that order. Source:
//! sections 2.1–2.5. Not here: fitting these numbers to a real sensor.

use thiserror::Error;

use super::coupling::Coupling;
use super::force_curve::ForceCurve;
use crate::units::{MM, Shown};

/// A rectangular grid of square taxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaxelGrid {
    /// Number of rows (along +y).
    pub rows: usize,
    /// Number of columns (along +x).
    pub cols: usize,
    /// Distance between the centres of neighbouring taxels, metres.
    pub pitch: f64,
    /// Side of one taxel's sensing area, metres; at most the pitch.
    pub taxel_width: f64,
}

impl TaxelGrid {
    /// The number of taxels.
    #[must_use]
    pub fn n_taxels(&self) -> usize {
        self.rows * self.cols
    }

    /// Whether the taxels fill an area: at least two rows and two columns. A single taxel or a
    /// single row has no image of a surface, and cannot tell how the surface lies.
    #[must_use]
    pub fn is_area(&self) -> bool {
        self.rows > 1 && self.cols > 1
    }

    /// The centre of a taxel in the sensor frame's plane, metres: (x, y).
    #[must_use]
    pub fn center(&self, row: usize, col: usize) -> (f64, f64) {
        let along = |index: usize, n: usize| (index as f64 - (n as f64 - 1.0) / 2.0) * self.pitch;
        (along(col, self.cols), along(row, self.rows))
    }
}

/// Order of the driver's image relative to the sensor frame's row-major order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImageOrder {
    /// The driver sends columns where we expect rows.
    pub transposed: bool,
    /// The driver's first row is our last.
    pub rows_reversed: bool,
    /// The driver's first column is our last.
    pub cols_reversed: bool,
}

impl ImageOrder {
    /// The values of a driver's image of `rows` × `cols` taxels in the sensor frame's
    /// row-major order.
    ///
    /// # Panics
    /// When there are not `rows` × `cols` values.
    #[must_use]
    pub fn row_major<T: Copy>(self, given: &[T], rows: usize, cols: usize) -> Vec<T> {
        assert_eq!(given.len(), rows * cols, "an image has a value a taxel");
        let mut ordered = Vec::with_capacity(given.len());
        for row in 0..rows {
            for col in 0..cols {
                ordered.push(given[self.place(row, col, rows, cols)]);
            }
        }
        ordered
    }

    /// The inverse of [`ImageOrder::row_major`]: the image as the driver sends it.
    ///
    /// # Panics
    /// When there are not `rows` × `cols` values.
    #[must_use]
    pub fn of_driver<T: Copy>(self, row_major: &[T], rows: usize, cols: usize) -> Vec<T> {
        assert_eq!(row_major.len(), rows * cols, "an image has a value a taxel");
        let mut sent = row_major.to_vec();
        for row in 0..rows {
            for col in 0..cols {
                sent[self.place(row, col, rows, cols)] = row_major[row * cols + col];
            }
        }
        sent
    }

    /// The index in the driver's image of the taxel of a row and column.
    fn place(self, row: usize, col: usize, rows: usize, cols: usize) -> usize {
        let row = if self.rows_reversed { rows - 1 - row } else { row };
        let col = if self.cols_reversed { cols - 1 - col } else { col };
        if self.transposed { col * rows + row } else { row * cols + col }
    }
}

/// The unchecked numbers of a sensor's description.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorParameters {
    /// The grid of taxels.
    pub grid: TaxelGrid,
    /// Thickness of the covering, metres: its largest indentation.
    pub covering_thickness: f64,
    /// Standard deviation of the Gaussian point spread, metres.
    pub point_spread: f64,
    /// Blurred displacement to pressure.
    pub force_curve: ForceCurve,
    /// Upper limit of a reported value, pascal.
    pub saturation: f64,
    /// Standard deviation of a reading's additive noise, pascal.
    pub noise: f64,
    /// Step of the analogue-to-digital converter, pascal; 0 for a continuous sensor.
    pub quantisation: f64,
    /// Order of the driver's images.
    pub image_order: ImageOrder,
    /// Spread, edge and cross-talk beyond one Gaussian.
    pub coupling: Coupling,
}

/// A checked description of a tactile array sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorDescription(SensorParameters);

/// Error of numbers that do not describe a sensor. `field` names the parameter.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SensorError {
    /// A count of rows or columns is out of range.
    #[error("{field} is {found}, expected 1 to 128")]
    Count {
        /// The parameter's name.
        field: &'static str,
        /// The given value.
        found: usize,
    },
    /// A number is not finite or not within its range.
    #[error(
        "{field} is {}, expected a finite number from {} to {} (SI units)", Shown(*found),
        Shown(*low), Shown(*high)
    )]
    Range {
        /// The parameter's name.
        field: &'static str,
        /// The given value.
        found: f64,
        /// The smallest permitted value.
        low: f64,
        /// The largest permitted value.
        high: f64,
    },
    /// A range ends below its start.
    #[error(
        "{field} is from {} to {}, expected a low end of at most the high end", Shown(*low),
        Shown(*high)
    )]
    Order {
        /// The range's name.
        field: &'static str,
        /// The given low end.
        low: f64,
        /// The given high end.
        high: f64,
    },
    /// A list of possibilities has none.
    #[error("{field} is empty, expected at least one")]
    Empty {
        /// The list's name.
        field: &'static str,
    },
    /// The force curve is not a rising sequence of knots from (0, 0).
    #[error(
        "force_curve knot {knot} is out of order, expected 2 to 64 finite knots \
         (displacement in m, pressure in Pa) that start at (0, 0) and rise"
    )]
    ForceCurve {
        /// The first invalid knot.
        knot: usize,
    },
}

impl SensorDescription {
    /// Checks every parameter.
    ///
    /// # Errors
    /// [`SensorError`] names the first parameter that is out of range.
    pub fn new(parameters: SensorParameters) -> Result<Self, SensorError> {
        let grid = &parameters.grid;
        for (field, found) in [("rows", grid.rows), ("cols", grid.cols)] {
            if !(1..=128).contains(&found) {
                return Err(SensorError::Count { field, found });
            }
        }
        within("pitch", grid.pitch, 0.05 * MM, 50.0 * MM)?;
        within("taxel_width", grid.taxel_width, 0.01 * MM, grid.pitch)?;
        within("covering_thickness", parameters.covering_thickness, 0.1 * MM, 50.0 * MM)?;
        within("point_spread", parameters.point_spread, 0.01 * MM, 50.0 * MM)?;
        within("saturation", parameters.saturation, 1.0, 1e8)?;
        within("noise", parameters.noise, 0.0, parameters.saturation)?;
        within("quantisation", parameters.quantisation, 0.0, parameters.saturation)?;
        parameters.coupling.check()?;
        Ok(Self(parameters))
    }

    /// The checked numbers.
    #[must_use]
    pub fn parameters(&self) -> &SensorParameters {
        &self.0
    }

    /// The grid of taxels.
    #[must_use]
    pub fn grid(&self) -> &TaxelGrid {
        &self.0.grid
    }
}

/// Checks that a parameter is finite and within its range.
pub(super) fn within(
    field: &'static str,
    found: f64,
    low: f64,
    high: f64,
) -> Result<(), SensorError> {
    if found.is_finite() && (low..=high).contains(&found) {
        return Ok(());
    }
    Err(SensorError::Range { field, found, low, high })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taxel_centers_lie_around_the_origin() {
        let sensor = SensorDescription::digitacts_6x6();
        let (x, y) = sensor.grid().center(0, 5);
        assert!((x - 5.0 * MM).abs() < 1e-12 && (y + 5.0 * MM).abs() < 1e-12);
    }

    #[test]
    fn the_first_invalid_parameter_is_named() {
        let mut parameters = SensorDescription::digitacts_6x6().parameters().clone();
        parameters.covering_thickness = f64::NAN;
        let error = SensorDescription::new(parameters).unwrap_err();
        assert!(matches!(error, SensorError::Range { field: "covering_thickness", .. }));
    }
}
