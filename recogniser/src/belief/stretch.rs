//! How well the stretches of two contacts agree: they lie along ridges and shafts, without sign.

use palpate_core::exponential::exp;

/// Of two touches of one place the stretches are turned against one another by chance however
/// long they are: no higher concentration is seen.
const CONCENTRATION_MAX: f32 = 7.0;

/// The share of touches whose stretch says nothing, however steadily the sensor stands.
pub(super) const OUTLIERS: f32 = 0.05;

/// Von Mises in the double angle between two directions without sign, with a share of `outliers`,
/// relative to an even distribution; `cosine` is that of the angle itself.
#[inline]
pub(super) fn aligned(concentration: f32, cosine: f32, outliers: f32) -> f32 {
    // exp κ(2 cos² − 1)/I₀(κ); ln I₀(κ) ≈ s − 1 − ½ ln s with s = √(1 + κ²): exact for κ → 0,
    // and to 0.08 for κ → ∞.
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
    fn directions_of_any_angle_weigh_one_in_the_mean() {
        for concentration in [0.0, 0.3, 1.0, 2.0, 4.0, 10.0] {
            let n = 1_000;
            let weight = |step: i32| aligned(concentration, (step as f32 * TAU / 1e3).cos(), 0.05);
            let mean = (0..n).map(weight).sum::<f32>() / n as f32;
            assert!((mean - 1.0).abs() < 0.09, "{concentration}: {mean}");
        }
        assert!((aligned(0.0, 0.7, 0.05) - 1.0).abs() < 1e-6);
        let along = aligned(2.0, 1.0, 0.05);
        assert!((aligned(2.0, -1.0, 0.05) - along).abs() < 1e-6, "without sign");
        // From along to across 2κ = 4, of what is no outlier.
        let ratio = ((along - 0.05) / (aligned(2.0, 0.0, 0.05) - 0.05)).ln();
        assert!((ratio - 4.0).abs() < 1e-3, "{ratio}");
        assert!((aligned(7.0, 0.9, 0.05) - aligned(50.0, 0.9, 0.05)).abs() < 1e-6, "never surer");
    }
}
