//! From depths to an image: the point spread and each taxel's mean, folded into one matrix.
//!
//! image = W_rows · depth · W_colsᵀ. Every row of W sums to 1, so a uniform displacement is
//! preserved, unless the covering ends near the array and loses or conserves force there
//! (`CoveringEdge`). Source: section 2.5.1 with equation 2.2 as corrected (a separable 2-D
//! kernel).

use palpate_core::sensor::{CoveringEdge, SensorDescription, SpreadKernel};

use super::heights::HeightMap;

/// Points along each side of a taxel over which its mean is taken.
const MEAN_POINTS: usize = 8;

/// Standard deviations beyond which the spread is cut off. Chosen: an exponential is e^−8.5 of
/// its peak there.
const REACH: f64 = 6.0;

/// Points of the sum for the share of force that stays within the covering. Chosen: 40 a
/// standard deviation.
const KEPT_POINTS: usize = 481;

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
        let step = grid.pitch / sub_samples as f64;
        let weights = |n_taxels: usize| Axis { sensor, n_taxels, padding, step }.weights();
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

/// One axis of a sensor: taxels and sub-samples are centred on 0.
struct Axis<'a> {
    sensor: &'a SensorDescription,
    n_taxels: usize,
    padding: usize,
    step: f64,
}

impl Axis<'_> {
    /// A row of weights over the sub-samples for each taxel. The edge of the covering decides
    /// what a row sums to.
    fn weights(&self) -> Vec<Vec<f64>> {
        let coupling = &self.sensor.parameters().coupling;
        let sub_samples = (self.sensor.grid().pitch / self.step).round() as usize;
        let n_samples = (self.n_taxels + 2 * self.padding) * sub_samples;
        let places: Vec<f64> = (0..n_samples).map(|at| placed(at, n_samples, self.step)).collect();
        let of_taxel = |taxel: usize| -> Vec<f64> {
            let raw: Vec<f64> = places.iter().map(|place| self.felt(taxel, *place)).collect();
            match coupling.edge {
                CoveringEdge::Continues => {
                    let sum: f64 = raw.iter().sum();
                    raw.iter().map(|value| value / sum).collect()
                }
                CoveringEdge::ConservesForce | CoveringEdge::LosesForce => {
                    let whole = self.unbounded(taxel, n_samples);
                    raw.iter().map(|value| value / whole).collect()
                }
            }
        };
        let mut weights: Vec<Vec<f64>> = (0..self.n_taxels).map(of_taxel).collect();
        if coupling.edge == CoveringEdge::ConservesForce {
            for (at, place) in places.iter().enumerate() {
                let kept = self.kept(*place);
                weights.iter_mut().for_each(|row| row[at] /= kept);
            }
        }
        weights
    }

    /// Half of the covering along the axis, metres.
    fn covering_half(&self) -> f64 {
        let margin = self.sensor.parameters().coupling.margin.unwrap_or(f64::INFINITY);
        0.5 * self.n_taxels as f64 * self.sensor.grid().pitch + margin
    }

    /// The effect of a sub-sample at `place` on a taxel, not normalised; 0 beyond the covering.
    fn felt(&self, taxel: usize, place: f64) -> f64 {
        if place.abs() > self.covering_half() {
            return 0.0;
        }
        self.spread_to(taxel, place)
    }

    /// The spread from `place` to a taxel over an unbounded covering.
    fn spread_to(&self, taxel: usize, place: f64) -> f64 {
        let grid = self.sensor.grid();
        let center = placed(taxel, self.n_taxels, grid.pitch);
        let mean_step = grid.taxel_width / MEAN_POINTS as f64;
        (0..MEAN_POINTS)
            .map(|point| self.kernel(place - (center + placed(point, MEAN_POINTS, mean_step))))
            .sum()
    }

    fn kernel(&self, distance: f64) -> f64 {
        let parameters = self.sensor.parameters();
        let deviations = distance / parameters.point_spread;
        match parameters.coupling.kernel {
            SpreadKernel::Gaussian => (-0.5 * deviations.powi(2)).exp(),
            SpreadKernel::Exponential => (-std::f64::consts::SQRT_2 * deviations.abs()).exp(),
        }
    }

    /// A taxel's response to an even press if the covering had no edge, not normalised.
    fn unbounded(&self, taxel: usize, n_samples: usize) -> f64 {
        let beyond = (REACH * self.sensor.parameters().point_spread / self.step).ceil() as usize;
        let n = n_samples + 2 * beyond;
        (0..n).map(|at| self.spread_to(taxel, placed(at, n, self.step))).sum()
    }

    /// The share of the force at `place` that would stay within this covering if it had no edge.
    fn kept(&self, place: f64) -> f64 {
        let half = self.covering_half();
        if half.is_infinite() {
            return 1.0;
        }
        let reach = REACH * self.sensor.parameters().point_spread;
        let points = |n: usize| (0..n).map(move |at| placed(at, n, 2.0 * reach / n as f64));
        let mass = |away: f64| self.kernel(away);
        let whole: f64 = points(KEPT_POINTS).map(mass).sum();
        let inside: f64 =
            points(KEPT_POINTS).filter(|away| (place + away).abs() <= half).map(mass).sum();
        (inside / whole).max(f64::MIN_POSITIVE)
    }
}

/// The place of the element at an index of `n`, `step` apart and centred on 0.
fn placed(index: usize, n: usize, step: f64) -> f64 {
    (index as f64 - (n as f64 - 1.0) / 2.0) * step
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
        for name in palpate_core::sensor::Preset::NAMES {
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
