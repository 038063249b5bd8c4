//! A grid of log-odds of occupancy, planar or solid, in the object frame.
//!
//! Cells are cubes of one side; a planar grid has one layer, whose cells are squares of the
//! plane z = `min.z`. Values lie at the cells' centres, x fastest, then y, then z.
//! Source: section 3.2.1. Not here: what a press says about the cells.

use glam::DVec3;
use thiserror::Error;

/// The most cells a grid may have.
pub const CELLS_MAX: usize = 64 << 20;

/// Where the cells of a grid lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridShape {
    min: DVec3,
    cell: f64,
    n: [usize; 3],
}

/// Why numbers are not a grid.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum GridError {
    /// The cell's side or the corner is not usable.
    #[error("cell of {found} m, expected a finite positive side and a finite corner")]
    Cell {
        /// The side that was given, metres.
        found: f64,
    },
    /// Too few or too many cells.
    #[error("grid of {x} × {y} × {z} cells, expected 1 to {CELLS_MAX} cells")]
    Count {
        /// Cells along x.
        x: usize,
        /// Cells along y.
        y: usize,
        /// Cells along z.
        z: usize,
    },
    /// The values do not fit the cells.
    #[error("{found} values, expected {expected}, all finite, and a prior within 0 and 1")]
    Values {
        /// Cells of the shape.
        expected: usize,
        /// Values that came.
        found: usize,
    },
}

impl GridShape {
    /// `n` cells of side `cell` (metres) along x, y and z from the corner `min` (metres) on;
    /// one layer (`n[2]` = 1) is a planar grid.
    ///
    /// # Errors
    /// [`GridError`] for a side that is not positive, or no or too many cells.
    pub fn new(min: DVec3, cell: f64, n: [usize; 3]) -> Result<Self, GridError> {
        if !(cell.is_finite() && cell > 0.0 && min.is_finite()) {
            return Err(GridError::Cell { found: cell });
        }
        let [x, y, z] = n;
        let count = x.checked_mul(y).and_then(|xy| xy.checked_mul(z));
        match count {
            Some(1..=CELLS_MAX) => Ok(Self { min, cell, n }),
            _ => Err(GridError::Count { x, y, z }),
        }
    }

    /// The corner with the smallest coordinates, metres.
    #[must_use]
    pub fn min(&self) -> DVec3 {
        self.min
    }

    /// A cell's side, metres.
    #[must_use]
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Cells along x, y and z.
    #[must_use]
    pub fn n(&self) -> [usize; 3] {
        self.n
    }

    /// Whether the grid is one layer.
    #[must_use]
    pub fn is_planar(&self) -> bool {
        self.n[2] == 1
    }

    /// How many cells there are.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.n.iter().product()
    }

    /// The centre of a cell, metres; in a planar grid it lies in the plane z = `min.z`.
    #[must_use]
    pub fn center(&self, cell: usize) -> DVec3 {
        let [x, y, _] = self.n;
        let layer = if self.is_planar() { 0.0 } else { (cell / (x * y)) as f64 + 0.5 };
        let place = DVec3::new((cell % x) as f64 + 0.5, (cell / x % y) as f64 + 0.5, layer);
        self.min + place * self.cell
    }
}

/// The log-odds of occupancy of every cell (equation 3.1).
#[derive(Clone, Debug, PartialEq)]
pub struct OccupancyGrid {
    shape: GridShape,
    prior: f64,
    log_odds: Vec<f32>,
}

impl OccupancyGrid {
    /// A grid from its parts: `prior` is the probability of a cell that no press has reached,
    /// and that of all space outside.
    ///
    /// # Errors
    /// [`GridError::Values`] unless there is a finite value for every cell and the prior lies
    /// strictly between 0 and 1.
    pub fn from_parts(shape: GridShape, prior: f64, log_odds: Vec<f32>) -> Result<Self, GridError> {
        let valid = prior > 0.0 && prior < 1.0 && log_odds.iter().all(|value| value.is_finite());
        if log_odds.len() != shape.n_cells() || !valid {
            return Err(GridError::Values { expected: shape.n_cells(), found: log_odds.len() });
        }
        Ok(Self { shape, prior, log_odds })
    }

    /// Where the cells lie.
    #[must_use]
    pub fn shape(&self) -> &GridShape {
        &self.shape
    }

    /// The probability of occupancy where nothing is known.
    #[must_use]
    pub fn prior(&self) -> f64 {
        self.prior
    }

    /// The cells' log-odds, x fastest, then y, then z.
    #[must_use]
    pub fn log_odds(&self) -> &[f32] {
        &self.log_odds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_counted_x_first_and_centered() {
        let shape = GridShape::new(DVec3::new(-1.0, 0.0, 2.0), 0.5, [4, 3, 2]).unwrap();
        // Cell 18 = 2 + 4·(1 + 3·1): x 2, y 1, z 1.
        assert_eq!(shape.center(18), DVec3::new(0.25, 0.75, 2.75));
        assert_eq!(shape.n_cells(), 24);
    }

    #[test]
    fn a_planar_grid_lies_in_its_plane() {
        let shape = GridShape::new(DVec3::new(0.0, 0.0, 0.003), 0.001, [2, 2, 1]).unwrap();
        assert!(shape.is_planar());
        assert_eq!(shape.center(3), DVec3::new(0.0015, 0.0015, 0.003));
    }

    #[test]
    fn shapes_without_cells_or_with_too_many_are_refused() {
        let count = |n| GridShape::new(DVec3::ZERO, 1.0, n).unwrap_err();
        assert_eq!(count([0, 1, 1]), GridError::Count { x: 0, y: 1, z: 1 });
        assert!(matches!(count([usize::MAX, 2, 1]), GridError::Count { .. }));
        assert_eq!(
            GridShape::new(DVec3::ZERO, 0.0, [1, 1, 1]),
            Err(GridError::Cell { found: 0.0 })
        );
    }

    #[test]
    fn values_must_fit_the_cells() {
        let shape = GridShape::new(DVec3::ZERO, 1.0, [2, 1, 1]).unwrap();
        assert!(OccupancyGrid::from_parts(shape, 0.5, vec![0.0; 2]).is_ok());
        assert!(OccupancyGrid::from_parts(shape, 0.5, vec![0.0; 3]).is_err());
        assert!(OccupancyGrid::from_parts(shape, 1.0, vec![0.0; 2]).is_err());
        assert!(OccupancyGrid::from_parts(shape, 0.5, vec![f32::NAN, 0.0]).is_err());
    }
}
