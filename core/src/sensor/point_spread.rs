//! The point spread of a covering: the width of one indentation in the image.
//!
//! Source: section 2.3.2, equation 2.5, with units settled in `docs/equations.md`: both the
//! spread and the covering's thickness count in element widths of the 2 mm DigiTacts pitch.

use crate::units::MM;

/// The element width of equation 2.5, in metres.
pub const ELEMENT_WIDTH: f64 = 2.0 * MM;
/// The spread without any covering, in element widths (equation 2.5).
pub const SPREAD_OFFSET: f64 = 1.11;
/// Increase of the spread per element width of covering (equation 2.5).
pub const SPREAD_SLOPE: f64 = 0.497;

/// The standard deviation (metres) of the Gaussian point spread under a covering of
/// `thickness` metres. Equation 2.5: σ⁺ ≈ 1.11 + 0.497 t, in element widths.
#[must_use]
pub fn point_spread_of_covering(thickness: f64) -> f64 {
    (SPREAD_OFFSET + SPREAD_SLOPE * thickness / ELEMENT_WIDTH) * ELEMENT_WIDTH
}

/// The separable kernel of a Gaussian of deviation `sigma`, sampled every `step` (both in the
/// same unit), cut off at three deviations; odd length, sums to 1 (equation 2.2 as corrected).
#[must_use]
pub fn gaussian_kernel(sigma: f64, step: f64) -> Vec<f64> {
    let radius = (3.0 * sigma / step).ceil().max(0.0) as i64;
    let mut kernel: Vec<f64> = (-radius..=radius)
        .map(|offset| (-0.5 * (offset as f64 * step / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|weight| *weight /= sum);
    kernel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::INCH;

    #[test]
    fn the_four_coverings_of_the_dissertation() {
        // docs/equations.md: 0.04, 0.10, 0.14, 0.20 inch give 1.3625, 1.741, 1.994, 2.372.
        for (inches, expected) in [(0.04, 1.3625), (0.10, 1.741), (0.14, 1.994), (0.20, 2.372)] {
            let elements = point_spread_of_covering(inches * INCH) / ELEMENT_WIDTH;
            assert!((elements - expected).abs() < 1e-3, "{inches} inch: {elements}");
        }
    }

    #[test]
    fn the_kernel_sums_to_one_and_is_symmetric() {
        let kernel = gaussian_kernel(1.36, 0.5);
        assert!((kernel.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(kernel.iter().zip(kernel.iter().rev()).all(|(a, b)| (a - b).abs() < 1e-15));
    }
}
