//! The description of a tactile array sensor: positions and responses of its taxels.
//!
//! Frame: origin at the centre of the covering's free surface, +z out of the sensor towards
//! the object, +x along columns, +y along rows. Images are row-major in that order. Source:
//! sections 2.1–2.5. Not here: fitting these numbers to a real sensor.

use std::sync::Arc;

use glam::DVec3;
use thiserror::Error;

use super::coupling::Coupling;
use super::force_curve::ForceCurve;
use super::grid::TaxelGrid;
use super::layout::{Layout, LayoutError, Taxel, place_in};
use crate::units::{Beyond, MM, Shown};

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
    /// The grid of taxels; with a layout, that of its images.
    pub grid: TaxelGrid,
    /// Taxels that are not exactly on the grid; `None` for those of the grid itself.
    pub layout: Option<Arc<Layout>>,
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
        "{field} is {}, expected a finite number from {} to {} (SI units)",
        Beyond(*found, [*low, *high]), Shown(*low), Shown(*high)
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
    /// Taxels are no layout.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Values of a layout come in the order of its taxels.
    #[error(
        "image_order turns or mirrors images, expected none: values come in the order of `taxels`"
    )]
    OrderOfLayout,
}

impl SensorDescription {
    /// Checks every parameter.
    ///
    /// # Errors
    /// [`SensorError`] names the first parameter that is out of range.
    pub fn new(mut parameters: SensorParameters) -> Result<Self, SensorError> {
        if let Some(layout) = &parameters.layout {
            parameters.grid = *layout.grid();
            if !layout.is_near_grid() && parameters.image_order != ImageOrder::default() {
                return Err(SensorError::OrderOfLayout);
            }
        }
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

    /// The grid of images.
    #[must_use]
    pub fn grid(&self) -> &TaxelGrid {
        &self.0.grid
    }

    /// The layout of the taxels; `None` when they are on the grid.
    #[must_use]
    pub fn layout(&self) -> Option<&Layout> {
        self.0.layout.as_deref()
    }

    /// The layout of taxels that are not in rows and columns; `None` when images are.
    #[must_use]
    pub fn listed(&self) -> Option<&Layout> {
        self.layout().filter(|layout| !layout.is_near_grid())
    }

    /// The number of values of a press.
    #[must_use]
    pub fn n_taxels(&self) -> usize {
        self.layout().map_or_else(|| self.grid().n_taxels(), |layout| layout.taxels().len())
    }

    /// A taxel, by its index in the sensor frame's order.
    ///
    /// # Panics
    /// When there is no such taxel.
    #[must_use]
    pub fn taxel(&self, index: usize) -> Taxel {
        match self.layout() {
            Some(layout) => layout.taxels()[index],
            None => Taxel {
                position: place_in(self.grid(), index),
                normal: DVec3::Z,
                width: self.grid().taxel_width,
            },
        }
    }

    /// Radius of the covering's curvature, metres; `None` for a flat sensor.
    #[must_use]
    pub fn radius(&self) -> Option<f64> {
        self.layout().map(Layout::radius).filter(|radius| radius.is_finite())
    }

    /// The point of the covering's free surface at a place (x, y) of an image, metres in the frame
    /// of the image: (x, y, 0), or below it on a curved skin.
    #[must_use]
    pub fn on_covering(&self, x: f64, y: f64) -> DVec3 {
        let Some(radius) = self.radius() else { return DVec3::new(x, y, 0.0) };
        let along = x.hypot(y);
        let angle = (along / radius).min(std::f64::consts::FRAC_PI_2);
        let shrunk = if along > 0.0 { radius * angle.sin() / along } else { 1.0 };
        DVec3::new(shrunk * x, shrunk * y, radius * (angle.cos() - 1.0))
    }

    /// The pressure (Pa) above which a taxel reads clearly more than noise: five deviations and two
    /// steps of the converter, and at least one part in two hundred of the sensing range.
    #[must_use]
    pub fn contact_floor(&self) -> f64 {
        let parameters = &self.0;
        (5.0 * parameters.noise)
            .max(2.0 * parameters.quantisation)
            .max(parameters.saturation / 200.0)
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
