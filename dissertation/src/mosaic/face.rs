//! How deep a face is pressed into the covering, from the pressures of its mosaic.
//!
//! Under the point spread a narrow face shows less pressure than a wide one at the same depth,
//! so pressures bound the depth from below; no press is deeper than the covering is thick.
//! Within these bounds every depth is taken to be equally likely.

use super::ForceMosaic;
use palpate_core::sensor::SensorDescription;

/// How far the sensor's free surface is below a face that is pressed, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceDepth {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub deviation: f64,
}

impl FaceDepth {
    /// The depth of the presses that made a mosaic, by a sensor of this kind.
    ///
    /// The largest displacement of the mosaic is the least depth. Derived: the mean and the
    /// deviation are those of the uniform distribution between the bounds.
    #[must_use]
    pub fn of_mosaic(mosaic: &ForceMosaic, sensor: &SensorDescription) -> Self {
        let known = mosaic.pressure().iter().zip(mosaic.deviation());
        let largest = known
            .filter(|(_, deviation)| deviation.is_finite())
            .fold(0.0, |largest: f32, (pressure, _)| largest.max(*pressure));
        let parameters = sensor.parameters();
        let deepest = parameters.covering_thickness;
        let least = parameters.force_curve.displacement(f64::from(largest)).min(deepest);
        Self { mean: 0.5 * (least + deepest), deviation: (deepest - least) / 12.0_f64.sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::occupancy::GridShape;
    use palpate_core::units::MM;

    fn mosaic(pressures: [f32; 2], deviations: [f32; 2]) -> ForceMosaic {
        let shape = GridShape::new(DVec3::ZERO, 1.0 * MM, [2, 1, 1]).unwrap();
        ForceMosaic::from_parts(shape, pressures.to_vec(), deviations.to_vec()).unwrap()
    }

    #[test]
    fn the_depth_lies_between_the_largest_displacement_and_the_covering() {
        let sensor = SensorDescription::digitacts_6x6();
        let parameters = sensor.parameters();
        let thickness = parameters.covering_thickness;
        let pressure = parameters.force_curve.pressure(0.5 * thickness) as f32;
        // What no press has reached is not looked at.
        let depth = FaceDepth::of_mosaic(&mosaic([pressure, 1e6], [1.0, f32::INFINITY]), &sensor);
        assert!((depth.mean - 0.75 * thickness).abs() < 1e-8, "{depth:?}");
        assert!((depth.deviation - 0.5 * thickness / 12.0_f64.sqrt()).abs() < 1e-8, "{depth:?}");
        let deep = FaceDepth::of_mosaic(&mosaic([1e6, 0.0], [1.0, 1.0]), &sensor);
        assert_eq!(deep, FaceDepth { mean: thickness, deviation: 0.0 });
    }
}
