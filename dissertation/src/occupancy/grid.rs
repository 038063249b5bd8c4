//! A grid of log-odds of occupancy, planar or solid, in the object frame.
//!
//! Cells are cubes of one side; a planar grid has one layer, whose cells are squares of the
//! plane z = `min.z`. Values lie at the cells' centres, x fastest, then y, then z. Source:
//! section 3.2.1. Not here: the evidence of a press for the cells.

use glam::DVec3;
use palpate_core::metric::Inertia;
use thiserror::Error;

use super::table::logit;

/// Maximum number of cells of a grid.
pub const CELLS_MAX: usize = 64 << 20;

/// Default limit of the log-odds of maps, in either direction.
pub const LOG_ODDS_MAX: f64 = 8.0;

/// Position and number of the cells of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridShape {
    min: DVec3,
    cell: f64,
    n: [usize; 3],
}

/// Error of numbers that are not a grid.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum GridError {
    /// The cell's side or the corner is not valid.
    #[error("cell of {found} m, expected a finite positive side and a finite corner")]
    Cell {
        /// The given side, metres.
        found: f64,
    },
    /// There are no cells or too many.
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
        /// Number of values.
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

    /// A grid of cells of side `cell` that holds the box from `low` to `high` (metres). Its
    /// corners are whole cells away from the origin, so that such grids share a lattice.
    /// `plane` is the height of a planar grid (metres), `None` makes a solid one.
    ///
    /// # Errors
    /// [`GridError`] when the cell is not usable or there would be too many cells.
    pub fn spanning(
        low: DVec3,
        high: DVec3,
        cell: f64,
        plane: Option<f64>,
    ) -> Result<Self, GridError> {
        let usable = cell.is_finite() && cell > 0.0 && low.is_finite() && high.is_finite();
        if !usable {
            return Err(GridError::Cell { found: cell });
        }
        let first = (low / cell).floor();
        // Saturating casts: too large numbers are refused below.
        let along = ((high / cell).ceil() - first).to_array().map(|n| n.max(1.0) as usize);
        match plane {
            Some(height) => Self::new((first * cell).with_z(height), cell, [along[0], along[1], 1]),
            None => Self::new(first * cell, cell, along),
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

    /// Number of cells.
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

/// Error of two maps that cannot be merged.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum MergeError {
    /// Their cells do not coincide.
    #[error(
        "maps of different shapes: {}, and {}, expected the same corner, cell and counts",
        described(.ours), described(.theirs)
    )]
    Shape {
        /// The first map's shape.
        ours: GridShape,
        /// The other's.
        theirs: GridShape,
    },
    /// They have different priors.
    #[error("maps of different priors: {ours} and {theirs}, expected the same prior")]
    Prior {
        /// The first map's prior.
        ours: f64,
        /// The other's.
        theirs: f64,
    },
}

fn described(shape: &GridShape) -> String {
    let ([x, y, z], min) = (shape.n, shape.min);
    format!("{x} × {y} × {z} cells of {} m from ({}, {}, {}) m", shape.cell, min.x, min.y, min.z)
}

/// The log-odds of occupancy of every cell (equation 3.1).
#[derive(Clone, Debug, PartialEq)]
pub struct OccupancyGrid {
    shape: GridShape,
    prior: f64,
    log_odds: Vec<f32>,
}

impl OccupancyGrid {
    /// A grid from its parts: `prior` is the probability of an unmapped cell, and of all
    /// space outside.
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

    /// Position and number of the cells.
    #[must_use]
    pub fn shape(&self) -> &GridShape {
        &self.shape
    }

    /// The probability of occupancy of unmapped cells.
    #[must_use]
    pub fn prior(&self) -> f64 {
        self.prior
    }

    /// The cells' log-odds, x fastest, then y, then z.
    #[must_use]
    pub fn log_odds(&self) -> &[f32] {
        &self.log_odds
    }

    /// The log-odds at a point of the object frame (metres), interpolated between the centres
    /// of the cells around it; cells outside have the prior's (section 3.3.2). In a planar
    /// grid z is ignored.
    #[must_use]
    pub fn log_odds_at(&self, point: DVec3) -> f64 {
        let place = (point - self.shape.min) / self.shape.cell - 0.5;
        let base = place.floor();
        let share = place - base;
        let base = base.to_array().map(|value| value as i64);
        let plane = |z: i64| {
            let row = |y: i64| {
                let (a, b) =
                    (self.cell_or_prior([base[0], y, z]), self.cell_or_prior([base[0] + 1, y, z]));
                a + share.x * (b - a)
            };
            let (a, b) = (row(base[1]), row(base[1] + 1));
            a + share.y * (b - a)
        };
        if self.shape.is_planar() {
            return plane(0);
        }
        let (a, b) = (plane(base[2]), plane(base[2] + 1));
        a + share.z * (b - a)
    }

    /// The map of the readings of both maps: the sum of their log-odds, less the prior's
    /// once, within ±[`LOG_ODDS_MAX`]. Readings in both maps count twice.
    ///
    /// # Errors
    /// [`MergeError`] unless both have the same shape and prior.
    pub fn merge(&self, other: &Self) -> Result<Self, MergeError> {
        if self.shape != other.shape {
            return Err(MergeError::Shape { ours: self.shape, theirs: other.shape });
        }
        if (self.prior - other.prior).abs() > 1e-9 {
            return Err(MergeError::Prior { ours: self.prior, theirs: other.prior });
        }
        let prior = logit(self.prior);
        let sum = |(a, b): (&f32, &f32)| {
            let sum = f64::from(*a) + f64::from(*b) - prior;
            sum.clamp(-LOG_ODDS_MAX, LOG_ODDS_MAX) as f32
        };
        let log_odds = self.log_odds.iter().zip(&other.log_odds).map(sum).collect();
        Ok(Self { log_odds, ..self.clone() })
    }

