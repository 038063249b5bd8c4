//! A letter as a blurred field: the response at every place on it, drawn once.
//!
//! Blur commutes with rigid motion, so the mask and its first moments are blurred in the
//! letter's frame, and every press, tilted a little or not, is a bilinear look-up. The
//! taxel's mean is folded into the point spread by its variance (width² / 12), which makes it
//! round.

use palpate_core::sensor::SensorDescription;
use palpate_core::sensor::point_spread::gaussian_kernel;
use palpate_core::units::MM;

use crate::letters::Letter;

/// Side of a cell, metres; a third of a placement error, a tenth of the spread.
const CELL: f64 = 0.25 * MM;

/// Margin drawn around the letter, in point spreads; the response beyond it is 0.
const REACH: f64 = 4.0;

/// The blurred mask of a letter and its moments along x and y.
#[derive(Clone, Debug, PartialEq)]
pub struct LetterField {
    symbol: char,
    /// Position of the first value, metres.
    first: (f64, f64),
    cols: usize,
    rows: usize,
    /// Blurred mask (1 where the face fills the blur), mask · x and mask · y (metres); x
    /// fastest, then y upwards.
    values: Vec<[f32; 3]>,
}

impl LetterField {
    /// The field of a letter under a sensor's covering.
    #[must_use]
    pub fn new(letter: &Letter, sensor: &SensorDescription) -> Self {
        let taxel_variance = sensor.grid().taxel_width.powi(2) / 12.0;
        let spread = (sensor.parameters().point_spread.powi(2) + taxel_variance).sqrt();
        let mask = letter.mask(CELL, REACH * spread);
        let (cols, rows) = mask.shape();
        let kernel: Vec<f32> =
            gaussian_kernel(spread, CELL).into_iter().map(|weight| weight as f32).collect();
        let values: Vec<[f32; 3]> = mask
            .coverage()
            .iter()
            .enumerate()
            .map(|(cell, covered)| {
                let at = mask.center(cell);
                [*covered, covered * at.x as f32, covered * at.y as f32]
            })
            .collect();
        // Along rows, turned, along columns, turned back.
        let values = blurred_and_turned(&values, cols, &kernel);
        let values = blurred_and_turned(&values, rows, &kernel);
        let first = mask.center(0);
        Self { symbol: letter.symbol(), first: (first.x, first.y), cols, rows, values }
    }

    /// The letter's character.
    #[must_use]
    pub fn symbol(&self) -> char {
        self.symbol
    }

    /// At a place of the letter's frame (metres): the fraction of the point spread that its
    /// face fills, and that fraction's moments along x and y (metres).
    #[must_use]
    pub fn at(&self, x: f64, y: f64) -> [f64; 3] {
        let (col, row) = ((x - self.first.0) / CELL, (y - self.first.1) / CELL);
        let inside = col >= 0.0
            && row >= 0.0
            && col < (self.cols - 1) as f64
            && row < (self.rows - 1) as f64;
        if !inside {
            return [0.0; 3];
        }
        let (left, low) = (col as usize, row as usize);
        let (to_right, up) = (col - left as f64, row - low as f64);
        let corner = low * self.cols + left;
        let [a, b] = [self.values[corner], self.values[corner + 1]];
        let [c, d] = [self.values[corner + self.cols], self.values[corner + self.cols + 1]];
        std::array::from_fn(|moment| {
            let [a, b, c, d] = [a, b, c, d].map(|corner| f64::from(corner[moment]));
            let (below, above) = (a + to_right * (b - a), c + to_right * (d - c));
            below + up * (above - below)
        })
    }
}

/// Rows of `cols` values, blurred along the row, written as columns.
fn blurred_and_turned(values: &[[f32; 3]], cols: usize, kernel: &[f32]) -> Vec<[f32; 3]> {
    let (rows, radius) = (values.len() / cols, kernel.len() / 2);
    let mut turned = vec![[0.0; 3]; values.len()];
    for (row, line) in values.chunks_exact(cols).enumerate() {
        for col in 0..cols {
            let from = col.saturating_sub(radius);
            let to = (col + radius + 1).min(cols);
            let weights = &kernel[from + radius - col..];
            let mut sum = [0.0f32; 3];
            for (value, weight) in line[from..to].iter().zip(weights) {
                for moment in 0..3 {
                    sum[moment] += weight * value[moment];
                }
            }
            turned[col * rows + row] = sum;
        }
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::Font;
    use crate::rig::rig_sensor;

    #[test]
    fn a_field_is_the_letter_under_the_point_spread() {
        // Oracle: the sum over the letter's own cells, straight from the definition.
        let font = Font::built_in();
        let letter = font.letter('A').unwrap();
        let field = LetterField::new(letter, &rig_sensor());
        let spread = ((2.725 * MM).powi(2) + (1.8 * MM).powi(2) / 12.0).sqrt();
        let step = 0.1 * MM;
        for (x, y) in [(0.0, 0.0), (3.3 * MM, -7.1 * MM), (-8.0 * MM, -12.0 * MM)] {
            let mut expected = [0.0; 3];
            for i in -150..=150 {
                for j in -150..=150 {
                    let (u, v) = (x + f64::from(i) * step, y + f64::from(j) * step);
                    let squared = (u - x).powi(2) + (v - y).powi(2);
                    if letter.contains(u, v) {
                        let area = step * step / (std::f64::consts::TAU * spread * spread);
                        let weight = area * (-0.5 * squared / (spread * spread)).exp();
                        expected[0] += weight;
                        expected[1] += weight * u;
                        expected[2] += weight * v;
                    }
                }
            }
            let found = field.at(x, y);
            // The kernel ends at three spreads: 0.5 % of its weight is beyond.
            assert!((found[0] - expected[0]).abs() < 0.006, "{found:?} for {expected:?}");
            for moment in 1..3 {
                let off = (found[moment] - expected[moment]).abs();
                assert!(off < 0.08 * MM, "{found:?} for {expected:?}");
            }
        }
        assert_eq!(field.at(1.0, 0.0).map(f64::to_bits), [0; 3]);
    }
}
