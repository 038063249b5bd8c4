//! What a sensor probably does where its data sheet is silent. The presets are made of it.
//!
//! Not here: the point spread of a covering (`point_spread`), which is equation 2.5.

use super::ForceCurve;
use crate::units::MM;

/// The noise's deviation as a share of the saturation. Chosen: the DigiTacts preset's, 0.1 kPa of
/// 20 kPa, and what data sheets of arrays call an accuracy of half a percent.
const NOISE_SHARE: f64 = 1.0 / 200.0;

/// A straight line from no pressure to the saturation (Pa) where the covering of `thickness`
/// (metres) is fully indented.
///
/// # Panics
/// Never: whatever comes, the line rises. (Numbers out of range are refused with the description.)
#[must_use]
pub fn force_curve(thickness: f64, saturation: f64) -> ForceCurve {
    let end = |value: f64, least: f64| if value.is_finite() { value.max(least) } else { least };
    ForceCurve::new(vec![(0.0, 0.0), (end(thickness, 0.1 * MM), end(saturation, 0.0))])
        .expect("the second of two knots is further and not lower")
}

/// The deviation (Pa) of the noise of a sensor that saturates at `saturation` and whose converter
/// has steps of `quantisation`: a step, or half a percent of the range where that is more.
#[must_use]
pub fn noise(saturation: f64, quantisation: f64) -> f64 {
    (NOISE_SHARE * saturation).max(quantisation)
}