    fn cell_or_prior(&self, place: [i64; 3]) -> f64 {
        let [x, y, z] = place;
        let inside = place.iter().zip(self.shape.n).all(|(at, n)| (0..n as i64).contains(at));
        if !inside {
            return logit(self.prior);
        }
        let [nx, ny, _] = self.shape.n;
        f64::from(self.log_odds[(z as usize * ny + y as usize) * nx + x as usize])
    }
}

/// The inertia of the cells that are more likely occupied than free (section 3.4.2); `None`
/// when there are none.
#[must_use]
pub fn inertia(map: &OccupancyGrid) -> Option<Inertia> {
    let occupied = map.log_odds().iter().enumerate().filter(|(_, log_odds)| **log_odds > 0.0);
    Inertia::of_points(occupied.map(|(cell, _)| (map.shape().center(cell), 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::table::logistic;

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

    #[test]
    fn log_odds_are_interpolated_and_fade_to_the_prior() {
        let shape = GridShape::new(DVec3::ZERO, 1.0, [2, 2, 1]).unwrap();
        let prior = logistic(-1.0);
        let map = OccupancyGrid::from_parts(shape, prior, vec![0.0, 1.0, 2.0, 7.0]).unwrap();
        let at = |x, y| map.log_odds_at(DVec3::new(x, y, 33.0));
        assert!((at(0.5, 1.5) - 2.0).abs() < 1e-12);
        assert!((at(1.0, 1.0) - 2.5).abs() < 1e-12);
        // Half a cell outside, between the value 2 and the prior's −1.
        assert!((at(0.0, 1.5) - 0.5).abs() < 1e-6);
        assert!((at(-9.0, 1.5) + 1.0).abs() < 1e-6);
        let solid = GridShape::new(DVec3::ZERO, 1.0, [1, 1, 2]).unwrap();
        let map = OccupancyGrid::from_parts(solid, 0.5, vec![2.0, 4.0]).unwrap();
        assert!((map.log_odds_at(DVec3::new(0.5, 0.5, 0.75)) - 2.5).abs() < 1e-12);
    }

    #[test]
    fn maps_merge_by_adding_evidence_within_the_limit() {
        let shape = GridShape::new(DVec3::ZERO, 1.0, [2, 1, 1]).unwrap();
        let prior = logistic(-1.0);
        let map = |values| OccupancyGrid::from_parts(shape, prior, values).unwrap();
        // −1 is no evidence; 5 + 6 + 1 is above 8.
        let merged = map(vec![-1.0, 5.0]).merge(&map(vec![2.0, 6.0])).unwrap();
        assert!((merged.log_odds()[0] - 2.0).abs() < 1e-6);
        assert!((merged.log_odds()[1] - 8.0).abs() < 1e-6);
    }

    #[test]
    fn maps_of_other_shapes_or_priors_do_not_merge() {
        let map = |cell, prior| {
            let shape = GridShape::new(DVec3::ZERO, cell, [1, 1, 1]).unwrap();
            OccupancyGrid::from_parts(shape, prior, vec![0.0]).unwrap()
        };
        let error = map(1.0, 0.5).merge(&map(0.5, 0.5)).unwrap_err();
        assert!(error.to_string().contains("1 × 1 × 1 cells of 0.5 m from (0, 0, 0) m"), "{error}");
        assert!(matches!(map(1.0, 0.5).merge(&map(1.0, 0.4)), Err(MergeError::Prior { .. })));
    }

    #[test]
    fn spanning_grids_share_a_lattice() {
        let spanning = |low: f64| {
            let low = DVec3::new(low, -0.3, 0.0);
            GridShape::spanning(low, DVec3::new(2.2, 0.9, 5.0), 0.5, Some(1.0)).unwrap()
        };
        // x from −1 to 2.5, y from −0.5 to 1.
        assert_eq!(spanning(-0.7).n(), [7, 3, 1]);
        assert_eq!(spanning(-0.7).min(), DVec3::new(-1.0, -0.5, 1.0));
        assert_eq!(spanning(0.6).min(), DVec3::new(0.5, -0.5, 1.0));
    }

    #[test]
    fn occupied_cells_make_a_body() {
        let shape = GridShape::new(DVec3::ZERO, 1.0, [3, 1, 1]).unwrap();
        let map = OccupancyGrid::from_parts(shape, 0.5, vec![2.0, -1.0, 0.1]).unwrap();
        // Cells at x 0.5 and 2.5: centre 1.5, variance 1.
        let body = inertia(&map).unwrap();
        assert!(body.center.distance(DVec3::new(1.5, 0.5, 0.0)) < 1e-12);
        assert!((body.second_moment.x_axis.x - 1.0).abs() < 1e-12);
        let empty = OccupancyGrid::from_parts(shape, 0.5, vec![-1.0; 3]).unwrap();
        assert_eq!(inertia(&empty), None);
    }
}
