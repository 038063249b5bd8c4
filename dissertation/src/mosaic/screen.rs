//! Fast screening of a press on a mosaic: amplitude alone, nearest cells, one sum per taxel.
//!
//! It ranks thousands of coarse bins before the best are fitted properly. Slips count as
//! independent noise in proportion to the pressure's slope, so it overstates differences.

use glam::Vec4;

use super::ForceMosaic;
use super::press_fit::Press;
use super::tile::Tile;

/// The smallest magnitude from which an f32 has no fraction.
const WHOLE: f32 = 8_388_608.0;

/// Width of the border around the mosaic, in cells, where no pressure is expected.
const MARGIN: f64 = 2.0;

/// Cells of a tile along x and y.
fn counts(mosaic: &ForceMosaic, cell: f64) -> [usize; 2] {
    let [cols, rows, _] = mosaic.shape().n();
    let side = |n: usize| n as f64 * mosaic.shape().cell() + 2.0 * MARGIN * cell;
    [cols, rows].map(|n| (side(n) / cell).ceil() as usize)
}

/// The screening form of a [`ForceMosaic`].
#[derive(Clone, Debug)]
pub struct ScreenTile {
    origin: [f32; 2],
    per_cell: f32,
    limit: [f32; 2],
    cols: usize,
    /// Precision² p, p·f, p·f² and ln p / 2, with p in 1/Pa² and f in Pa.
    cells: Vec<Vec4>,
}

/// A press rotated into the axes of an object at one angle, in cells.
#[derive(Clone, Debug, Default)]
pub struct TurnedPress {
    offsets: [Vec<f32>; 2],
    /// z², z, 1, 1.
    factors: Vec<Vec4>,
    cells: Vec<u32>,
}

impl ScreenTile {
    /// Resamples a mosaic to cells of `cell` m; `reach` (m) is the largest position error.
    #[must_use]
    pub fn new(mosaic: &ForceMosaic, cell: f64, reach: f64) -> Self {
        let tile = Tile::new(mosaic, reach);
        let (shape, margin) = (mosaic.shape(), MARGIN * cell);
        let [cols, rows] = counts(mosaic, cell);
        let first = [shape.min().x - margin, shape.min().y - margin];
        let mut cells = Vec::with_capacity(cols * rows);
        for y in 0..rows {
            for x in 0..cols {
                let at = |index: usize, axis: usize| first[axis] + (index as f64 + 0.5) * cell;
                let expected = tile.at(at(x, 0) as f32, at(y, 1) as f32);
                let slope = expected.along_x.hypot(expected.along_y) * reach as f32;
                let precision = (expected.precision.powi(-2) + slope * slope).recip();
                let pressure = expected.pressure;
                let weighed = precision * pressure;
                let log = 0.5 * precision.ln();
                cells.push(Vec4::new(precision, weighed, weighed * pressure, log));
            }
        }
        // The first cell's centre.
        let origin = first.map(|first| (first + 0.5 * cell) as f32);
        let per_cell = (1.0 / cell) as f32;
        let limit = [cols, rows].map(|n| n as f32 - 1.0);
        Self { origin, per_cell, limit, cols, cells }
    }

    /// Bytes of the tile of a mosaic on cells of `cell` m.
    #[must_use]
    pub fn bytes_of(mosaic: &ForceMosaic, cell: f64) -> usize {
        counts(mosaic, cell).iter().product::<usize>() * size_of::<Vec4>()
    }

