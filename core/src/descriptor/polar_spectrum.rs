//! Polar spectrum: the magnitude of each spatial frequency, independent of direction and position.
//!
//! Beyond the dissertation, for arrays large enough to hold an object's shape. The magnitudes
//! of the zero-padded image's spectrum are invariant to translation; on rings of the spectrum
//! a rotation is a shift, to which the magnitudes of a second transform along each ring are
//! invariant. Mirror images are equal. Section 4.3.2.5.1 does the same to the image itself,
//! about its centre; MNTI (4.3.2.5.2) turns the image first.

use std::fmt;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::fourier::Fourier;
use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// Number of rings of the spectrum.
const N_RINGS: usize = 14;

/// Number of angles of a ring, over half a turn: the other half is its conjugate.
const N_ANGLES: usize = 32;

/// Number of frequencies kept along a ring, from 0.
const N_KEPT: usize = 8;

/// Radius of the outermost ring, in cycles a taxel: a little below the highest frequency, 0.5.
const HIGHEST: f64 = 0.4375;

/// The polar spectrum of images of one shape.
#[derive(Clone)]
pub struct PolarSpectrum {
    shape: (usize, usize),
    /// Rows and columns of the padded image.
    side: usize,
    fourier: Fourier,
    /// Sample positions of the rings, ring-major: four indices of the spectrum and their weights.
    samples: Vec<[(usize, f64); 4]>,
    along_ring: Arc<dyn Fft<f64>>,
}

impl fmt::Debug for PolarSpectrum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PolarSpectrum({} × {})", self.shape.0, self.shape.1)
    }
}

impl PolarSpectrum {
    /// Plans for images of `rows` × `cols` taxels.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        // A quarter larger than the image, so that touches at opposite edges do not meet.
        let side = (5 * rows.max(cols)).div_ceil(4).next_power_of_two().max(4);
        let (first, last) = (1.0, HIGHEST * side as f64);
        let sample = |ring: usize, angle: usize| {
            let radius = first + (last - first) * ring as f64 / (N_RINGS as f64 - 1.0);
            let (sin, cos) = (std::f64::consts::PI * angle as f64 / N_ANGLES as f64).sin_cos();
            wrapped(radius * sin, radius * cos, side)
        };
        let samples = (0..N_RINGS)
            .flat_map(|ring| (0..N_ANGLES).map(move |angle| (ring, angle)))
            .map(|(ring, angle)| sample(ring, angle))
            .collect();
        Self {
            shape: (rows, cols),
            side,
            fourier: Fourier::new(side, side),
            samples,
            along_ring: FftPlanner::new().plan_fft_forward(N_ANGLES),
        }
    }
}

/// Bilinear indices and weights of a frequency (row, col) in a periodic spectrum stored by
/// columns.
fn wrapped(row: f64, col: f64, side: usize) -> [(usize, f64); 4] {
    let (r0, c0) = (row.floor(), col.floor());
    let (fr, fc) = (row - r0, col - c0);
    let place = |down: i64, right: i64| {
        let within = |index: f64, step: i64| (index as i64 + step).rem_euclid(side as i64) as usize;
        within(c0, right) * side + within(r0, down)
    };
    [
        (place(0, 0), (1.0 - fr) * (1.0 - fc)),
        (place(0, 1), (1.0 - fr) * fc),
        (place(1, 0), fr * (1.0 - fc)),
        (place(1, 1), fr * fc),
    ]
}

impl Descriptor for PolarSpectrum {
    fn shape(&self) -> (usize, usize) {
        self.shape
    }

    fn dimension(&self) -> usize {
        N_RINGS * N_KEPT
    }

    fn write(&self, image: &TactileImage, workspace: &mut Workspace, features: &mut [f64]) {
        let n = self.side * self.side;
        let n_scratch = self.fourier.n_scratch().max(self.along_ring.get_inplace_scratch_len());
        let (magnitudes, complexes) = workspace.lend(n, 2 * n + N_ANGLES + n_scratch);
        let (values, rest) = complexes.split_at_mut(n);
        let (spectrum, rest) = rest.split_at_mut(n);
        let (ring, scratch) = rest.split_at_mut(N_ANGLES);
        values.fill(Complex::default());
        for (line, padded) in
            image.pressures.chunks_exact(image.cols).zip(values.chunks_exact_mut(self.side))
        {
            padded.iter_mut().zip(line).for_each(|(value, p)| *value = Complex::new(*p, 0.0));
        }
        self.fourier.forward(values, spectrum, scratch);
        magnitudes.iter_mut().zip(spectrum.iter()).for_each(|(m, value)| *m = value.norm());
        let rings = self.samples.chunks_exact(N_ANGLES).zip(features.chunks_exact_mut(N_KEPT));
        for (samples, kept) in rings {
            for (value, sample) in ring.iter_mut().zip(samples) {
                let sum = sample.iter().map(|(place, weight)| weight * magnitudes[*place]).sum();
                *value = Complex::new(sum, 0.0);
            }
            self.along_ring.process_with_scratch(ring, scratch);
            kept.iter_mut().zip(ring.iter()).for_each(|(value, sum)| *value = sum.norm());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::test_support::{
        blob, feature, mirrored, quarter_turned, turned_affinity,
    };
    use crate::descriptor::{DescriptorKind, affinity};

    /// An L of 3 × 2 taxels at (row, col) of an array of 9 × 12.
    fn corner(row: usize, col: usize) -> TactileImage {
        let mut image = TactileImage { rows: 9, cols: 12, pressures: vec![0.0; 108] };
        for (down, right) in [(0, 0), (1, 0), (2, 0), (2, 1)] {
            image.pressures[(row + down) * 12 + col + right] = 4_000.0;
        }
        image
    }

    #[test]
    fn translation_changes_nothing() {
        let kind = DescriptorKind::PolarSpectrum;
        let kept = affinity(&feature(kind, &corner(0, 0)), &feature(kind, &corner(6, 9)));
        assert!((kept - 1.0).abs() < 1e-12, "{kept}");
    }

    #[test]
    fn quarter_turns_and_mirrors_change_nothing() {
        let kind = DescriptorKind::PolarSpectrum;
        let image = blob(12, 0.3, 0.4, 0.2);
        for other in [quarter_turned(&image), mirrored(&image)] {
            let kept = affinity(&feature(kind, &image), &feature(kind, &other));
            assert!((kept - 1.0).abs() < 1e-9, "{kept}");
        }
    }

    #[test]
    fn rotation_changes_little() {
        for angle in [0.3, 0.8, 1.4, 2.5] {
            let kept = turned_affinity(DescriptorKind::PolarSpectrum, angle);
            assert!(kept > 0.995, "{angle}: {kept}");
        }
    }

    #[test]
    fn finer_touches_have_higher_frequencies() {
        // One taxel has all frequencies equally; a wide touch has only low ones.
        let mut point = corner(0, 0);
        point.pressures.fill(0.0);
        point.pressures[50] = 1_000.0;
        let kept = feature(DescriptorKind::PolarSpectrum, &point);
        let rings: Vec<f64> = kept.iter().step_by(N_KEPT).copied().collect();
        assert!(rings.iter().all(|ring| (ring / rings[0] - 1.0).abs() < 1e-9), "{rings:?}");
        let wide = feature(DescriptorKind::PolarSpectrum, &blob(12, 0.0, 0.0, 0.0));
        assert!(wide[(N_RINGS - 1) * N_KEPT] < 0.05 * wide[0]);
    }
}
