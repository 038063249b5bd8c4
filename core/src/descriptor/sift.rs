//! SIFT: histograms of gradients of the whole image, turned to its dominant orientation.
//!
//! Source: section 4.3.2.2, Lowe (1999, 2004). The grid of cells covers the inscribed
//! circle's square: 2 × 2 at low resolutions, 4 × 4 from 16 taxels on. A cell is three scales
//! wide; the orientation's window is a Gaussian of 1.5 scales.

use std::f64::consts::TAU;

use super::disc::Disc;
use super::{Descriptor, Workspace, normalize};
use crate::reading::TactileImage;

/// Taxels along the shorter side from which there are 4 × 4 cells.
const FINE_FROM: usize = 16;
/// Number of directions of a cell's histogram.
const N_DIRECTIONS: usize = 8;
/// Number of bins of the histogram of orientations.
const N_ORIENTATIONS: usize = 36;
/// Number of smoothings of that histogram by [1/3, 1/3, 1/3].
const N_SMOOTHINGS: usize = 6;
/// Largest value of a normalised descriptor.
const SHARE_MAX: f64 = 0.2;

/// SIFT for images of one shape.
#[derive(Clone, Debug)]
pub struct Sift {
    disc: Disc,
    n_cells: usize,
    taxels: Vec<SiftTaxel>,
}

/// Precomputed values of a taxel.
#[derive(Clone, Copy, Debug)]
struct SiftTaxel {
    /// Indices of its left, right, upper and lower neighbour; its own at a border.
    neighbors: [usize; 4],
    /// Inverse distances of left and right, and of upper and lower.
    steps: [f64; 2],
    /// Position about the centre, in cells.
    x: f64,
    y: f64,
    /// Weights in the dominant orientation and in the cells.
    orientation_weight: f64,
    cell_weight: f64,
}

impl Sift {
    /// Plans for images of `rows` × `cols` taxels: 32 values at low resolutions, else 128.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        let disc = Disc { rows, cols };
        let n_cells = if disc.diameter() < FINE_FROM { 2 } else { 4 };
        let cell_width = disc.diameter() as f64 / n_cells as f64;
        let all = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
        let taxels = all.map(|(row, col)| {
            let (x, y) = disc.about_center(row, col);
            let (x, y) = (x / cell_width, y / cell_width);
            let square = x * x + y * y;
            let (left, right) = (col.saturating_sub(1), (col + 1).min(cols - 1));
            let (up, down) = (row.saturating_sub(1), (row + 1).min(rows - 1));
            let step = |first: usize, last: usize| ((last - first).max(1) as f64).recip();
            SiftTaxel {
                neighbors: [
                    row * cols + left,
                    row * cols + right,
                    up * cols + col,
                    down * cols + col,
                ],
                steps: [step(left, right), step(up, down)],
                x,
                y,
                orientation_weight: (-0.5 * square / 0.25).exp(), // 1.5 scales = half a cell
                cell_weight: (-0.5 * square / (n_cells as f64 / 2.0).powi(2)).exp(),
            }
        });
        Self { disc, n_cells, taxels: taxels.collect() }
    }

    /// Adds a gradient to the up to eight bins around it, weighted by proximity.
    fn spread(&self, taxel: &SiftTaxel, axes: (f64, f64), gradient: Gradient, cells: &mut [f64]) {
        let (sin, cos) = axes;
        let middle = self.n_cells as f64 / 2.0 - 0.5;
        let u = cos * taxel.x + sin * taxel.y + middle;
        let v = -sin * taxel.x + cos * taxel.y + middle;
        let direction = gradient.angle.rem_euclid(TAU) / TAU * N_DIRECTIONS as f64;
        let weight = taxel.cell_weight * gradient.magnitude;
        for (row, near_v) in nearest_two(v) {
            for (col, near_u) in nearest_two(u) {
                let n = self.n_cells as i64;
                if !((0..n).contains(&row) && (0..n).contains(&col)) {
                    continue;
                }
                let cell = (row * n + col) as usize * N_DIRECTIONS;
                for (bin, near) in nearest_two(direction) {
                    let bin = bin.rem_euclid(N_DIRECTIONS as i64) as usize;
                    cells[cell + bin] += weight * near_v * near_u * near;
                }
            }
        }
    }
}

