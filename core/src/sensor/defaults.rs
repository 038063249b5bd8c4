//! Defaults of sensor properties that a data sheet leaves open; the presets use them.
//!
//! Not here: the point spread of a covering (`point_spread`), which is equation 2.5.

use super::ForceCurve;
use crate::units::MM;

/// Standard deviation of the noise relative to the saturation. Chosen: the DigiTacts
/// preset's, 0.1 kPa of 20 kPa, and what data sheets of arrays call an accuracy of half a
/// percent.
const NOISE_SHARE: f64 = 1.0 / 200.0;

/// A straight line from no pressure to the saturation (Pa) at full indentation of a covering
/// of `thickness` (metres).
///
/// # Panics
/// Never: the line rises for any numbers. (The description refuses numbers out of range.)
#[must_use]
pub fn force_curve(thickness: f64, saturation: f64) -> ForceCurve {
    let end = |value: f64, least: f64| if value.is_finite() { value.max(least) } else { least };
    ForceCurve::new(vec![(0.0, 0.0), (end(thickness, 0.1 * MM), end(saturation, 0.0))])
        .expect("the second of two knots is further and not lower")
}

/// Standard deviation (Pa) of the noise of a sensor with the given `saturation` and converter
/// step `quantisation`: the larger of one step and half a percent of the range.
#[must_use]
pub fn noise(saturation: f64, quantisation: f64) -> f64 {
    (NOISE_SHARE * saturation).max(quantisation)
}
