//! Errors of the tool centre: one shift of all touches in the sensor's frame (equation R21a).
//!
//! Where a robot believes its sensor to be, how deep a covering of unknown stiffness is pressed
//! in, and where the centre of pressure lies are wrong by the same vector in every touch. Most
//! errors are small and a few are large, so the prior is Cauchy's in three dimensions.

use glam::Vec3;

use crate::options::RefinementScale;

/// ln prior density of an error relative to none.
#[inline]
pub(crate) fn log_density(tool: Vec3, scale: &RefinementScale) -> f32 {
    // Most hypotheses have no error, and a logarithm costs as much as half a touch.
    if tool == Vec3::ZERO {
        return 0.0;
    }
    -2.0 * (tool.length_squared() / (scale.tool * scale.tool)).ln_1p()
}

/// Information (m⁻²) of the prior about each component, as of the Gaussian with the same slope.
pub(crate) fn information(tool: Vec3, scale: &RefinementScale) -> f64 {
    4.0 / f64::from(scale.tool * scale.tool + tool.length_squared())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::SurfaceOptions;

    #[test]
    fn a_large_error_costs_little_more_than_a_small_one() {
        let scale = SurfaceOptions::default().refinement;
        let cost = |mm: f32| -log_density(Vec3::X * mm * scale.tool, &scale);
        // 2 ln 2 at the usual error, 2 ln 26 at five times as much; a Gaussian's cost would be
        // 25 times as high.
        assert!((cost(1.0) - 2.0 * 2f32.ln()).abs() < 1e-5);
        assert!((cost(5.0) - 2.0 * 26f32.ln()).abs() < 1e-5);
        assert!(cost(0.0).abs() < 1e-9);
    }

    #[test]
    fn the_information_is_the_slope_over_the_error() {
        let scale = SurfaceOptions::default().refinement;
        for of_usual in [0.5f32, 1.0, 4.0] {
            let at = |x: f32| f64::from(log_density(Vec3::X * x, &scale));
            let (x, step) = (of_usual * scale.tool, 1e-3 * scale.tool);
            let slope = (at(x + step) - at(x - step)) / f64::from(2.0 * step);
            let found = information(Vec3::X * x, &scale) * f64::from(x);
            assert!((slope + found).abs() < 0.02 * found, "{slope} {found}");
        }
    }
}
