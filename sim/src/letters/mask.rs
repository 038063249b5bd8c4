//! A letter on a grid: the covered fraction of every cell.
//!
//! Cells are squares in the letter's frame, x fastest, then y upwards.

use glam::DVec2;

use super::{Letter, edges};

/// Scan lines per row of cells; along x the coverage is exact.
const LINES_PER_ROW: usize = 4;

/// The coverage of a grid of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    cell: f64,
    cols: usize,
    rows: usize,
    coverage: Vec<f32>,
}

impl Letter {
    /// The letter on cells of side `cell` (metres), with a margin of at least `margin` metres
    /// around it. The grid is centred on the letter's origin.
    ///
    /// # Panics
    /// When `cell` is not positive or `margin` negative.
    #[must_use]
    pub fn mask(&self, cell: f64, margin: f64) -> Mask {
        assert!(cell > 0.0 && margin >= 0.0, "cell {cell} m and margin {margin} m draw no mask");
        let half = self.half_size + DVec2::splat(margin);
        let count = |half: f64| 2 * (half / cell).ceil() as usize;
        let (cols, rows) = (count(half.x), count(half.y));
        let mut mask = Mask { cell, cols, rows, coverage: vec![0.0; cols * rows] };
        let min = mask.min();
        let mut crossings = Vec::new();
        for line in 0..rows * LINES_PER_ROW {
            let y = min.y + (line as f64 + 0.5) * cell / LINES_PER_ROW as f64;
            self.crossings(y, &mut crossings);
            let row = &mut mask.coverage[line / LINES_PER_ROW * cols..][..cols];
            for span in crossings.chunks_exact(2) {
                let (from, to) = ((span[0] - min.x) / cell, (span[1] - min.x) / cell);
                let last = (to.ceil() as usize).min(cols);
                for (col, covered) in row.iter_mut().enumerate().take(last).skip(from as usize) {
                    let length = to.min(col as f64 + 1.0) - from.max(col as f64);
                    *covered += (length / LINES_PER_ROW as f64) as f32;
                }
            }
        }
        mask
    }

    /// Crossings of a horizontal line at `y` with the contours, from left to right, metres.
    fn crossings(&self, y: f64, found: &mut Vec<f64>) {
        found.clear();
        found.extend(self.contours().flat_map(edges).filter_map(|(from, to)| {
            let level = (from.y > y) != (to.y > y);
            level.then(|| from.x + (y - from.y) / (to.y - from.y) * (to.x - from.x))
        }));
        found.sort_unstable_by(f64::total_cmp);
    }
}

impl Mask {
    /// A cell's side, metres.
    #[must_use]
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Cells along x and along y.
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        (self.cols, self.rows)
    }

    /// The covered fraction of each cell, 0 to 1; x fastest, then y upwards.
    #[must_use]
    pub fn coverage(&self) -> &[f32] {
        &self.coverage
    }

    /// The corner with the smallest coordinates, metres.
    #[must_use]
    pub fn min(&self) -> DVec2 {
        -0.5 * self.cell * DVec2::new(self.cols as f64, self.rows as f64)
    }

    /// The centre of a cell, metres.
    #[must_use]
    pub fn center(&self, cell: usize) -> DVec2 {
        let place = DVec2::new((cell % self.cols) as f64 + 0.5, (cell / self.cols) as f64 + 0.5);
        self.min() + self.cell * place
    }

    /// Whether at least half of the cell around a point (metres) is covered; false outside
    /// the grid.
    #[must_use]
    pub fn is_covered(&self, at: DVec2) -> bool {
        let place = (at - self.min()) / self.cell;
        let inside =
            place.min_element() >= 0.0 && place.x < self.cols as f64 && place.y < self.rows as f64;
        inside && self.coverage[place.y as usize * self.cols + place.x as usize] >= 0.5
    }

    /// The centres of the cells that are at least half covered, metres.
    pub fn covered(&self) -> impl Iterator<Item = DVec2> + '_ {
        let covered = self.coverage.iter().enumerate().filter(|(_, covered)| **covered >= 0.5);
        covered.map(|(cell, _)| self.center(cell))
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::units::MM;

    use super::*;
    use crate::letters::Font;

    #[test]
    fn a_mask_covers_the_letters_area() {
        for letter in Font::built_in().letters() {
            let mask = letter.mask(0.25 * MM, 1.0 * MM);
            let area: f64 = mask.coverage().iter().map(|c| f64::from(*c) * 0.0625e-6).sum();
            assert!((area / letter.area() - 1.0).abs() < 0.005, "{}: {area}", letter.symbol());
        }
    }

    #[test]
    fn a_mask_and_the_outline_agree_on_points() {
        let font = Font::built_in();
        let letter = font.letter('B').unwrap();
        let mask = letter.mask(0.1 * MM, 2.0 * MM);
        let n = mask.coverage().len();
        let agree = (0..n)
            .map(|cell| mask.center(cell))
            .filter(|at| letter.contains(at.x, at.y) == mask.is_covered(*at));
        assert!(agree.count() as f64 / n as f64 > 0.995);
        assert!(!mask.is_covered(DVec2::splat(1.0)) && !mask.is_covered(DVec2::splat(-1.0)));
    }
}
