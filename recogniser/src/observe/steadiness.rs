//! Steadiness: reliability of the normal and the stretch of a touch (equation R3).
//!
//! A sensor that presses evenly on a surface is aligned with it. One that meets a corner, a tip
//! or a ledge, or touches with its rim alone, may come to rest in almost any orientation. The
//! evenness of the pressure distinguishes these cases: of 15,901 contacts along rays at ten
//! objects (the dissertation's sensor, facing a patch of the map within 70°) the median error of
//! normals was 0.06 rad where the mean pressure was above half of the peak, 0.31 rad down to a
//! third, and 0.63 rad below.

use super::stretch::OUTLIERS;

/// Evenness from which a sensor is aligned with the surface.
const EVEN: f32 = 0.53;

/// Deviation of the normal (rad) per missing evenness.
const NORMAL_PER_UNEVENNESS: f32 = 1.83;

/// Share of uninformative stretches per missing evenness.
const OUTLIERS_PER_UNEVENNESS: f32 = 2.25;

/// Cap on the share of uninformative stretches.
const OUTLIERS_MAX: f32 = 0.9;

/// Variance of a steady touch's normal about either axis, map and touch together, rad².
const STEADY_VARIANCE: f32 = 0.03;

/// Reliability of the sensor's orientation in a touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Steadiness {
    /// Variance of the normal about either axis, in addition to that of the place, rad².
    pub(crate) normal_variance: f32,
    /// Share of uninformative stretches.
    pub(crate) stretch_outliers: f32,
}

impl Steadiness {
    /// What the normal of a steady touch adds to its score (ln): the peak of R5.
    pub(crate) fn normal_worth() -> f32 {
        (2.0 / STEADY_VARIANCE).ln()
    }

    /// Steadiness of a touch by its [evenness](super::touch::Touch::evenness). Equation R3 of
    /// docs/recogniser.md.
    pub(crate) fn new(evenness: f64) -> Self {
        let missing = (EVEN - evenness as f32).max(0.0);
        Self {
            normal_variance: (NORMAL_PER_UNEVENNESS * missing).powi(2),
            stretch_outliers: (OUTLIERS + OUTLIERS_PER_UNEVENNESS * missing).min(OUTLIERS_MAX),
        }
    }

    /// Steadiness of a contact without an image, whose normal has its own deviation (rad).
    pub(crate) fn of_normal(deviation: f64) -> Self {
        Self { normal_variance: deviation.powi(2) as f32, stretch_outliers: OUTLIERS }
    }

    /// Loss of score (ln) against a steady touch, even at its own place and on any object,
    /// because its normal has a wider range. Part of equation R13.
    pub(crate) fn loss(&self) -> f32 {
        (1.0 + self.normal_variance / STEADY_VARIANCE).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_pressed_less_evenly_is_trusted_less() {
        let even = Steadiness { normal_variance: 0.0, stretch_outliers: OUTLIERS };
        assert_eq!([1.0, 0.6, 0.54].map(Steadiness::new), [even; 3]);
        // 0.2 missing: 0.37 rad, and half of the stretches.
        let uneven = Steadiness::new(0.33);
        assert!((uneven.normal_variance.sqrt() - 0.366).abs() < 1e-3, "{uneven:?}");
        assert!((uneven.stretch_outliers - 0.5).abs() < 1e-3, "{uneven:?}");
        // ln(1 + 0.134/0.03).
        assert!((uneven.loss() - 1.698).abs() < 1e-2 && even.loss().abs() < 1e-6);
        assert!((Steadiness::new(0.0).stretch_outliers - OUTLIERS_MAX).abs() < 1e-6);
    }
}