    /// ln of the density of the press at `center`, with an amplitude of 1 ± `amplitude`.
    #[must_use]
    pub fn log_likelihood(
        &self,
        turned: &mut TurnedPress,
        center: [f64; 2],
        amplitude: f32,
    ) -> f64 {
        let [x, y] = [0, 1].map(|axis: usize| center[axis] as f32 - self.origin[axis]);
        let (x, y) = (x * self.per_cell, y * self.per_cell);
        let n = turned.factors.len();
        let (along, up) = (&turned.offsets[0][..n], &turned.offsets[1][..n]);
        let cells = &mut turned.cells[..n];
        let (cols, limit) = (self.cols as f32, self.limit);
        let within = |value: f32, limit: f32| {
            let value = if value > 0.0 { value } else { 0.0 };
            if value < limit { value } else { limit }
        };
        for taxel in 0..n {
            // Adding 2²³ leaves no room for a fraction: this rounds without a conversion,
            // which keeps the loop in vector registers. Exact, since there are fewer than 2²³
            // cells.
            let col = within(x + along[taxel] * self.per_cell, limit[0]) + WHOLE - WHOLE;
            let row = within(y + up[taxel] * self.per_cell, limit[1]) + WHOLE - WHOLE;
            cells[taxel] = (row * cols + col + WHOLE).to_bits() & 0x7f_ffff;
        }
        let mut sums = [Vec4::ZERO; 2];
        for (pair, factors) in cells.chunks(2).zip(turned.factors.chunks(2)) {
            for (lane, (cell, factor)) in pair.iter().zip(factors).enumerate() {
                sums[lane] += self.cells[*cell as usize] * *factor;
            }
        }
        let [square, cross, expected, log] = (sums[0] + sums[1]).to_array();
        // a ~ N(1, s²): k = Σ p f² + 1/s², b = Σ p f z + 1/s².
        let prior = amplitude.powi(-2);
        let (k, b) = (expected + prior, cross + prior);
        let left = square + prior - b * b / k;
        f64::from(log - 0.5 * left) - 0.5 * f64::from(k / prior).ln()
    }
}

impl TurnedPress {
    /// Rotates a press by the angle of this cosine and sine.
    pub fn turn(&mut self, press: &Press, turn: [f64; 2]) {
        let [cos, sin] = turn.map(|value| value as f32);
        let n = press.offsets.len();
        self.offsets.iter_mut().for_each(|axis| axis.resize(n, 0.0));
        self.cells.resize(n, 0);
        self.factors.clear();
        self.factors.extend(press.pressures.iter().map(|z| Vec4::new(z * z, *z, 1.0, 1.0)));
        for (taxel, [x, y]) in press.offsets.iter().enumerate() {
            self.offsets[0][taxel] = cos * x - sin * y;
            self.offsets[1][taxel] = sin * x + cos * y;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::mosaic::press_fit::Placement;
    use crate::occupancy::GridShape;
    use palpate_core::units::MM;

    #[test]
    fn a_press_of_two_taxels_matches_hand_computed_values() {
        // One cell of 1 mm and 1 kPa at (0.5, 0.5) mm, known to 100 Pa; the rest is unmapped.
        let shape = GridShape::new(DVec3::ZERO, 4.0 * MM, [3, 3, 1]).unwrap();
        let mosaic = ForceMosaic::from_parts(shape, vec![1_000.0; 9], vec![100.0; 9]).unwrap();
        let tile = ScreenTile::new(&mosaic, 1.0 * MM, 0.0);
        let offsets = vec![[-1e-3, 0.0], [1e-3, 0.0]];
        let press = Press { offsets, pressures: vec![1_100.0, 1_100.0], gain_deviation: 0.0 };
        let place = Placement { center: [0.006, 0.006], turn: [1.0, 0.0] };
        let mut turned = TurnedPress::default();
        turned.turn(&press, place.turn);
        let found = tile.log_likelihood(&mut turned, place.center, 0.1);
        // Amplitude 0.1 off: Σ p f² = 200, 1/s² = 100, Σ p f z = 220, Σ p z² = 242.
        // left = 242 + 100 − 320²/300 = 0.6667; ln p = −9.2103 twice, halved; − ½ ln 3.
        let expected = -9.210_34 - 0.5 * 0.666_67 - 0.5 * 3.0_f64.ln();
        assert!((found - expected).abs() < 1e-2, "{found} for {expected}");
    }
}
