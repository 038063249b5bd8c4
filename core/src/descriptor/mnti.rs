//! MNTI: Fourier magnitudes of the moment-normalised image, insensitive to small shifts.
//!
//! Source: section 4.3.2.5.2; size, padding and kept frequencies as in `docs/equations.md`:
//! each side grows to ⌈1.5 n⌉ by a periodic ramp (border/2, 0, border/2), and the lowest
//! frequencies, as many as the original image has, are kept without their conjugate
//! duplicates.

use rustfft::num_complex::Complex;

use super::fourier::Fourier;
use super::moment_normalized::{MaskOrder, MomentNormalizer};
use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// MNTI for images of one shape.
#[derive(Clone, Debug)]
pub struct Mnti {
    normalizer: MomentNormalizer,
    fourier: Fourier,
    /// Rows and columns of the enlarged image.
    enlarged: (usize, usize),
    /// The ramps that enlarge a line along a row and along a column.
    ramps: [Vec<Ramp>; 2],
    /// Indices of the kept frequencies in the spectrum.
    kept: Vec<usize>,
}

/// One padding value: a fraction of the line's last or first value.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ramp {
    OfLast(f64),
    OfFirst(f64),
}

impl Mnti {
    /// Plans for images of `rows` × `cols` taxels. The dimension is nearly (cols / 2 + 1) ×
    /// rows: conjugate duplicates in the columns of frequency 0 are left out, and even sides
    /// keep both ends of their frequencies.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        Self::with_mask(rows, cols, MaskOrder::TurnFirst)
    }

    /// Like `new`, with the given mask order.
    #[must_use]
    pub fn with_mask(rows: usize, cols: usize, order: MaskOrder) -> Self {
        let enlarged = (enlarge(rows), enlarge(cols));
        let kept = low_frequencies(rows, cols).map(|(row, col)| {
            let row = row.rem_euclid(enlarged.0 as i64) as usize;
            col.rem_euclid(enlarged.1 as i64) as usize * enlarged.0 + row
        });
        Self {
            normalizer: MomentNormalizer::with_mask(rows, cols, order),
            fourier: Fourier::new(enlarged.0, enlarged.1),
            ramps: [ramp(enlarged.1 - cols), ramp(enlarged.0 - rows)],
            kept: kept.collect(),
            enlarged,
        }
    }

    /// The image in the corner of a larger periodic one. The padding falls linearly from each
    /// last value to 0 and rises to the first value of the next period.
    fn pad(&self, image: &[f64], padded: &mut [Complex<f64>]) {
        let (_, cols) = self.shape();
        let width = self.enlarged.1;
        for (row, line) in image.chunks_exact(cols).enumerate() {
            let ramp = self.ramps[0].iter().map(|step| step.between(line[cols - 1], line[0]));
            let wide = line.iter().copied().chain(ramp);
            for (value, place) in wide.zip(&mut padded[row * width..]) {
                *place = Complex::new(value, 0.0);
            }
        }
        let (lines, below) = padded.split_at_mut(image.len() / cols * width);
        let (first, last) = (&lines[..width], &lines[lines.len() - width..]);
        for (step, line) in self.ramps[1].iter().zip(below.chunks_exact_mut(width)) {
            for (col, place) in line.iter_mut().enumerate() {
                *place = Complex::new(step.between(last[col].re, first[col].re), 0.0);
            }
        }
    }
}

impl Descriptor for Mnti {
    fn shape(&self) -> (usize, usize) {
        self.normalizer.shape()
    }

    fn dimension(&self) -> usize {
        self.kept.len()
    }

    fn write(&self, image: &TactileImage, workspace: &mut Workspace, features: &mut [f64]) {
        let n = image.pressures.len();
        let n_enlarged = self.enlarged.0 * self.enlarged.1;
        let (turned, complexes) = workspace.lend(n, 2 * n_enlarged + self.fourier.n_scratch());
        let (padded, rest) = complexes.split_at_mut(n_enlarged);
        let (spectrum, scratch) = rest.split_at_mut(n_enlarged);
        self.normalizer.turn(&image.pressures, turned);
        self.pad(turned, padded);
        self.fourier.forward(padded, spectrum, scratch);
        for (feature, place) in features.iter_mut().zip(&self.kept) {
            *feature = spectrum[*place].norm();
        }
    }
}

