//! Agreement: similarity of the features of two touches (equation R7).
//!
//! Touches of one place mostly agree far better than their covariance implies and sometimes, at
//! edges, far worse; hence the heavy tails of [`kernel`].

/// Maximum number of axes of the appearance space.
pub const N_AXES: usize = 8;

/// A feature: coordinates in the appearance space, in standard deviations of two touches of one
/// place.
pub type Feature = [f32; N_AXES];

/// A stored feature, quantised in steps of a sixteenth.
pub type StoredFeature = [i8; N_AXES];

/// Steps of a stored feature per deviation.
pub(crate) const STEPS: f32 = 16.0;

/// Share of touches with arbitrary appearance, so that none is impossible.
const OUTLIERS: f32 = 0.05;

/// Quantises a feature for storage; values beyond ±8 deviations are clamped.
#[must_use]
pub fn stored(feature: &Feature) -> StoredFeature {
    feature.map(|value| (value * STEPS).round() as i8)
}

/// Restores a stored feature, to half a step.
#[must_use]
pub fn unstored(feature: &StoredFeature) -> Feature {
    feature.map(|steps| f32::from(steps) / STEPS)
}

/// Agreement of two touches: Student's t with three degrees of freedom in eight dimensions,
/// not normalised; `softness` scales the variance.
#[inline]
#[must_use]
pub fn kernel(feature: &Feature, other: &StoredFeature, softness: f32) -> f32 {
    let mut square = 0.0;
    for (value, stored) in feature.iter().zip(other) {
        let difference = value - f32::from(*stored) * (1.0 / STEPS);
        square += difference * difference;
    }
    kernel_of(square, softness)
}

/// [`kernel`] of a squared distance, in deviations.
#[inline]
pub(super) fn kernel_of(square: f32, softness: f32) -> f32 {
    let inverse = (1.0 + square / (3.0 * softness)).recip();
    // The exponent is (3 + 8) / 2 = 5½.
    let squared = inverse * inverse;
    squared * squared * inverse * inverse.sqrt()
}

/// Appearance ratio: density of a feature at the place of `other` over that anywhere. Equation
/// R7 of docs/recogniser.md. `density` is that of
/// [`density_anywhere`](super::appearance::AppearanceSpace::density_anywhere).
#[inline]
#[must_use]
pub fn ratio(feature: &Feature, other: &StoredFeature, softness: f32, density: f32) -> f32 {
    ratio_of(kernel(feature, other, softness), density)
}

/// [`ratio`] of an agreement.
#[inline]
pub(super) fn ratio_of(agreement: f32, density: f32) -> f32 {
    (1.0 - OUTLIERS) * agreement / density + OUTLIERS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_features_agree_fully_and_others_as_student_says() {
        let feature = [1.5, -2.0, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!((kernel(&feature, &stored(&feature), 0.6) - 1.0).abs() < 1e-6);
        // A squared distance of three times the softness: (1 + 1)^(−11/2) = 0.022097.
        let mut other = feature;
        other[7] = 3.0;
        assert!((kernel(&other, &stored(&feature), 3.0) - 0.022_097).abs() < 1e-5);
        // 0.95 · 1/0.5 + 0.05; and however unlike, the share of outliers stays.
        assert!((ratio(&feature, &stored(&feature), 0.6, 0.5) - 1.95).abs() < 1e-5);
        other[7] = 1e6;
        assert!((ratio(&other, &stored(&feature), 0.6, 0.5) - 0.05).abs() < 1e-6);
    }

    #[test]
    fn a_stored_feature_stays_within_its_range() {
        // 16 steps a deviation: −3.1 is −49.6, rounded; beyond ±8 is the end.
        let feature = [-3.1, 1e9, -1e9, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(stored(&feature), [-50, 127, -128, 0, 0, 0, 0, 0]);
    }
}
