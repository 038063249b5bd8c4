//! Polar-Fourier: Fourier magnitudes of the image's rings, which are invariant to rotation.
//!
//! Source: section 4.3.2.5.1, equations 4.11–4.14; radii, rows, kept frequencies and angles
//! as in `docs/equations.md`. The transform is linear, so the sum and the difference of two
//! rings are taken of their spectra, and two rings share one complex transform.

use std::fmt;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::disc::Disc;
use super::sample::Sample;
use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// Recorded magnitudes of the rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolarFourierForm {
    /// Magnitudes of each ring, and of the sum and difference of neighbouring rings.
    Interleaved,
    /// Like `Interleaved`, each row divided by the root of its radius, as printed (rwPF).
    RadiallyWeighted,
    /// Magnitudes of each ring alone (niPF).
    NonInterleaved,
    /// Interleaved, and for each ring of at least three kept frequencies the phase products
    /// F(1)·F(k)·F*(k + 1), which a rotation preserves and a mirror negates.
    Signed,
}

/// Polar-Fourier for images of one shape.
#[derive(Clone)]
pub struct PolarFourier {
    disc: Disc,
    form: PolarFourierForm,
    n_angles: usize,
    /// Sample positions of the rings: ring-major, angles in order; empty rings pad to an even
    /// number.
    samples: Vec<Sample>,
    fft: Arc<dyn Fft<f64>>,
    rows: Vec<Row>,
}

/// A row of the image of rings, I_Q.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// The ring, or the inner one of two; from 0.
    ring: usize,
    part: Part,
    /// N: number of lowest frequencies kept.
    n_kept: usize,
    /// Factor of its magnitudes.
    weight: f64,
}

#[derive(Clone, Copy, Debug)]
enum Part {
    Ring,
    Sum,
    Difference,
}

impl fmt::Debug for PolarFourier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PolarFourier({} × {}, {:?})", self.disc.rows, self.disc.cols, self.form)
    }
}

impl PolarFourier {
    /// Plans for images of `rows` × `cols` taxels.
    ///
    /// D rings of radii i/2 taxels, i = 1 … D, in the inscribed circle of diameter D; at
    /// least 16 angles, a power of two of at least 2 D.
    #[must_use]
    pub fn new(rows: usize, cols: usize, form: PolarFourierForm) -> Self {
        let disc = Disc { rows, cols };
        let n_rings = disc.diameter();
        let n_angles = (2 * n_rings).next_power_of_two().max(16);
        let (center_row, center_col) = disc.center();
        let inside = |row: i64, col: i64| {
            (0..rows as i64).contains(&row)
                && (0..cols as i64).contains(&col)
                && disc.contains(row as usize, col as usize)
        };
        let sample = |n: usize| {
            let radius = (n / n_angles + 1) as f64 / 2.0;
            let angle = std::f64::consts::TAU * (n % n_angles) as f64 / n_angles as f64;
            let (sin, cos) = angle.sin_cos();
            Sample::bilinear(center_row + radius * sin, center_col + radius * cos, cols, inside)
        };
        let mut samples: Vec<Sample> = (0..n_rings * n_angles).map(sample).collect();
        samples.resize(n_rings.next_multiple_of(2) * n_angles, Sample::default());
        let fft = FftPlanner::new().plan_fft_forward(n_angles);
        Self { disc, form, n_angles, samples, fft, rows: layout(n_rings, form) }
    }

    /// Largest number of frequencies kept in a row.
    fn n_kept_max(&self) -> usize {
        self.rows.iter().map(|row| row.n_kept).max().unwrap_or(1)
    }

    /// The spectra of two rings transformed as real and imaginary part.
    fn unpack(&self, packed: &[Complex<f64>], pair: &mut [Complex<f64>]) {
        let n_kept = pair.len() / 2;
        let (first, second) = pair.split_at_mut(n_kept);
        for frequency in 0..n_kept {
            let ahead = packed[frequency];
            let back = packed[(self.n_angles - frequency) % self.n_angles].conj();
            let difference = (ahead - back) * 0.5;
            first[frequency] = (ahead + back) * 0.5;
            second[frequency] = Complex::new(difference.im, -difference.re);
        }
    }

    /// Writes a feature from the rings' spectra, `stride` values each.
    fn record(&self, spectra: &[Complex<f64>], stride: usize, feature: &mut [f64]) {
        let mut places = feature.iter_mut();
        for row in &self.rows {
            let inner = &spectra[row.ring * stride..];
            let outer = spectra.get((row.ring + 1) * stride..).unwrap_or(inner);
            for (frequency, place) in (0..row.n_kept).zip(&mut places) {
                let value = match row.part {
                    Part::Ring => inner[frequency],
                    Part::Sum => (inner[frequency] + outer[frequency]) * 0.5, // Eq. 4.13
                    Part::Difference => (inner[frequency] - outer[frequency]) * 0.5, // Eq. 4.14
                };
                *place = row.weight * value.norm_sqr().sqrt();
            }
        }
        let products = self.products();
        for ((ring, frequency), place) in products.zip(places) {
            *place = signed_product(&spectra[ring * stride..], frequency);
        }
    }

