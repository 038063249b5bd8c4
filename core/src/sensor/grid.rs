//! A rectangular grid of taxels: the short form of a layout, and the shape of every image.

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
