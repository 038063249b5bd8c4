//! Banks of filters over a whole image, for MR-8 and Schmid, applied by Fourier transforms.
//!
//! The image continues beyond its borders as its mirror image, which makes it periodic in
//! twice its sides, so a product of spectra is the exact convolution. Two real filters share
//! one complex transform. Lengths are in taxels.

use rustfft::num_complex::Complex;

use super::fourier::Fourier;
use crate::reading::TactileImage;

/// A filter's formula.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kernel {
    /// The first or second derivative, along `angle` (rad), of a Gaussian with deviation
    /// `narrow` in that direction and `wide` across it.
    Oriented { second: bool, narrow: f64, wide: f64, angle: f64 },
    /// A round Gaussian.
    Gaussian { sigma: f64 },
    /// A narrow round Gaussian less a wide one.
    GaussianDifference { narrow: f64, wide: f64 },
    /// Schmid's round ripples: cos(π τ r / σ) exp(−r² / 2σ²), less its mean.
    Ripple { sigma: f64, tau: f64 },
}

impl Kernel {
    fn at(self, x: f64, y: f64) -> f64 {
        match self {
            Self::Oriented { second, narrow, wide, angle } => {
                let (sin, cos) = angle.sin_cos();
                let (along, across) = ((cos * x + sin * y) / narrow, (-sin * x + cos * y) / wide);
                let gaussian = (-0.5 * (along * along + across * across)).exp();
                let derivative = if second { along * along - 1.0 } else { -along };
                derivative * gaussian
            }
            Self::Gaussian { sigma } => gaussian(x, y, sigma),
            Self::GaussianDifference { narrow, wide } => {
                gaussian(x, y, narrow) - gaussian(x, y, wide)
            }
            Self::Ripple { sigma, tau } => {
                let radius = x.hypot(y);
                (std::f64::consts::PI * tau * radius / sigma).cos()
                    * (-0.5 * (radius / sigma).powi(2)).exp()
            }
        }
    }

    /// Distance from the centre beyond which the filter is nearly 0.
    fn reach(self) -> f64 {
        3.0 * match self {
            Self::Oriented { narrow, wide, .. } | Self::GaussianDifference { narrow, wide } => {
                narrow.max(wide)
            }
            Self::Gaussian { sigma } | Self::Ripple { sigma, .. } => sigma,
        }
    }

    /// True when the response to a constant image is 0.
    fn sums_to_zero(self) -> bool {
        !matches!(self, Self::Gaussian { .. })
    }
}

/// A round Gaussian that integrates to 1.
fn gaussian(x: f64, y: f64, sigma: f64) -> f64 {
    let square = sigma * sigma;
    (-0.5 * (x * x + y * y) / square).exp() / (std::f64::consts::TAU * square)
}

/// Filters for images of one shape, with absolute values that sum to 1 before the mean of
/// those that sum to zero is subtracted.
#[derive(Clone, Debug)]
pub(super) struct FilterBank {
    rows: usize,
    cols: usize,
    fourier: Fourier,
    /// The spectrum of each pair of filters, as real and imaginary part of one array.
    pairs: Vec<Vec<Complex<f64>>>,
}

impl FilterBank {
    pub(super) fn new(rows: usize, cols: usize, kernels: &[Kernel]) -> Self {
        let fourier = Fourier::new(2 * rows, 2 * cols);
        let mut scratch = vec![Complex::default(); fourier.n_scratch()];
        let scale = (4 * rows * cols) as f64;
        let pairs = kernels.chunks(2).map(|pair| {
            let first = wrap(pair[0], rows, cols);
            let second = pair.get(1).map(|kernel| wrap(*kernel, rows, cols));
            let imaginary = |n: usize| second.as_ref().map_or(0.0, |values| values[n]);
            let place = |(n, re): (usize, &f64)| Complex::new(*re, imaginary(n)) / scale;
            let mut both: Vec<_> = first.iter().enumerate().map(place).collect();
            let mut spectrum = vec![Complex::default(); both.len()];
            fourier.forward(&mut both, &mut spectrum, &mut scratch);
            spectrum
        });
        let pairs = pairs.collect();
        Self { rows, cols, fourier, pairs }
    }

    /// Length of the buffer of [`Self::respond`].
    pub(super) fn n_buffer(&self) -> usize {
        let n = 4 * self.rows * self.cols;
        3 * n + n / 2 + self.fourier.n_scratch()
    }

