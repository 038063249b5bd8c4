//! Exhaustive: the best match of a part of one image anywhere in another, at any angle.
//!
//! Source: section 5.3.3. A comparator, not a descriptor: an upper bound for features that
//! ignore rotation and translation. Its correlation is the cosine, as in 2.3.

use super::disc::Disc;
use super::sample::Sample;
use crate::reading::TactileImage;

/// Number of angles of the part.
const N_TURNS: usize = 16;

/// The comparator for images of one shape.
#[derive(Clone, Debug)]
pub struct Exhaustive {
    disc: Disc,
    /// Taxels along a side of the compared part.
    side: usize,
    /// Sample positions of the turned parts: turn-major, then row-major.
    samples: Vec<Sample>,
}

impl Exhaustive {
    /// Plans for images of `rows` × `cols` taxels. The compared part is the middle square of
    /// two thirds of the shorter side: 4 × 4 of 6 × 6.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        let disc = Disc { rows, cols };
        let side = ((2 * disc.diameter() + 1) / 3).max(1);
        let (center_row, center_col) = disc.center();
        let inside =
            |row: i64, col: i64| (0..rows as i64).contains(&row) && (0..cols as i64).contains(&col);
        let middle = (side as f64 - 1.0) / 2.0;
        let sample = |n: usize| {
            let (turn, taxel) = (n / (side * side), n % (side * side));
            let (x, y) = ((taxel % side) as f64 - middle, (taxel / side) as f64 - middle);
            let (sin, cos) = (std::f64::consts::TAU * turn as f64 / N_TURNS as f64).sin_cos();
            let (row, col) = (center_row + sin * x + cos * y, center_col + cos * x - sin * y);
            Sample::bilinear(row, col, cols, inside)
        };
        let samples = (0..N_TURNS * side * side).map(sample).collect();
        Self { disc, side, samples }
    }

    /// The largest cosine of the middle of `a`, turned, and a part of `b`: −1 to 1, not
    /// symmetric, 0 when either is empty.
    ///
    /// # Panics
    /// When an image does not have the planned shape.
    #[must_use]
    pub fn similarity(&self, a: &TactileImage, b: &TactileImage) -> f64 {
        let Disc { rows, cols } = self.disc;
        let fits = [a, b].iter().all(|image| (image.rows, image.cols) == (rows, cols));
        assert!(fits, "both images are {rows} × {cols} taxels, as planned");
        let turned: Vec<f64> = self.samples.iter().map(|sample| sample.of(&a.pressures)).collect();
        let parts = turned.chunks_exact(self.side * self.side);
        let norms: Vec<f64> = parts.clone().map(|part| dot(part, part).sqrt()).collect();
        let mut window = vec![0.0; self.side * self.side];
        let mut best: Option<f64> = None;
        for row in 0..=rows - self.side {
            for col in 0..=cols - self.side {
                for (line, place) in window.chunks_exact_mut(self.side).enumerate() {
                    let start = (row + line) * cols + col;
                    place.copy_from_slice(&b.pressures[start..start + self.side]);
                }
                let norm = dot(&window, &window).sqrt();
                for (part, part_norm) in parts.clone().zip(&norms) {
                    if part_norm * norm > 0.0 {
                        let cosine = dot(part, &window) / (part_norm * norm);
                        best = Some(best.map_or(cosine, |best| best.max(cosine)));
                    }
                }
            }
        }
        best.unwrap_or(0.0).clamp(-1.0, 1.0)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::test_support::{any_image, blob, quarter_turned};
    use crate::descriptor::{DescriptorKind, affinity};

    #[test]
    fn the_part_is_4x4_of_6x6_and_there_is_one_in_every_image() {
        let side = |rows, cols| Exhaustive::new(rows, cols).side;
        assert_eq!((side(6, 6), side(6, 8), side(26, 30), side(2, 2)), (4, 4, 17, 1));
    }

    #[test]
    fn an_empty_image_has_similarity_zero() {
        let empty = TactileImage { rows: 6, cols: 6, pressures: vec![0.0; 36] };
        let similarity = Exhaustive::new(6, 6).similarity(&empty, &blob(6, 0.0, 0.0, 0.0));
        assert!(similarity.abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn an_image_is_similar_to_itself_turned_and_moved(image in any_image(6, 6), quarters in 0..4) {
            let turned = (0..quarters).fold(image.clone(), |image, _| quarter_turned(&image));
            let plan = Exhaustive::new(6, 6);
            prop_assert!(plan.similarity(&image, &turned) > 1.0 - 1e-12);
            // Moved by one taxel: the last column of pressures comes first.
            let mut moved = turned.clone();
            moved.pressures.rotate_right(1);
            prop_assert!(plan.similarity(&image, &moved) > 1.0 - 1e-12);
        }

        #[test]
        fn no_descriptor_is_more_similar_for_a_moved_image(angle in -3.0..3.0_f64, dx in 0.5..1.0_f64) {
            let (a, b) = (blob(14, 0.0, 0.0, 0.0), blob(14, angle, dx, 0.0));
            let exhaustive = Exhaustive::new(14, 14).similarity(&a, &b);
            let vector = |image| DescriptorKind::MomentNormalized.describe(image).row(0).to_vec();
            prop_assert!(exhaustive > affinity(&vector(&a), &vector(&b)));
        }
    }
}
