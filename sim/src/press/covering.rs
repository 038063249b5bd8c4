//! The covering as an elastic body: solves the contact with the object for the stress on the
//! taxels.
//!
//! Source: Johnson (1985), chapter 3, and Polonsky and Keer (1999). The surface is the cells
//! of the height map, the covering beyond the array included; the object presses on nothing
//! farther out. Small deformations, no friction, a rigid object. Cells and taxels are
//! row-major in the sensor frame's order. Not here: the choice of the numbers (`physics`).

mod convolution;
mod kernel;
mod solve;

use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;

use super::heights::HeightMap;
use super::imaging::Imaging;
use super::physics::CoveringConfig;
use crate::noise::taxel_gains;
use convolution::Convolution;
use kernel::Kernel;

/// The kernels of a covering over a sensor's cells, and the sensor's gains.
#[derive(Clone, Debug)]
pub(super) struct Covering {
    compliance: Convolution,
    /// Mean stress on a taxel per pascal on a cell, indexed by the distance of their centres
    /// in half cells along each axis: `n_offsets` rows of `n_offsets`.
    taxel_stress: Vec<f64>,
    n_offsets: usize,
    layout: Layout,
    gains: Vec<f64>,
    thickness: f64,
    tolerance: f64,
}

/// Position of the taxels among the cells.
#[derive(Clone, Copy, Debug)]
struct Layout {
    taxel_rows: usize,
    taxel_cols: usize,
    sub_samples: usize,
    padding: usize,
}

impl Layout {
    /// Twice the coordinate of a taxel's centre along one axis, in cells.
    fn doubled_center(&self, taxel: usize) -> usize {
        (2 * (taxel + self.padding) + 1) * self.sub_samples - 1
    }
}

impl Covering {
    /// The covering of a sensor drawn at `sub_samples` cells a taxel and `padding` taxels.
    pub(super) fn new(
        sensor: &SensorDescription,
        imaging: &Imaging,
        (sub_samples, padding): (usize, usize),
        config: &CoveringConfig,
    ) -> Self {
        let (parameters, grid, step) = (sensor.parameters(), sensor.grid(), imaging.step());
        let (rows, cols) = (imaging.rows(), imaging.cols());
        let n_offsets = rows.max(cols);
        let kernel = Kernel::new(config, 1.5 * (n_offsets + 2 * sub_samples) as f64 * step);
        let compliance = Convolution::new(rows, cols, |row, col| {
            kernel.give(step, col as f64 * step, row as f64 * step)
        });
        // Centres of taxels lie on cells when the number of cells per taxel is odd, otherwise
        // between two cells.
        let shift = if sub_samples.is_multiple_of(2) { 0.5 } else { 0.0 };
        let offset = |index: usize| (index as f64 + shift) * step;
        let taxel_stress = (0..n_offsets * n_offsets).map(|at| {
            let (x, y) = (offset(at % n_offsets), offset(at / n_offsets));
            kernel.taxel_stress(grid.taxel_width, step, x, y)
        });
        Self {
            compliance,
            taxel_stress: taxel_stress.collect(),
            n_offsets,
            layout: Layout { taxel_rows: grid.rows, taxel_cols: grid.cols, sub_samples, padding },
            gains: gains(grid.n_taxels(), config),
            thickness: parameters.covering_thickness,
            tolerance: config.tolerance,
        }
    }

    /// The mean pressure (Pa) on each taxel, times its gain, after moving `travel` along +z;
    /// the object's depth is clamped to the covering's thickness.
    pub(super) fn taxel_pressures(&self, heights: &HeightMap, travel: f64) -> Vec<f64> {
        let stresses = self.below(&self.surface_pressures(heights, travel));
        stresses.iter().zip(&self.gains).map(|(stress, gain)| gain * stress).collect()
    }

    /// The pressure (Pa) on each cell of the surface.
    fn surface_pressures(&self, heights: &HeightMap, travel: f64) -> Vec<f64> {
        let penetrations: Vec<f64> =
            heights.z().iter().map(|z| (travel - z).min(self.thickness)).collect();
        solve::pressures(&self.compliance, &penetrations, self.tolerance)
    }

    /// The mean stress (Pa) on each taxel below the given pressures on the surface.
    fn below(&self, surface: &[f64]) -> Vec<f64> {
        let Layout { taxel_rows, taxel_cols, .. } = self.layout;
        let n_cols = self.compliance.cols();
        let mut pressures = vec![0.0; taxel_rows * taxel_cols];
        for (cell, pressure) in surface.iter().enumerate().filter(|(_, p)| **p > 0.0) {
            for taxel_row in 0..taxel_rows {
                let row_offset =
                    self.layout.doubled_center(taxel_row).abs_diff(2 * (cell / n_cols)) / 2;
                let stresses = &self.taxel_stress[row_offset * self.n_offsets..][..self.n_offsets];
                for taxel_col in 0..taxel_cols {
                    let col_offset =
                        self.layout.doubled_center(taxel_col).abs_diff(2 * (cell % n_cols)) / 2;
                    pressures[taxel_row * taxel_cols + taxel_col] +=
                        stresses[col_offset] * pressure;
                }
            }
        }
        pressures
    }
}

/// The gains of the sensor with the seed of `config`.
fn gains(n_taxels: usize, config: &CoveringConfig) -> Vec<f64> {
    let mut stream = Stream::new(config.gain_seed, Purpose::TaxelGains, 0);
    taxel_gains(n_taxels, config.gain_spread, &mut stream)
}

#[cfg(test)]
mod tests;
