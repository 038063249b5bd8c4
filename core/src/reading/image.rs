//! Tactile images: pressures on a grid, their shape as a driver sends them, and missing values.

use std::fmt;

use crate::sensor::SensorDescription;

/// A tactile image: pressures in pascal, row-major, every taxel with a finite value.
#[derive(Clone, Debug, PartialEq)]
pub struct TactileImage {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// `rows` × `cols` pressures, Pa.
    pub pressures: Vec<f64>,
}

impl TactileImage {
    /// The pressure of one taxel, Pa.
    #[must_use]
    pub fn at(&self, row: usize, col: usize) -> f64 {
        self.pressures[row * self.cols + col]
    }

    /// The largest pressure, Pa; 0 for an image that is nowhere positive.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.pressures.iter().copied().fold(0.0, f64::max)
    }
}

/// Shape of a sensor's images as its driver sends them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageShape {
    /// Rows of values.
    Grid {
        /// Number of rows.
        rows: usize,
        /// Number of columns.
        cols: usize,
    },
    /// A value for each taxel of a layout.
    Listed,
}

impl ImageShape {
    pub(super) fn of(description: &SensorDescription) -> Self {
        let grid = description.grid();
        match description.listed() {
            Some(_) => Self::Listed,
            None => Self::Grid { rows: grid.rows, cols: grid.cols },
        }
    }
}

impl fmt::Display for ImageShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Grid { rows, cols } => write!(f, "{rows} rows × {cols} columns"),
            Self::Listed => f.write_str("one for each taxel of the layout, in its order"),
        }
    }
}

/// The image with each missing value as the mean of its valid neighbours, nearest ring first.
pub(super) fn fill_missing(ordered: &[Option<f64>], rows: usize, cols: usize) -> Vec<f64> {
    let at = |row: usize, col: usize| ordered[row * cols + col];
    let ring_mean = |row: usize, col: usize, radius: usize| {
        let (mut sum, mut n) = (0.0, 0usize);
        for r in row.saturating_sub(radius)..=(row + radius).min(rows - 1) {
            for c in col.saturating_sub(radius)..=(col + radius).min(cols - 1) {
                if let Some(pressure) = at(r, c) {
                    sum += pressure;
                    n += 1;
                }
            }
        }
        (n > 0).then(|| sum / n as f64)
    };
    let nearest = |row, col| {
        (1..rows.max(cols)).find_map(|radius| ring_mean(row, col, radius)).unwrap_or(0.0)
    };
    (0..rows * cols)
        .map(|taxel| ordered[taxel].unwrap_or_else(|| nearest(taxel / cols, taxel % cols)))
        .collect()
}
