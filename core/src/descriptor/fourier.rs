//! Two-dimensional discrete Fourier transforms with reusable plans.
//!
//! A spectrum is stored by columns: the value of frequency (row, col) is at `col × rows +
//! row`. Nothing is scaled: forward and back multiplies by rows × cols.

use std::fmt;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// Forward and backward transforms of arrays of one shape.
#[derive(Clone)]
pub(super) struct Fourier {
    rows: usize,
    cols: usize,
    forward: [Arc<dyn Fft<f64>>; 2],
    backward: [Arc<dyn Fft<f64>>; 2],
}

impl fmt::Debug for Fourier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Fourier({} × {})", self.rows, self.cols)
    }
}

impl Fourier {
    pub(super) fn new(rows: usize, cols: usize) -> Self {
        let mut planner = FftPlanner::new();
        let forward = [planner.plan_fft_forward(cols), planner.plan_fft_forward(rows)];
        let backward = [planner.plan_fft_inverse(cols), planner.plan_fft_inverse(rows)];
        Self { rows, cols, forward, backward }
    }

    /// Length of the scratch buffer of the transforms.
    pub(super) fn n_scratch(&self) -> usize {
        let plans = self.forward.iter().chain(&self.backward);
        plans.map(|plan| plan.get_inplace_scratch_len()).max().unwrap_or(0)
    }

    /// The spectrum of a row-major array; overwrites the array.
    pub(super) fn forward(
        &self,
        values: &mut [Complex<f64>],
        spectrum: &mut [Complex<f64>],
        scratch: &mut [Complex<f64>],
    ) {
        self.forward[0].process_with_scratch(values, scratch);
        for (row, line) in values.chunks_exact(self.cols).enumerate() {
            for (col, value) in line.iter().enumerate() {
                spectrum[col * self.rows + row] = *value;
            }
        }
        self.forward[1].process_with_scratch(spectrum, scratch);
    }

    /// The first rows of the array of a spectrum, as many as fill `values`; overwrites the
    /// spectrum.
    pub(super) fn backward(
        &self,
        spectrum: &mut [Complex<f64>],
        values: &mut [Complex<f64>],
        scratch: &mut [Complex<f64>],
    ) {
        self.backward[1].process_with_scratch(spectrum, scratch);
        for (row, line) in values.chunks_exact_mut(self.cols).enumerate() {
            for (col, value) in line.iter_mut().enumerate() {
                *value = spectrum[col * self.rows + row];
            }
        }
        self.backward[0].process_with_scratch(values, scratch);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn the_spectrum_equals_the_naive_sum_and_inverts() {
        let (rows, cols) = (5, 6);
        let array: Vec<Complex<f64>> =
            (0..30).map(|n| Complex::new(f64::from(n * n % 7), f64::from(n % 3))).collect();
        let fourier = Fourier::new(rows, cols);
        let mut scratch = vec![Complex::default(); fourier.n_scratch()];
        let mut spectrum = vec![Complex::default(); 30];
        fourier.forward(&mut array.clone(), &mut spectrum, &mut scratch);
        for (k, l) in [(0, 0), (2, 1), (4, 5)] {
            let sum: Complex<f64> = (0..30)
                .map(|n| {
                    let turns = (k * (n / cols)) as f64 / 5.0 + (l * (n % cols)) as f64 / 6.0;
                    array[n] * Complex::cis(-TAU * turns)
                })
                .sum();
            assert!((spectrum[l * rows + k] - sum).norm() < 1e-9);
        }
        let mut back = vec![Complex::default(); 12];
        fourier.backward(&mut spectrum, &mut back, &mut scratch);
        assert!(back.iter().zip(&array).all(|(b, a)| (b / 30.0 - a).norm() < 1e-12));
    }
}