impl Descriptor for Sift {
    fn shape(&self) -> (usize, usize) {
        (self.disc.rows, self.disc.cols)
    }

    fn dimension(&self) -> usize {
        self.n_cells * self.n_cells * N_DIRECTIONS
    }

    fn write(&self, image: &TactileImage, workspace: &mut Workspace, features: &mut [f64]) {
        let (magnitudes, angles) =
            workspace.lend(2 * self.taxels.len(), 0).0.split_at_mut(self.taxels.len());
        let mut histogram = [0.0; N_ORIENTATIONS];
        let places = magnitudes.iter_mut().zip(angles.iter_mut());
        for (taxel, (magnitude, angle)) in self.taxels.iter().zip(places) {
            let gradient = Gradient::at(taxel, &image.pressures);
            (*magnitude, *angle) = (gradient.magnitude, gradient.angle);
            let weight = taxel.orientation_weight * gradient.magnitude;
            let place = gradient.angle.rem_euclid(TAU) / TAU * N_ORIENTATIONS as f64;
            for (bin, near) in nearest_two(place) {
                histogram[bin.rem_euclid(N_ORIENTATIONS as i64) as usize] += weight * near;
            }
        }
        let orientation = dominant(histogram);
        let axes = orientation.sin_cos();
        features.fill(0.0);
        for (taxel, (magnitude, angle)) in self.taxels.iter().zip(magnitudes.iter().zip(&*angles)) {
            let gradient = Gradient { magnitude: *magnitude, angle: angle - orientation };
            self.spread(taxel, axes, gradient, features);
        }
        normalize(features);
        features.iter_mut().for_each(|value| *value = value.min(SHARE_MAX));
    }
}

/// A gradient of pressure: Pa per taxel, and its direction (rad).
#[derive(Clone, Copy, Debug)]
struct Gradient {
    magnitude: f64,
    angle: f64,
}

impl Gradient {
    fn at(taxel: &SiftTaxel, pressures: &[f64]) -> Self {
        let [left, right, up, down] = taxel.neighbors.map(|place| pressures[place]);
        let (x, y) = ((right - left) * taxel.steps[0], (down - up) * taxel.steps[1]);
        Self { magnitude: (x * x + y * y).sqrt(), angle: y.atan2(x) }
    }
}

/// The two bins around a coordinate (bin n at n), with weights that sum to 1.
fn nearest_two(place: f64) -> [(i64, f64); 2] {
    let below = place.floor();
    let share = place - below;
    [(below as i64, 1.0 - share), (below as i64 + 1, share)]
}