    /// (ring, k) of the phase products F(1)·F(k)·F*(k + 1) that are recorded.
    fn products(&self) -> impl Iterator<Item = (usize, usize)> {
        let signed = self.form == PolarFourierForm::Signed;
        let rings = self.rows.iter().filter(move |row| signed && matches!(row.part, Part::Ring));
        rings.flat_map(|row| {
            (1..row.n_kept.saturating_sub(1)).map(|frequency| (row.ring, frequency))
        })
    }
}

impl Descriptor for PolarFourier {
    fn shape(&self) -> (usize, usize) {
        (self.disc.rows, self.disc.cols)
    }

    fn dimension(&self) -> usize {
        self.rows.iter().map(|row| row.n_kept).sum::<usize>() + self.products().count()
    }

    fn write(&self, image: &TactileImage, workspace: &mut Workspace, features: &mut [f64]) {
        let n_kept = self.n_kept_max();
        let n_packed = self.samples.len() / 2;
        let n_spectra = self.samples.len() / self.n_angles * n_kept;
        let n_scratch = self.fft.get_inplace_scratch_len();
        let complexes = workspace.lend(0, n_packed + n_spectra + n_scratch).1;
        let (packed, rest) = complexes.split_at_mut(n_packed);
        let (spectra, scratch) = rest.split_at_mut(n_spectra);
        let pairs = self.samples.chunks_exact(2 * self.n_angles);
        for (pair, line) in pairs.zip(packed.chunks_exact_mut(self.n_angles)) {
            let (first, second) = pair.split_at(self.n_angles);
            for ((a, b), value) in first.iter().zip(second).zip(line) {
                *value = Complex::new(a.of(&image.pressures), b.of(&image.pressures));
            }
        }
        self.fft.process_with_scratch(packed, scratch);
        let lines = packed.chunks_exact(self.n_angles);
        for (line, pair) in lines.zip(spectra.chunks_exact_mut(2 * n_kept)) {
            self.unpack(line, pair);
        }
        self.record(spectra, n_kept, features);
    }
}

/// The rows of I_Q (of I_P without interleaving) from the innermost ring outwards.
fn layout(n_rings: usize, form: PolarFourierForm) -> Vec<Row> {
    let diameter = n_rings as f64;
    let interleaved = form != PolarFourierForm::NonInterleaved;
    // `position` is equation 4.11's i; between two rings it is their mean.
    let row = |ring: usize, part: Part, position: f64| {
        let n_kept = (((diameter / 2.0 + 1.0) * position / diameter).round() as usize).max(1);
        let radius = position / 2.0;
        let weight = match form {
            PolarFourierForm::RadiallyWeighted => radius.sqrt().recip(),
            _ => 1.0,
        };
        Row { ring, part, n_kept, weight }
    };
    let mut rows = Vec::new();
    for ring in 0..n_rings {
        let position = ring as f64 + 1.0;
        rows.push(row(ring, Part::Ring, position));
        if interleaved && ring + 1 < n_rings {
            rows.push(row(ring, Part::Sum, position + 0.5));
            rows.push(row(ring, Part::Difference, position + 0.5));
        }
    }
    rows
}