impl Ramp {
    fn between(self, last: f64, first: f64) -> f64 {
        match self {
            Self::OfLast(share) => last * share,
            Self::OfFirst(share) => first * share,
        }
    }
}

fn enlarge(side: usize) -> usize {
    (3 * side).div_ceil(2)
}

/// Ramp of `gap` values that fall from the last value to 0 and rise to the first value.
fn ramp(gap: usize) -> Vec<Ramp> {
    let middle = (gap as f64 + 1.0) / 2.0;
    let share = |step: usize| 1.0 - step as f64 / middle;
    let step = |share: f64| if share >= 0.0 { Ramp::OfLast(share) } else { Ramp::OfFirst(-share) };
    (1..=gap).map(share).map(step).collect()
}

/// Frequencies (row, col) with |row| and |col| up to half the original sides, one of each
/// conjugate pair.
fn low_frequencies(rows: usize, cols: usize) -> impl Iterator<Item = (i64, i64)> {
    let half = |side: usize| (side / 2) as i64;
    let (half_rows, half_cols) = (half(rows), half(cols));
    (0..=half_cols).flat_map(move |col| {
        let first = if col == 0 { 0 } else { -half_rows };
        (first..=half_rows).map(move |row| (row, col))
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::test_support::{
        any_image, blob, check_quarter_turn, feature, turned_affinity,
    };
    use crate::descriptor::{DescriptorKind, affinity, normalize};

    #[test]
    fn the_ramp_is_half_zero_half() {
        // Six values, padded to nine: border/2, 0, border/2.
        let padded: Vec<f64> = ramp(3).iter().map(|step| step.between(4.0, 8.0)).collect();
        assert_eq!(padded, [2.0, 0.0, 4.0]);
    }

    #[test]
    fn a_6x6_image_has_25_magnitudes() {
        // Frequencies −3..=3 × −3..=3 are 49; without duplicates (49 + 1) / 2 = 25.
        assert_eq!(Mnti::new(6, 6).dimension(), 25);
    }

    #[test]
    fn mnti_is_the_naive_transform_of_the_padded_image() {
        let (rows, cols) = (4, 5); // padded to 6 × 8
        let mut stream = crate::rng::Stream::new(1, crate::rng::Purpose::Shape, 0);
        let pressures = (0..20).map(|_| stream.uniform(0.0, 9_000.0)).collect();
        let image = TactileImage { rows, cols, pressures };
        let mnti = Mnti::new(rows, cols);
        let mut padded = vec![Complex::default(); 48];
        mnti.pad(&mnti.normalizer.normalize(&image).image.pressures, &mut padded);
        let magnitude = |(k, l): (i64, i64)| {
            let part = |n: usize| {
                let turns = (k * (n / 8) as i64) as f64 / 6.0 + (l * (n % 8) as i64) as f64 / 8.0;
                padded[n] * Complex::cis(-TAU * turns)
            };
            (0..48).map(part).sum::<Complex<f64>>().norm()
        };
        let mut naive: Vec<f64> = low_frequencies(rows, cols).map(magnitude).collect();
        normalize(&mut naive);
        let found = feature(DescriptorKind::Mnti, &image);
        assert_eq!(naive.len(), found.len());
        assert!(naive.iter().zip(&found).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    proptest! {
        #[test]
        fn quarter_turns_keep_the_descriptor(image in any_image(6, 6)) {
            prop_assume!(!MomentNormalizer::new(6, 6).normalize(&image).ambiguous);
            check_quarter_turn(DescriptorKind::Mnti, &image, 1e-6);
        }

        #[test]
        fn rotation_of_a_smooth_image_changes_little(angle in -3.1..3.1_f64) {
            let kept = turned_affinity(DescriptorKind::Mnti, angle);
            prop_assert!(kept > 0.99, "{kept}");
        }

        #[test]
        fn a_small_shift_changes_mnti_less_than_its_controls(dx in 0.3..0.6_f64, dy in 0.3..0.6_f64) {
            let kept = |kind: DescriptorKind| {
                let (still, moved) = (blob(14, 0.0, 0.0, 0.0), blob(14, 0.0, dx, dy));
                affinity(&feature(kind, &still), &feature(kind, &moved))
            };
            prop_assert!(kept(DescriptorKind::Mnti) > kept(DescriptorKind::Vectorize));
            prop_assert!(kept(DescriptorKind::Mnti) > kept(DescriptorKind::MomentNormalized));
        }
    }
}
