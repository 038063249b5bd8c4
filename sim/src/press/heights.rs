//! The z-buffer: the height of the object's nearest surface above every point of the covering.
//!
//! Heights are z in the sensor frame, metres: negative where the object is in the covering.
//! Moving along z only shifts them, so one drawing serves a whole approach or press.

use glam::DVec3;
use palpate_core::pose::Pose;

use super::HOUSING_DEPTH;
use super::bvh::{Bvh, SensorBox};
use super::imaging::Imaging;

/// The height of the surface above every sub-sample of the covering; infinite where there is
/// none within reach.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightMap {
    /// Row-major; rows along +y, columns along +x.
    z: Vec<f64>,
    cols: usize,
    first: (f64, f64),
    step: f64,
    lowest: f64,
    reach: f64,
    /// The pose from which a layout of taxels sees the object: it looks anew at every depth.
    seen_from: Pose,
}

impl HeightMap {
    /// The heights of a layout of taxels: the lowest alone.
    pub(super) fn of_lowest(lowest: f64, reach: f64, seen_from: Pose) -> Self {
        Self { z: Vec::new(), cols: 1, first: (0.0, 0.0), step: 0.0, lowest, reach, seen_from }
    }

    /// The pose from which they were drawn: `object_from_sensor`.
    pub(super) fn seen_from(&self) -> Pose {
        self.seen_from
    }

    /// The height of the object's nearest point above the array itself (not the covering
    /// beyond it), metres; infinite when there is none within reach.
    #[must_use]
    pub fn lowest(&self) -> f64 {
        self.lowest
    }

    /// The range in front of the covering that was drawn, metres.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// The points with a visible surface: x, y and height, metres in the sensor frame. None for a
    /// layout of taxels.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        self.z.iter().enumerate().filter(|(_, z)| z.is_finite()).map(|(idx, z)| {
            let along = |first: f64, index: usize| first + index as f64 * self.step;
            (along(self.first.0, idx % self.cols), along(self.first.1, idx / self.cols), *z)
        })
    }

    pub(super) fn z(&self) -> &[f64] {
        &self.z
    }
}

/// Heights of a surface that indents each sub-sample of the covering as given (metres,
/// row-major); infinite where an indentation is 0 or less.
pub(super) fn of_indentations(imaging: &Imaging, indentations: &[f64]) -> HeightMap {
    let mut heights = flat(imaging, 0.0);
    let height = |indentation: f64| if indentation > 0.0 { -indentation } else { f64::INFINITY };
    let seen = heights.z.iter_mut().zip(indentations);
    seen.for_each(|(z, indentation)| *z = height(*indentation));
    heights.lowest = heights.lowest_under(imaging.array_half());
    heights
}

/// Heights without any surface.
fn flat(imaging: &Imaging, reach: f64) -> HeightMap {
    let (cols, rows, step) = (imaging.cols(), imaging.rows(), imaging.step());
    let middle = |n: usize| -0.5 * (n as f64 - 1.0) * step;
    let z = vec![f64::INFINITY; cols * rows];
    let first = (middle(cols), middle(rows));
    let (lowest, seen_from) = (f64::INFINITY, Pose::IDENTITY);
    HeightMap { z, cols, first, step, lowest, reach, seen_from }
}

/// Draws the heights seen from a pose, from the housing's back to `reach` ahead.
pub(super) fn draw(
    bvh: &Bvh,
    imaging: &Imaging,
    object_from_sensor: Pose,
    reach: f64,
) -> HeightMap {
    let mut heights = HeightMap { seen_from: object_from_sensor, ..flat(imaging, reach) };
    let (first, rows) = (heights.first, imaging.rows());
    let high = DVec3::new(-first.0, -first.1, reach);
    let near = SensorBox { low: DVec3::new(first.0, first.1, -HOUSING_DEPTH), high };
    let array = imaging.array_half();
    bvh.visit_near(object_from_sensor.inverse(), &near, |corners| {
        heights.add(&corners, rows, array);
    });
    // Only points above the array count for the depth. Corners between samples were counted
    // as they came; the samples are in the drawing.
    heights.lowest = heights.lowest.min(heights.lowest_under(array));
    heights
}

impl HeightMap {
    /// The lowest sample within half an array along x and y.
    fn lowest_under(&self, array_half: (f64, f64)) -> f64 {
        self.points()
            .filter(|(x, y, _)| x.abs() <= array_half.0 && y.abs() <= array_half.1)
            .map(|(_, _, z)| z)
            .fold(f64::INFINITY, f64::min)
    }

    /// Draws one triangle given in the sensor frame.
    fn add(&mut self, corners: &[DVec3; 3], rows: usize, array: (f64, f64)) {
        let [a, b, c] = *corners;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if low.z > self.reach || high.z < -HOUSING_DEPTH {
            return;
        }
        for corner in corners {
            let above_array = corner.x.abs() <= array.0 && corner.y.abs() <= array.1;
            if above_array && (-HOUSING_DEPTH..=self.reach).contains(&corner.z) {
                self.lowest = self.lowest.min(corner.z);
            }
        }
        let Some((col_low, col_high)) = self.between(low.x, high.x, self.first.0, self.cols) else {
            return;
        };
        let Some((row_low, row_high)) = self.between(low.y, high.y, self.first.1, rows) else {
            return;
        };
        let doubled_area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if doubled_area.abs() < 1e-18 {
            return; // seen edge-on; its neighbours show the edge
        }
        let inverse = 1.0 / doubled_area;
        // Weights of b and c are linear in x and y; that of a is the rest to 1.
        let b_along = ((c.y - a.y) * inverse, -(c.x - a.x) * inverse);
        let c_along = (-(b.y - a.y) * inverse, (b.x - a.x) * inverse);
        let (ab, ac) = (b.z - a.z, c.z - a.z);
        for row in row_low..=row_high {
            let y = self.first.1 + row as f64 * self.step - a.y;
            for col in col_low..=col_high {
                let x = self.first.0 + col as f64 * self.step - a.x;
                let weight_b = b_along.0 * x + b_along.1 * y;
                let weight_c = c_along.0 * x + c_along.1 * y;
                if weight_b < -1e-9 || weight_c < -1e-9 || weight_b + weight_c > 1.0 + 1e-9 {
                    continue;
                }
                let z = a.z + weight_b * ab + weight_c * ac;
                let seen = &mut self.z[row * self.cols + col];
                if z < *seen && (-HOUSING_DEPTH..=self.reach).contains(&z) {
                    *seen = z;
                }
            }
        }
    }

    /// The samples within `low ..= high` along one axis, if there are any.
    fn between(&self, low: f64, high: f64, first: f64, n: usize) -> Option<(usize, usize)> {
        let from = ((low - first) / self.step - 1e-9).ceil().max(0.0);
        let to = ((high - first) / self.step + 1e-9).floor().min(n as f64 - 1.0);
        (from <= to).then_some((from as usize, to as usize))
    }
}