/// The geometric mean of the magnitudes of F(1), F(k) and F(k + 1), times the sine of the
/// phase of F(1)·F(k)·F*(k + 1).
fn signed_product(spectrum: &[Complex<f64>], frequency: usize) -> f64 {
    let product = spectrum[1] * spectrum[frequency] * spectrum[frequency + 1].conj();
    let magnitude = product.norm_sqr().sqrt();
    if magnitude > 0.0 { magnitude.cbrt() * product.im / magnitude } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::test_support::{
        any_image, check_quarter_turn, feature, mirrored, turned_affinity,
    };
    use crate::descriptor::{DescriptorKind, affinity, normalize};

    const FORMS: [DescriptorKind; 4] = [
        DescriptorKind::PolarFourier,
        DescriptorKind::PolarFourierRw,
        DescriptorKind::PolarFourierNi,
        DescriptorKind::PolarFourierSigned,
    ];

    #[test]
    fn a_6x6_image_has_the_equations_rows_and_frequencies() {
        // N_i = round(4 i / 6) for i = 1 … 6: 1 (at least), 1, 2, 3, 3, 4; halfway between:
        // 1, 2 (5/3), 2 (7/3), 3, 4 (11/3). Interleaved rows count twice: 14 + 2 · 12.
        let dimension = |form| PolarFourier::new(6, 6, form).dimension();
        assert_eq!(dimension(PolarFourierForm::NonInterleaved), 14);
        assert_eq!(dimension(PolarFourierForm::Interleaved), 38);
        assert_eq!(dimension(PolarFourierForm::RadiallyWeighted), 38);
        assert_eq!(dimension(PolarFourierForm::Signed), 42); // k = 1, k = 1, k = 1 and 2
        assert_eq!(layout(6, PolarFourierForm::Interleaved).len(), 3 * 6 - 2);
    }

    /// Equations 4.11–4.14, row by row, with the transform as a sum.
    fn naive(image: &TactileImage, weighted: bool) -> Vec<f64> {
        let (d, n_angles) = (image.rows.min(image.cols), 16);
        let disc = Disc { rows: image.rows, cols: image.cols };
        let inside = |row: i64, col: i64| {
            row >= 0
                && col >= 0
                && row < image.rows as i64
                && col < image.cols as i64
                && disc.contains(row as usize, col as usize)
        };
        let (center_row, center_col) = disc.center();
        let ring = |i: usize| -> Vec<f64> {
            let at = |j: usize| {
                let (sin, cos) = (TAU * j as f64 / n_angles as f64).sin_cos();
                let (row, col) =
                    (center_row + i as f64 / 2.0 * sin, center_col + i as f64 / 2.0 * cos);
                Sample::bilinear(row, col, image.cols, inside).of(&image.pressures)
            };
            (0..n_angles).map(at).collect()
        };
        let mut found = Vec::new();
        let mut record = |values: Vec<f64>, position: f64| {
            let n = (((d as f64 / 2.0 + 1.0) * position / d as f64).round() as usize).max(1);
            for k in 0..n {
                let part =
                    |j: usize| values[j] * Complex::cis(-TAU * (j * k) as f64 / n_angles as f64);
                let magnitude = (0..n_angles).map(part).sum::<Complex<f64>>().norm();
                found.push(if weighted { magnitude / (position / 2.0).sqrt() } else { magnitude });
            }
        };
        for i in 1..=d {
            record(ring(i), i as f64);
            if i < d {
                let (inner, outer) = (ring(i), ring(i + 1));
                let both = |sign: f64| {
                    inner.iter().zip(&outer).map(|(a, b)| (a + sign * b) / 2.0).collect()
                };
                record(both(1.0), i as f64 + 0.5);
                record(both(-1.0), i as f64 + 0.5);
            }
        }
        normalize(&mut found);
        found
    }

    proptest! {
        #[test]
        fn the_feature_is_the_naive_sum_over_each_row(image in any_image(5, 7)) {
            for (kind, weighted) in [(FORMS[0], false), (FORMS[1], true)] {
                let (naive, found) = (naive(&image, weighted), feature(kind, &image));
                prop_assert_eq!(naive.len(), found.len());
                prop_assert!(naive.iter().zip(&found).all(|(a, b)| (a - b).abs() < 1e-12));
            }
        }

        #[test]
        fn quarter_turns_change_nothing(square in any_image(6, 6), long in any_image(5, 8)) {
            for kind in FORMS {
                check_quarter_turn(kind, &square, 1e-9);
                check_quarter_turn(kind, &long, 1e-9);
            }
        }

        #[test]
        fn rotation_of_a_smooth_image_changes_little(angle in -3.1..3.1_f64) {
            for kind in FORMS {
                let kept = turned_affinity(kind, angle);
                prop_assert!(kept > 0.999, "{kind:?}: {kept}");
            }
        }

        #[test]
        fn only_the_signed_form_distinguishes_mirror_images(image in any_image(8, 8)) {
            let kept = |kind| affinity(&feature(kind, &image), &feature(kind, &mirrored(&image)));
            prop_assert!(kept(FORMS[0]) > 1.0 - 1e-9);
            prop_assert!(kept(FORMS[3]) < 1.0 - 1e-9);
        }
    }

    #[test]
    fn only_interleaving_detects_rings_turned_against_each_other() {
        // The prose of 4.3.2.5.1: single rings cannot detect it, their sums and differences
        // can. Two lobes, straight and wound up by 0.5 rad a taxel.
        let lobes = |winding: f64| {
            let at = |n: usize| {
                let (x, y) = ((n % 24) as f64 - 11.5, (n / 24) as f64 - 11.5);
                let angle = y.atan2(x) - winding * x.hypot(y);
                5_000.0 * (1.0 + (2.0 * angle).cos())
            };
            TactileImage { rows: 24, cols: 24, pressures: (0..576).map(at).collect() }
        };
        let lost = |kind| 1.0 - affinity(&feature(kind, &lobes(0.0)), &feature(kind, &lobes(0.5)));
        let (interleaved, alone) = (lost(FORMS[0]), lost(FORMS[2]));
        assert!(interleaved > 2.0 * alone, "{interleaved} and {alone}");
    }
}
