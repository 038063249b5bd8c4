//! Convolution with a kernel of the distance, by Fourier transforms: a surface under pressure.
//!
//! out(row, col) = Σ kernel(|row − row'|, |col − col'|) · in(row', col') over a grid, without
//! wrapping around: the transforms are twice as large as the grid. Plans are made once.

use std::fmt;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// A kernel on a grid of one shape.
#[derive(Clone)]
pub(super) struct Convolution {
    rows: usize,
    cols: usize,
    padded_rows: usize,
    padded_cols: usize,
    own: f64,
    /// By columns, scaled by the transforms' size; real since the kernel is even.
    spectrum: Vec<f64>,
    forward: [Arc<dyn Fft<f64>>; 2],
    backward: [Arc<dyn Fft<f64>>; 2],
}

/// The arrays that a convolution works in.
#[derive(Clone, Debug)]
pub(super) struct Workspace {
    /// The grid's rows, padded to the right.
    lines: Vec<Complex<f64>>,
    /// The whole spectrum, by columns.
    spectrum: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl fmt::Debug for Convolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Convolution({} × {})", self.rows, self.cols)
    }
}

impl Convolution {
    /// A kernel by the distances in rows and columns, over a grid of `rows` × `cols`.
    pub(super) fn new(rows: usize, cols: usize, kernel: impl Fn(usize, usize) -> f64) -> Self {
        let (padded_rows, padded_cols) = (padded(rows), padded(cols));
        let mut planner = FftPlanner::new();
        let forward = [padded_cols, padded_rows].map(|n| planner.plan_fft_forward(n));
        let backward = [padded_cols, padded_rows].map(|n| planner.plan_fft_inverse(n));
        let (own, spectrum) = (kernel(0, 0), Vec::new());
        let mut this =
            Self { rows, cols, padded_rows, padded_cols, own, spectrum, forward, backward };
        let distance = |index: usize, n: usize| index.min(n - index);
        let mut lines = Vec::with_capacity(padded_rows * padded_cols);
        for row in (0..padded_rows).map(|row| distance(row, padded_rows)) {
            for col in (0..padded_cols).map(|col| distance(col, padded_cols)) {
                // Distances that no two cells of the grid have are never evaluated.
                let within = row < rows && col < cols;
                lines.push(Complex::from(if within { kernel(row, col) } else { 0.0 }));
            }
        }
        let mut spectrum = vec![Complex::default(); lines.len()];
        let mut scratch = this.workspace().scratch;
        this.to_spectrum(&mut lines, &mut spectrum, &mut scratch);
        let scale = 1.0 / spectrum.len() as f64;
        this.spectrum = spectrum.iter().map(|value| scale * value.re).collect();
        this
    }

    /// Response of a cell to a unit load on the same cell.
    pub(super) fn own(&self) -> f64 {
        self.own
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn cols(&self) -> usize {
        self.cols
    }

    pub(super) fn workspace(&self) -> Workspace {
        let plans = self.forward.iter().chain(&self.backward);
        let n_scratch = plans.map(|plan| plan.get_inplace_scratch_len()).max().unwrap_or(0);
        Workspace {
            lines: vec![Complex::default(); self.rows * self.padded_cols],
            spectrum: vec![Complex::default(); self.padded_rows * self.padded_cols],
            scratch: vec![Complex::default(); n_scratch],
        }
    }

    /// Convolves row-major `values` into `sums`.
    pub(super) fn apply(&self, values: &[f64], sums: &mut [f64], workspace: &mut Workspace) {
        let Workspace { lines, spectrum, scratch } = workspace;
        for (line, row) in
            lines.chunks_exact_mut(self.padded_cols).zip(values.chunks_exact(self.cols))
        {
            line[..self.cols].iter_mut().zip(row).for_each(|(to, from)| *to = (*from).into());
            line[self.cols..].fill(Complex::default());
        }
        self.to_spectrum(lines, spectrum, scratch);
        spectrum.iter_mut().zip(&self.spectrum).for_each(|(value, factor)| *value *= factor);
        self.backward[1].process_with_scratch(spectrum, scratch);
        for (row, line) in lines.chunks_exact_mut(self.padded_cols).enumerate() {
            for (col, value) in line.iter_mut().enumerate() {
                *value = spectrum[col * self.padded_rows + row];
            }
        }
        self.backward[0].process_with_scratch(lines, scratch);
        for (line, row) in
            lines.chunks_exact(self.padded_cols).zip(sums.chunks_exact_mut(self.cols))
        {
            row.iter_mut().zip(line).for_each(|(to, from)| *to = from.re);
        }
    }

    /// The spectrum, by columns, of padded rows; missing rows are zero.
    fn to_spectrum(
        &self,
        lines: &mut [Complex<f64>],
        spectrum: &mut [Complex<f64>],
        scratch: &mut [Complex<f64>],
    ) {
        self.forward[0].process_with_scratch(lines, scratch);
        spectrum.fill(Complex::default());
        for (row, line) in lines.chunks_exact(self.padded_cols).enumerate() {
            for (col, value) in line.iter().enumerate() {
                spectrum[col * self.padded_rows + row] = *value;
            }
        }
        self.forward[1].process_with_scratch(spectrum, scratch);
    }
}

/// The smallest 2^a·3^b at which a kernel over `n` cells does not wrap around; such
/// transforms are the fastest.
fn padded(n: usize) -> usize {
    let is_fast = |mut size: usize| {
        while size.is_multiple_of(2) {
            size /= 2;
        }
        while size.is_multiple_of(3) {
            size /= 3;
        }
        size == 1
    };
    (2 * n - 1..).find(|size| is_fast(*size)).expect("there is always a larger power of two")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn convolution_equals_the_naive_sum() {
        let (rows, cols) = (5, 7);
        let kernel = |row: usize, col: usize| 1.0 / (1.0 + 2.0 * row as f64 + (col * col) as f64);
        let convolution = Convolution::new(rows, cols, kernel);
        assert_eq!((convolution.padded_rows, convolution.padded_cols), (9, 16));
        let values: Vec<f64> = (0..35).map(|n| f64::from(n * n % 11) - 3.0).collect();
        let mut sums = vec![0.0; 35];
        let mut workspace = convolution.workspace();
        for _ in 0..2 {
            convolution.apply(&values, &mut sums, &mut workspace);
            for (place, sum) in sums.iter().enumerate() {
                let distance = |from: usize| {
                    ((from / cols).abs_diff(place / cols), (from % cols).abs_diff(place % cols))
                };
                let naive: f64 = (0..35)
                    .map(|from| kernel(distance(from).0, distance(from).1) * values[from])
                    .sum();
                assert!((sum - naive).abs() < 1e-12 * 35.0, "{place}: {sum} for {naive}");
            }
        }
    }
}
