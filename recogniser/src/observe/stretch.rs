//! The stretch of contacts, which lie along ridges and shafts; it has no sign (equation R6).

use palpate_core::exponential::exp;

/// Cap on the concentration: the stretches of two touches of one place differ by random angles,
/// however long they are.
const CONCENTRATION_MAX: f32 = 7.0;

/// Share of touches with an uninformative stretch, even if the sensor is steady.
pub(crate) const OUTLIERS: f32 = 0.05;

/// Ratio of the density of the angle between two stretches to a uniform one: von Mises in the
/// double angle, with a share of `outliers`. `cosine` is that of the angle itself.
///
/// Equation R6 of docs/recogniser.md.
#[inline]
pub(crate) fn stretch_ratio(concentration: f32, cosine: f32, outliers: f32) -> f32 {
    // ln I₀(κ) ≈ s − 1 − ½ ln s with s = √(1 + κ²): exact for κ → 0, and to 0.08 for κ → ∞.
    let concentration = concentration.min(CONCENTRATION_MAX);
    let root = (1.0 + concentration * concentration).sqrt();
    let likelier = exp(concentration * (2.0 * cosine * cosine - 1.0) - root + 1.0) * root.sqrt();
    (1.0 - outliers) * likelier + outliers
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;

    #[test]
    fn the_ratio_is_one_in_the_mean_over_angles() {
        for concentration in [0.0, 0.3, 1.0, 2.0, 4.0, 10.0] {
            let n = 1_000;
            let weight =
                |step: i32| stretch_ratio(concentration, (step as f32 * TAU / 1e3).cos(), 0.05);
            let mean = (0..n).map(weight).sum::<f32>() / n as f32;
            assert!((mean - 1.0).abs() < 0.09, "{concentration}: {mean}");
        }
        assert!((stretch_ratio(0.0, 0.7, 0.05) - 1.0).abs() < 1e-6);
        let along = stretch_ratio(2.0, 1.0, 0.05);
        assert!((stretch_ratio(2.0, -1.0, 0.05) - along).abs() < 1e-6, "without sign");
        // From along to across 2κ = 4, without the outliers.
        let ratio = ((along - 0.05) / (stretch_ratio(2.0, 0.0, 0.05) - 0.05)).ln();
        assert!((ratio - 4.0).abs() < 1e-3, "{ratio}");
        assert!(
            (stretch_ratio(7.0, 0.9, 0.05) - stretch_ratio(50.0, 0.9, 0.05)).abs() < 1e-6,
            "never surer"
        );
    }
}
