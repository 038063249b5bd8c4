//! The inscribed circle of an image, the part that a rotation about the centre preserves.
//!
//! Source: section 4.3.2.4. Positions are in taxels about the centre, x along the columns, y
//! along the rows. An image that is not square loses everything beyond its shorter side.

/// The inscribed circle of images of one shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Disc {
    pub(super) rows: usize,
    pub(super) cols: usize,
}

/// A taxel within the circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DiscTaxel {
    /// Its index in a row-major image.
    pub(super) taxel: usize,
    /// Taxels to the right of the image centre.
    pub(super) x: f64,
    /// Taxels below the image centre.
    pub(super) y: f64,
}

impl Disc {
    /// D: the shorter side, taxels.
    pub(super) fn diameter(self) -> usize {
        self.rows.min(self.cols)
    }

    /// The image centre as (row, column).
    pub(super) fn center(self) -> (f64, f64) {
        ((self.rows as f64 - 1.0) / 2.0, (self.cols as f64 - 1.0) / 2.0)
    }

    /// The position (x, y) of a taxel about the centre.
    pub(super) fn about_center(self, row: usize, col: usize) -> (f64, f64) {
        let (center_row, center_col) = self.center();
        (col as f64 - center_col, row as f64 - center_row)
    }

    /// True when a taxel's centre lies within the circle.
    pub(super) fn contains(self, row: usize, col: usize) -> bool {
        let (x, y) = self.about_center(row, col);
        let radius = self.diameter() as f64 / 2.0;
        x * x + y * y <= radius * radius
    }

    /// The taxels within the circle, row-major.
    pub(super) fn taxels(self) -> Vec<DiscTaxel> {
        let all = (0..self.rows).flat_map(|row| (0..self.cols).map(move |col| (row, col)));
        all.filter(|(row, col)| self.contains(*row, *col))
            .map(|(row, col)| {
                let (x, y) = self.about_center(row, col);
                DiscTaxel { taxel: row * self.cols + col, x, y }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(disc: Disc, drawn: &[&str]) {
        let line = |row| {
            let mark = |col| if disc.contains(row, col) { '#' } else { '.' };
            (0..disc.cols).map(mark).collect::<String>()
        };
        assert_eq!((0..disc.rows).map(line).collect::<Vec<_>>(), drawn);
    }

    #[test]
    fn only_the_corners_of_6x6_lie_outside() {
        // A corner is 2.5·√2 = 3.54 from the centre, its neighbour √(2.5² + 1.5²) = 2.92.
        check(
            Disc { rows: 6, cols: 6 },
            &[".####.", "######", "######", "######", "######", ".####."],
        );
    }

    #[test]
    fn an_elongated_image_keeps_its_middle() {
        check(Disc { rows: 3, cols: 6 }, &["..##..", ".####.", "..##.."]);
    }
}
