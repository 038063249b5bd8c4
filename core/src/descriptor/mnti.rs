//! MNTI: the moment-normalised image's Fourier magnitudes, indifferent to small shifts.
//!
//! Source: section 4.3.2.5.2; size, padding and kept frequencies as in `docs/equations.md`:
//! each side grows to ⌈1.5 n⌉ by a periodic ramp (border/2, 0, border/2), and the lowest
//! frequencies, as many as the original image has, stay without their conjugate duplicates.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::moment_normalized::moment_normalize;
use crate::reading::TactileImage;

/// The MNTI descriptor, not normalised: (cols / 2 + 1) × rows magnitudes, less the conjugate
/// duplicates in the columns of frequency 0 and, for an even width, of the highest one.
#[must_use]
pub fn mnti(image: &TactileImage) -> Vec<f64> {
    let turned = moment_normalize(image).image;
    let (rows, cols) = (enlarged(image.rows), enlarged(image.cols));
    let mut spectrum: Vec<Complex<f64>> =
        pad(&turned, rows, cols).into_iter().map(|value| Complex::new(value, 0.0)).collect();
    transform(&mut spectrum, rows, cols);
    low_frequencies(image.rows, image.cols)
        .map(|(row, col)| {
            let (r, c) = (row.rem_euclid(rows as i64), col.rem_euclid(cols as i64));
            spectrum[r as usize * cols + c as usize].norm()
        })
        .collect()
}

fn enlarged(side: usize) -> usize {
    (3 * side).div_ceil(2)
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

/// The image in the corner of a larger periodic one: from each last value the padding falls
/// linearly to 0 and rises to the first value of the next period.
fn pad(image: &TactileImage, rows: usize, cols: usize) -> Vec<f64> {
    let wide: Vec<Vec<f64>> = (0..image.rows)
        .map(|row| pad_line(&image.pressures[row * image.cols..(row + 1) * image.cols], cols))
        .collect();
    let mut padded = vec![0.0; rows * cols];
    for col in 0..cols {
        let column: Vec<f64> = wide.iter().map(|line| line[col]).collect();
        for (row, value) in pad_line(&column, rows).into_iter().enumerate() {
            padded[row * cols + col] = value;
        }
    }
    padded
}

fn pad_line(line: &[f64], length: usize) -> Vec<f64> {
    let (first, last, gap) = (line[0], line[line.len() - 1], length - line.len());
    let middle = (gap as f64 + 1.0) / 2.0;
    let ramp = (1..=gap).map(|step| {
        let from_last = 1.0 - step as f64 / middle;
        if from_last >= 0.0 { last * from_last } else { first * -from_last }
    });
    line.iter().copied().chain(ramp).collect()
}

/// The forward 2-D transform of a row-major image, in place.
fn transform(values: &mut [Complex<f64>], rows: usize, cols: usize) {
    let mut planner = FftPlanner::new();
    planner.plan_fft_forward(cols).process(values);
    let mut columns: Vec<Complex<f64>> = (0..cols)
        .flat_map(|col| (0..rows).map(move |row| (row, col)))
        .map(|(row, col)| values[row * cols + col])
        .collect();
    planner.plan_fft_forward(rows).process(&mut columns);
    for (index, value) in columns.into_iter().enumerate() {
        values[(index % rows) * cols + index / rows] = value;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::test_images::blob;
    use crate::descriptor::{DescriptorKind, affinity};

    #[test]
    fn the_ramp_is_half_zero_half() {
        // Six values, padded to nine: border/2, 0, border/2.
        let padded = pad_line(&[8.0, 1.0, 1.0, 1.0, 1.0, 4.0], 9);
        assert_eq!(padded[6..], [2.0, 0.0, 4.0]);
    }

    #[test]
    fn a_6x6_image_has_25_magnitudes() {
        // Frequencies −3..=3 × −3..=3 are 49; without duplicates (49 + 1) / 2 = 25.
        assert_eq!(mnti(&blob(6, 0.1, 0.0, 0.0)).len(), 25);
    }

    #[test]
    fn the_zero_frequency_is_the_sum_of_the_padded_image() {
        let image = blob(6, 0.0, 0.0, 0.0);
        let padded = pad(&moment_normalize(&image).image, 9, 9);
        assert!((mnti(&image)[0] / padded.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn rotation_changes_little(angle in -3.1..3.1_f64) {
            // Bilinear resampling of 14 × 14 taxels costs a few per cent, no more.
            let straight = DescriptorKind::Mnti.describe(&blob(14, 0.0, 0.0, 0.0));
            let turned = DescriptorKind::Mnti.describe(&blob(14, angle, 0.0, 0.0));
            prop_assert!(affinity(&straight, &turned) > 0.99);
        }

        #[test]
        fn a_small_shift_changes_mnti_less_than_the_raw_image(dx in 0.3..0.6_f64, dy in 0.3..0.6_f64) {
            let kept = |kind: DescriptorKind| {
                affinity(&kind.describe(&blob(14, 0.0, 0.0, 0.0)), &kind.describe(&blob(14, 0.0, dx, dy)))
            };
            prop_assert!(kept(DescriptorKind::Mnti) > kept(DescriptorKind::Vectorize));
        }
    }
}
