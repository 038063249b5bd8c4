//! From depths to an image: the point spread and each taxel's mean, folded into one matrix.
//!
//! image = W_rows · depth · W_colsᵀ. Every row of W sums to 1, so a uniform displacement is
//! preserved. Source: section 2.5.1 with equation 2.2 as corrected (a separable 2-D kernel).

use palpate_core::sensor::SensorDescription;

use super::heights::HeightMap;

/// Points along each side of a taxel over which its mean is taken.
const MEAN_POINTS: usize = 8;

/// The folded matrices and the layout of their sub-samples.
#[derive(Clone, Debug)]
pub(super) struct Imaging {
    /// One row of weights per taxel row, over the rows of sub-samples.
    row_weights: Vec<Vec<f64>>,
    /// One row of weights per taxel column, over the columns of sub-samples.
    col_weights: Vec<Vec<f64>>,
    step: f64,
    array_half: (f64, f64),
}

impl Imaging {
    pub(super) fn new(sensor: &SensorDescription, sub_samples: usize, padding: usize) -> Self {
        let grid = sensor.grid();
        let spread = sensor.parameters().point_spread;
        let step = grid.pitch / sub_samples as f64;
        let weights = |n_taxels: usize| -> Vec<Vec<f64>> {
            let n_samples = (n_taxels + 2 * padding) * sub_samples;
            let at =
                |index: usize, n: usize, step: f64| (index as f64 - (n as f64 - 1.0) / 2.0) * step;
            let taxel_weights = |taxel: usize| {
                let center = at(taxel, n_taxels, grid.pitch);
                let weight = |sample: usize| -> f64 {
                    let place = at(sample, n_samples, step);
                    (0..MEAN_POINTS)
                        .map(|point| {
                            let mean_step = grid.taxel_width / MEAN_POINTS as f64;
                            let within = center + at(point, MEAN_POINTS, mean_step);
                            (-0.5 * ((place - within) / spread).powi(2)).exp()
                        })
                        .sum()
                };
                let raw: Vec<f64> = (0..n_samples).map(weight).collect();
                let sum: f64 = raw.iter().sum();
                raw.iter().map(|value| value / sum).collect()
            };
            (0..n_taxels).map(taxel_weights).collect()
        };
        let half = |n: usize| 0.5 * n as f64 * grid.pitch;
        Self {
            row_weights: weights(grid.rows),
            col_weights: weights(grid.cols),
            step,
            array_half: (half(grid.cols), half(grid.rows)),
        }
    }

    /// Rows of sub-samples.
    pub(super) fn rows(&self) -> usize {
        self.row_weights[0].len()
    }

    /// Columns of sub-samples.
    pub(super) fn cols(&self) -> usize {
        self.col_weights[0].len()
    }

    /// Distance between neighbouring sub-samples, metres.
    pub(super) fn step(&self) -> f64 {
        self.step
    }

    /// Half of the array along x and y, metres.
    pub(super) fn array_half(&self) -> (f64, f64) {
        self.array_half
    }

    /// Blurred displacements (metres, row-major) after moving `travel` along +z; depths are
    /// clamped to the covering's `thickness`.
    pub(super) fn displacements(
        &self,
        heights: &HeightMap,
        travel: f64,
        thickness: f64,
    ) -> Vec<f64> {
        let (n_cols, n_taxel_cols) = (self.cols(), self.col_weights.len());
        let n_taxel_rows = self.row_weights.len();
        let mut image = vec![0.0; n_taxel_rows * n_taxel_cols];
        let mut depths = vec![0.0; n_cols];
        let mut blurred_row = vec![0.0; n_taxel_cols];
        for (sample_row, z) in heights.z().chunks_exact(n_cols).enumerate() {
            let mut any = 0.0;
            for (depth, z) in depths.iter_mut().zip(z) {
                *depth = (travel - z).clamp(0.0, thickness);
                any += *depth;
            }
            if any <= 0.0 {
                continue;
            }
            for (blurred, weights) in blurred_row.iter_mut().zip(&self.col_weights) {
                *blurred = dot(weights, &depths);
            }
            for (taxel_row, weights) in self.row_weights.iter().enumerate() {
                let weight = weights[sample_row];
                let row = &mut image[taxel_row * n_taxel_cols..][..n_taxel_cols];
                row.iter_mut().zip(&blurred_row).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        image
    }
}

/// The inner product, summed in four lanes so that it vectorises.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 4];
    let (a_chunks, a_rest) = a.as_chunks::<4>();
    let (b_chunks, b_rest) = b.as_chunks::<4>();
    for (x, y) in a_chunks.iter().zip(b_chunks) {
        for lane in 0..4 {
            lanes[lane] += x[lane] * y[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    lanes.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_weights_sums_to_one() {
        for name in SensorDescription::PRESET_NAMES {
            let imaging = Imaging::new(&SensorDescription::preset_named(name).unwrap(), 2, 4);
            for weights in imaging.row_weights.iter().chain(&imaging.col_weights) {
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{name}");
            }
        }
    }

    #[test]
    fn the_layout_covers_array_and_padding() {
        let imaging = Imaging::new(&SensorDescription::digitacts_6x8(), 2, 4);
        assert_eq!((imaging.rows(), imaging.cols()), (28, 32));
        assert!((imaging.step() - 1e-3).abs() < 1e-15);
    }
}
