//! A mosaic prepared for look-up: pressure, its gradient and precision, four numbers per cell.
//!
//! Values lie at the cells' centres and are interpolated bilinearly. Beyond the mosaic and in
//! unmapped cells the expected pressure is 0, with a large deviation. Lengths in m, pressures
//! in Pa, in the object's plane.

use glam::Vec4;

use super::ForceMosaic;

/// The expectation of a mosaic at one position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Mean pressure, Pa.
    pub pressure: f32,
    /// Its derivative along the object's x, Pa/m.
    pub along_x: f32,
    /// Its derivative along the object's y, Pa/m.
    pub along_y: f32,
    /// One over the deviation of a single reading, 1/Pa.
    pub precision: f32,
}

/// The look-up form of a [`ForceMosaic`].
#[derive(Clone, Debug)]
pub struct Tile {
    origin: [f32; 2],
    per_cell: f32,
    n: [usize; 2],
    limit: [f32; 2],
    cells: Vec<Vec4>,
}

/// Deviation of a reading in unmapped cells, as a fraction of the mosaic's root mean square
/// pressure.
const UNKNOWN_SHARE: f32 = 1.0;

impl Tile {
    /// Prepares a mosaic. `reach` (m) widens the deviations by the bending of the pressure
    /// within that distance: 0 for exact positions, a bin's spread for coarse ones.
    #[must_use]
    pub fn new(mosaic: &ForceMosaic, reach: f64) -> Self {
        let [cols, rows, _] = mosaic.shape().n();
        // A ring of unmapped cells, so that clamping to the border means leaving the map.
        let n = [cols + 2, rows + 2];
        let cell = mosaic.shape().cell();
        let unknown = UNKNOWN_SHARE * root_mean_square(mosaic);
        let inside = |x: usize, y: usize| {
            let known = (1..=cols).contains(&x) && (1..=rows).contains(&y);
            known.then(|| x - 1 + cols * (y - 1))
        };
        let pressure = |x: usize, y: usize| match inside(x, y) {
            Some(at) if mosaic.deviation()[at].is_finite() => mosaic.pressure()[at],
            _ => 0.0,
        };
        let deviation = |x: usize, y: usize| match inside(x, y) {
            Some(at) if mosaic.deviation()[at].is_finite() => mosaic.deviation()[at],
            _ => unknown,
        };
        let (per_cell, bend) = ((1.0 / cell) as f32, (reach / cell).powi(2) as f32);
        let mut cells = Vec::with_capacity(n[0] * n[1]);
        for y in 0..n[1] {
            for x in 0..n[0] {
                let (west, east) = (x.saturating_sub(1), (x + 1).min(n[0] - 1));
                let (south, north) = (y.saturating_sub(1), (y + 1).min(n[1] - 1));
                let here = pressure(x, y);
                let [w, e] = [pressure(west, y), pressure(east, y)];
                let [s, n] = [pressure(x, south), pressure(x, north)];
                let curved = (w + e - 2.0 * here).hypot(s + n - 2.0 * here);
                let deviation = deviation(x, y).hypot(curved * bend);
                cells.push(Vec4::new(
                    here,
                    0.5 * (e - w) * per_cell,
                    0.5 * (n - s) * per_cell,
                    deviation.recip(),
                ));
            }
        }
        let min = mosaic.shape().min();
        // Centre of the ring's first cell.
        let origin = [(min.x - 0.5 * cell) as f32, (min.y - 0.5 * cell) as f32];
        let limit = n.map(|n| (n - 1) as f32 - 1e-3);
        Self { origin, per_cell, n, limit, cells }
    }

    /// Bytes of the tile of a mosaic.
    #[must_use]
    pub fn bytes_of(mosaic: &ForceMosaic) -> usize {
        let [cols, rows, _] = mosaic.shape().n();
        (cols + 2) * (rows + 2) * size_of::<Vec4>()
    }

    /// The expectation at (x, y), metres in the object's plane.
    #[must_use]
    pub fn at(&self, x: f32, y: f32) -> Expected {
        let [pressure, along_x, along_y, precision] = self.between(self.place(x, y)).to_array();
        Expected { pressure, along_x, along_y, precision }
    }

    /// Columns and rows from the first cell's centre, within the map.
    #[inline(always)]
    pub(super) fn place(&self, x: f32, y: f32) -> [f32; 2] {
        let within = |value: f32, limit: f32| {
            // Unlike f32::clamp, these two compile to one instruction each.
            let value = if value > 0.0 { value } else { 0.0 };
            if value < limit { value } else { limit }
        };
        [
            within((x - self.origin[0]) * self.per_cell, self.limit[0]),
            within((y - self.origin[1]) * self.per_cell, self.limit[1]),
        ]
    }

    /// Pressure, its derivatives along x and y, and precision at a [`Tile::place`].
    #[inline(always)]
    pub(super) fn between(&self, [along, up]: [f32; 2]) -> Vec4 {
        // Through i32, which is one instruction.
        let (col, row) = (along as i32, up as i32);
        let (fx, fy) = (along - col as f32, up - row as f32);
        let first = col as usize + row as usize * self.n[0];
        let window = &self.cells[first..first + self.n[0] + 2];
        let (a, b) = (window[0], window[1]);
        let (c, d) = (window[self.n[0]], window[self.n[0] + 1]);
        let low = a + fx * (b - a);
        let high = c + fx * (d - c);
        low + fy * (high - low)
    }
}

fn root_mean_square(mosaic: &ForceMosaic) -> f32 {
    let (mut sum, mut n) = (0.0f64, 0usize);
    for (pressure, deviation) in mosaic.pressure().iter().zip(mosaic.deviation()) {
        if deviation.is_finite() {
            sum += f64::from(*pressure).powi(2);
            n += 1;
        }
    }
    ((sum / n.max(1) as f64).sqrt() as f32).max(1.0)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::occupancy::GridShape;

    fn slope() -> ForceMosaic {
        // 4 × 3 cells of 1 mm from (−2, 0) mm; 1 kPa a mm along x, 100 Pa at the first cell.
        let shape = GridShape::new(DVec3::new(-0.002, 0.0, 0.0), 0.001, [4, 3, 1]).unwrap();
        let pressure = (0..12).map(|cell| 100.0 + 1_000.0 * (cell % 4) as f32).collect();
        ForceMosaic::from_parts(shape, pressure, vec![50.0; 12]).unwrap()
    }

    #[test]
    fn values_between_cells_are_interpolated() {
        let tile = Tile::new(&slope(), 0.0);
        // Centres at −1.5, −0.5, 0.5, 1.5 mm: −0.25 mm is a quarter on from the second.
        let found = tile.at(-0.000_25, 0.001_5);
        assert!((found.pressure - 1_350.0).abs() < 0.5, "{found:?}");
        assert!((found.along_x / 1e6 - 1.0).abs() < 1e-3 && found.along_y.abs() < 1.0);
        assert!((found.precision - 0.02).abs() < 1e-5);
    }

    #[test]
    fn outside_the_expected_pressure_is_zero_and_uncertain() {
        let found = Tile::new(&slope(), 0.0).at(0.5, -0.5);
        assert!(found.pressure.abs() < 5.0);
        assert!(found.precision < 1.0 / 1_000.0);
    }
}