    /// Calls `each` with (pair of filters, taxel, both responses) for all of them.
    pub(super) fn respond(
        &self,
        image: &TactileImage,
        buffer: &mut [Complex<f64>],
        mut each: impl FnMut(usize, usize, Complex<f64>),
    ) {
        let n = 4 * self.rows * self.cols;
        let (mirrored, rest) = buffer.split_at_mut(n);
        let (spectrum, rest) = rest.split_at_mut(n);
        let (product, rest) = rest.split_at_mut(n);
        let (responses, scratch) = rest.split_at_mut(n / 2);
        let fold = |place: usize, side: usize| place.min(2 * side - 1 - place);
        for (row, line) in mirrored.chunks_exact_mut(2 * self.cols).enumerate() {
            for (col, place) in line.iter_mut().enumerate() {
                let pressure = image.at(fold(row, self.rows), fold(col, self.cols));
                *place = Complex::new(pressure, 0.0);
            }
        }
        self.fourier.forward(mirrored, spectrum, scratch);
        for (pair, filter) in self.pairs.iter().enumerate() {
            for ((place, a), b) in product.iter_mut().zip(&*spectrum).zip(filter) {
                *place = a * b;
            }
            self.fourier.backward(product, responses, scratch);
            for (row, line) in responses.chunks_exact(2 * self.cols).enumerate() {
                for (col, response) in line[..self.cols].iter().enumerate() {
                    each(pair, row * self.cols + col, *response);
                }
            }
        }
    }
}

/// A filter about taxel (0, 0) of an array that is periodic in 2 rows × 2 cols, row-major.
fn wrap(kernel: Kernel, rows: usize, cols: usize) -> Vec<f64> {
    let reach = kernel.reach().ceil() as i64;
    let (height, width) = (2 * rows as i64, 2 * cols as i64);
    let mut values = vec![0.0; (height * width) as usize];
    let (mut sum, mut sum_abs) = (0.0, 0.0);
    for y in -reach..=reach {
        for x in -reach..=reach {
            let value = kernel.at(x as f64, y as f64);
            values[(y.rem_euclid(height) * width + x.rem_euclid(width)) as usize] += value;
            sum += value;
            sum_abs += value.abs();
        }
    }
    let mean = if kernel.sums_to_zero() { sum / values.len() as f64 } else { 0.0 };
    let scale = if sum_abs > 0.0 { sum_abs.recip() } else { 0.0 };
    values.iter_mut().for_each(|value| *value = (*value - mean) * scale);
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::test_support::blob;

    /// The response at a taxel as the sum over the mirrored image.
    fn naive(kernel: Kernel, image: &TactileImage, row: usize, col: usize) -> f64 {
        let filter = wrap(kernel, image.rows, image.cols);
        let fold = |place: usize, side: usize| place.min(2 * side - 1 - place);
        let (height, width) = (2 * image.rows, 2 * image.cols);
        let part = |n: usize| {
            let (r, c) = ((row + height - n / width) % height, (col + width - n % width) % width);
            filter[n] * image.at(fold(r, image.rows), fold(c, image.cols))
        };
        (0..height * width).map(part).sum()
    }

    #[test]
    fn responses_equal_the_naive_mirrored_convolution() {
        let image = blob(6, 0.4, 0.2, 0.0);
        let kernels = [
            Kernel::Oriented { second: false, narrow: 0.5, wide: 1.0, angle: 0.5 },
            Kernel::Oriented { second: true, narrow: 2.0, wide: 4.0, angle: 2.0 },
            Kernel::Gaussian { sigma: 1.0 },
            Kernel::GaussianDifference { narrow: 1.0, wide: 2.0 },
            Kernel::Ripple { sigma: 1.5, tau: 2.0 },
        ];
        let bank = FilterBank::new(6, 6, &kernels);
        let mut buffer = vec![Complex::default(); bank.n_buffer()];
        bank.respond(&image, &mut buffer, |pair, taxel, response| {
            let expected = |kernel| naive(kernel, &image, taxel / 6, taxel % 6);
            assert!((response.re - expected(kernels[2 * pair])).abs() < 1e-8);
            let second = kernels.get(2 * pair + 1).map_or(0.0, |kernel| expected(*kernel));
            assert!((response.im - second).abs() < 1e-8);
        });
    }

    #[test]
    fn only_the_gaussian_responds_to_a_constant_image() {
        let image = TactileImage { rows: 5, cols: 4, pressures: vec![900.0; 20] };
        let kernels = [
            Kernel::Gaussian { sigma: 1.3 },
            Kernel::GaussianDifference { narrow: 1.0, wide: 2.0 },
        ];
        let bank = FilterBank::new(5, 4, &kernels);
        let mut buffer = vec![Complex::default(); bank.n_buffer()];
        bank.respond(&image, &mut buffer, |_, _, response| {
            assert!((response.re - 900.0).abs() < 1e-9 && response.im.abs() < 1e-9);
        });
    }
}
