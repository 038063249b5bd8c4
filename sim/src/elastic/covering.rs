//! A covering of the elastic reference on a sensor: images by superposition.
//!
//! The response to a point load, scaled to the covering's thickness (linear elasticity has no
//! length scale of its own), is the kernel of the indentation profile: every displaced point
//! of the surface acts as a load of its depth. Lengths in metres in the sensor frame; images
//! row-major, in metres of blurred displacement, as those of `press`.

use palpate_core::sensor::TaxelGrid;
use palpate_core::units::MM;

use super::PointResponse;

/// Spacing of the table, metres.
const TABLE_STEP: f64 = 0.1 * MM;
/// Points along each side of a taxel over which the kernel is averaged.
const MEAN_POINTS: usize = 9;

/// One point of an indentation profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfilePoint {
    /// Position, (x, y).
    pub at: (f64, f64),
    /// Depth (m) times the area (m²) that the point represents.
    pub volume: f64,
}

/// The kernel averaged over a taxel, by the distance of the load from the taxel's centre.
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticCovering {
    /// Row-major over distances x, y ≥ 0, `side`² of them; 1/m².
    table: Vec<f64>,
    side: usize,
}

impl ElasticCovering {
    /// The covering of `thickness` (m), from the response of a slab of any number of layers,
    /// for taxels of `taxel_width` (m).
    #[must_use]
    pub fn new(response: &PointResponse, thickness: f64, taxel_width: f64) -> Self {
        let element = thickness / response.n_layers() as f64;
        let reach = response.half_width() as f64 * element + taxel_width;
        let side = (reach / TABLE_STEP).ceil() as usize + 2;
        let offset = |k: usize| ((k as f64 + 0.5) / MEAN_POINTS as f64 - 0.5) * taxel_width;
        let average = |index: usize| {
            let (x, y) = ((index % side) as f64 * TABLE_STEP, (index / side) as f64 * TABLE_STEP);
            let mut sum = 0.0;
            for v in 0..MEAN_POINTS {
                for u in 0..MEAN_POINTS {
                    sum += density(response, element, x + offset(u), y + offset(v));
                }
            }
            sum / (MEAN_POINTS * MEAN_POINTS) as f64
        };
        Self { table: (0..side * side).map(average).collect(), side }
    }

    /// The image of an indentation profile.
    #[must_use]
    pub fn image(&self, grid: &TaxelGrid, profile: &[ProfilePoint]) -> Vec<f64> {
        let taxel = |taxel: usize| {
            let (x, y) = grid.center(taxel / grid.cols, taxel % grid.cols);
            let felt =
                |point: &ProfilePoint| self.at(x - point.at.0, y - point.at.1) * point.volume;
            profile.iter().map(felt).sum()
        };
        (0..grid.n_taxels()).map(taxel).collect()
    }

    /// Bilinear interpolation in the table; 0 beyond it.
    fn at(&self, x: f64, y: f64) -> f64 {
        let (x, y) = (x.abs() / TABLE_STEP, y.abs() / TABLE_STEP);
        let (col, row) = (x as usize, y as usize);
        if col.max(row) + 1 >= self.side {
            return 0.0;
        }
        let value = |dx: usize, dy: usize| self.table[(row + dy) * self.side + col + dx];
        bilinear(value, x - col as f64, y - row as f64)
    }
}

/// Force per area (1/m² for unit load) at (x, y), bilinear between the bottom's nodes.
fn density(response: &PointResponse, element: f64, x: f64, y: f64) -> f64 {
    let (x, y) = (x / element, y / element);
    let (col, row) = (x.floor(), y.floor());
    let value =
        |dx: usize, dy: usize| response.force(col as i64 + dx as i64, row as i64 + dy as i64);
    bilinear(value, x - col, y - row) / (element * element)
}

fn bilinear(value: impl Fn(usize, usize) -> f64, x: f64, y: f64) -> f64 {
    let row = |dy: usize| value(0, dy) * (1.0 - x) + value(1, dy) * x;
    row(0) * (1.0 - y) + row(1) * y
}

/// Points of a disc pressed evenly `depth` deep.
#[must_use]
pub fn disc(at: (f64, f64), diameter: f64, depth: f64) -> Vec<ProfilePoint> {
    let n = 12;
    let step = diameter / f64::from(n);
    let place = |index: i32| (f64::from(index) + 0.5) * step - 0.5 * diameter;
    let points = (0..n).flat_map(|v| (0..n).map(move |u| (place(u), place(v))));
    let inside = points.filter(|(u, v)| u * u + v * v <= 0.25 * diameter * diameter);
    let volume = depth * step * step;
    inside.map(|(u, v)| ProfilePoint { at: (at.0 + u, at.1 + v), volume }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elastic::{POISSON_RATIO, Slab, point_response};

    #[test]
    fn a_uniform_displacement_is_preserved() {
        // A profile 1 mm deep, 30 mm wide: the kernel's integral is the load, 1.
        let slab = Slab { half_width: 12, n_layers: 3, poisson_ratio: POISSON_RATIO };
        let response = point_response(&slab).unwrap();
        let covering = ElasticCovering::new(&response, 1.0 * MM, 1.8 * MM);
        let grid = TaxelGrid { rows: 2, cols: 2, pitch: 2.0 * MM, taxel_width: 1.8 * MM };
        let side = |index: i32| f64::from(index) * 0.1 * MM;
        let square = (-150..=150).flat_map(|v| (-150..=150).map(move |u| (side(u), side(v))));
        let volume = 1.0 * MM * (0.1 * MM).powi(2);
        let profile: Vec<ProfilePoint> = square.map(|at| ProfilePoint { at, volume }).collect();
        for value in covering.image(&grid, &profile) {
            assert!((value / MM - 1.0).abs() < 0.01, "{value}");
        }
    }

    #[test]
    fn a_disc_profile_has_the_discs_volume() {
        let points = disc((0.0, 0.0), 1.0 * MM, 0.5 * MM);
        let volume: f64 = points.iter().map(|point| point.volume).sum();
        let expected = std::f64::consts::PI * (0.5 * MM).powi(2) * 0.5 * MM;
        assert!((volume / expected - 1.0).abs() < 0.03, "{}", volume / expected);
    }
}