/// The angle (rad) of the peak of a smoothed histogram, by a parabola through three bins.
fn dominant(mut histogram: [f64; N_ORIENTATIONS]) -> f64 {
    let neighbors =
        |bin: usize| [(bin + N_ORIENTATIONS - 1) % N_ORIENTATIONS, (bin + 1) % N_ORIENTATIONS];
    for _ in 0..N_SMOOTHINGS {
        let before = histogram;
        for (bin, value) in histogram.iter_mut().enumerate() {
            let [left, right] = neighbors(bin);
            *value = (before[left] + before[bin] + before[right]) / 3.0;
        }
    }
    let peak = (0..N_ORIENTATIONS)
        .fold(0, |best, bin| if histogram[bin] > histogram[best] { bin } else { best });
    let [left, right] = neighbors(peak).map(|bin| histogram[bin]);
    let bend = left - 2.0 * histogram[peak] + right;
    let shift = if bend < 0.0 { 0.5 * (left - right) / bend } else { 0.0 };
    (peak as f64 + shift) * TAU / N_ORIENTATIONS as f64
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::test_support::{
        any_image, blob, check_quarter_turn, feature, turned_affinity,
    };
    use crate::descriptor::{DescriptorKind, affinity};

    #[test]
    fn low_resolutions_have_2x2_cells_and_others_4x4() {
        assert_eq!(Sift::new(6, 8).dimension(), 32);
        assert_eq!(Sift::new(16, 28).dimension(), 128);
    }

    #[test]
    fn a_uniform_slope_has_one_direction_at_any_angle() {
        // All gradients agree with the orientation, so only direction 0 of each cell is used.
        for angle in [0.0_f64, 0.7, 2.0, -2.5] {
            let (sin, cos) = angle.sin_cos();
            let at = |n: usize| 5e3 + 900.0 * (cos * (n % 6) as f64 + sin * (n / 6) as f64);
            let image = TactileImage { rows: 6, cols: 6, pressures: (0..36).map(at).collect() };
            let found = feature(DescriptorKind::Sift, &image);
            for (bin, value) in found.iter().enumerate() {
                let expected = if bin % N_DIRECTIONS == 0 { 0.5 } else { 0.0 };
                assert!((value - expected).abs() < 0.05, "{angle}: bin {bin} is {value}");
            }
        }
    }

    /// A soft edge through the centre and a bump beside it, turned by `angle` (rad).
    fn slope(angle: f64) -> TactileImage {
        let (sin, cos) = angle.sin_cos();
        let at = |n: usize| {
            let (x, y) = ((n % 26) as f64 - 12.5, (n / 26) as f64 - 12.5);
            let (u, v) = (cos * x + sin * y, -sin * x + cos * y);
            let bump = (-0.5 * ((u + 4.0).powi(2) + (v - 5.0).powi(2)) / 9.0).exp();
            5_000.0 * (1.0 + (u / 4.0).tanh() + bump)
        };
        TactileImage { rows: 26, cols: 26, pressures: (0..676).map(at).collect() }
    }

    #[test]
    fn a_ridge_leaves_the_half_turn_ambiguous() {
        // The weakness: the two sides of a ridge are equally strong, and either may win.
        let lost = |n: i32| 1.0 - turned_affinity(DescriptorKind::Sift, f64::from(n) * 0.06);
        let largest = (1..10).map(lost).fold(0.0, f64::max);
        assert!(largest > 0.2, "{largest}");
    }

    #[test]
    fn a_peak_between_two_bins_is_interpolated() {
        let mut histogram = [0.0; N_ORIENTATIONS];
        (histogram[8], histogram[9]) = (1.0, 1.0);
        assert!((dominant(histogram) - 85.0_f64.to_radians()).abs() < 1e-9);
    }

    #[test]
    fn values_exceed_the_clip_only_by_the_second_normalisation() {
        // 0.2 clipped, then divided by the remaining norm: at most 0.2 / (0.2 · √2).
        let found = feature(DescriptorKind::Sift, &blob(26, 0.3, 0.0, 0.0));
        let largest = found.iter().copied().fold(0.0, f64::max);
        let at_largest = found.iter().filter(|value| **value > largest - 1e-12).count();
        assert!(at_largest >= 2, "{at_largest} bins share the clip");
    }

    proptest! {
        #[test]
        fn quarter_turns_change_nothing(square in any_image(6, 6), angle in -3.0..3.0_f64) {
            check_quarter_turn(DescriptorKind::Sift, &square, 1e-9);
            check_quarter_turn(DescriptorKind::Sift, &blob(26, angle, 0.3, 0.1), 1e-9);
        }

        #[test]
        fn rotation_of_a_clear_slope_changes_little(angle in -3.1..3.1_f64) {
            let kept = affinity(
                &feature(DescriptorKind::Sift, &slope(0.0)),
                &feature(DescriptorKind::Sift, &slope(angle)),
            );
            prop_assert!(kept > 0.97, "{kept}");
        }
    }
}
