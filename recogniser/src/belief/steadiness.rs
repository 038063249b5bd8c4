//! How steadily the sensor stands in a touch: how far its normal and its stretch can be trusted.
//!
//! A sensor that bears evenly on a surface stands as the surface lies. One that meets a corner, a
//! tip or a ledge, or touches with its rim alone, may come to rest almost any way round, as it
//! happens when a press comes along a ray from outside. The evenness of the pressure tells which:
//! of 15,901 contacts along rays at ten objects (the dissertation's sensor, facing a touch of the
//! map within 70°) normals were off by 0.06 rad in the median where the mean pressure was above
//! half of the peak, by 0.31 rad down to a third, and by 0.63 rad below.

use super::stretch::OUTLIERS;

/// A sensor pressed as evenly as this stands as the surface lies.
const EVEN: f32 = 0.53;

/// Deviation of the normal (rad), and the share of stretches that say nothing, for all that is
/// missing of it.
const NORMAL_PER_UNEVENNESS: f32 = 1.83;
const OUTLIERS_PER_UNEVENNESS: f32 = 2.25;

/// Variance of a steady touch's normal about either axis, of the map and its own, rad².
const USUAL_VARIANCE: f32 = 0.03;

/// However unevenly it is pressed, some stretches say something.
const OUTLIERS_MAX: f32 = 0.9;

/// How steadily the sensor stood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Steadiness {
    /// Variance of the normal about either axis beyond what is usual at the place, rad².
    pub(super) normal_variance: f32,
    /// The share of stretches that say nothing.
    pub(super) stretch_outliers: f32,
}

impl Steadiness {
    /// Of a touch of such evenness ([`crate::surface::Touch::evenness`]).
    pub(super) fn new(evenness: f64) -> Self {
        let missing = (EVEN - evenness as f32).max(0.0);
        Self {
            normal_variance: (NORMAL_PER_UNEVENNESS * missing).powi(2),
            stretch_outliers: (OUTLIERS + OUTLIERS_PER_UNEVENNESS * missing).min(OUTLIERS_MAX),
        }
    }

    /// How much less well (ln) even its own place explains such a touch than a steady one: its
    /// normal may lie anywhere in a wider range, whatever was touched.
    pub(super) fn loss(&self) -> f32 {
        (1.0 + self.normal_variance / USUAL_VARIANCE).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_less_evenly_a_sensor_is_pressed_the_less_it_is_trusted() {
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
