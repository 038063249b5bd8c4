//! Depth of a face in the covering, from the pressures of its mosaic.
//!
//! Under the point spread a narrow face shows less pressure than a wide one at the same
//! depth, so pressures bound the depth from below; the covering's thickness bounds it from
//! above. Within these bounds the depth is taken to be uniform.

use super::ForceMosaic;
use palpate_core::sensor::SensorDescription;

/// Depth of the sensor's free surface below a pressed face, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaceDepth {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub deviation: f64,
}

impl FaceDepth {
    /// The depth of the presses of a mosaic, by a sensor of this kind.
    ///
    /// The largest displacement of the mosaic is the least depth. Derived: mean and deviation
    /// of the uniform distribution between the bounds.
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
    fn depth_lies_between_largest_displacement_and_covering() {
        let sensor = SensorDescription::digitacts_6x6();
        let parameters = sensor.parameters();
        let thickness = parameters.covering_thickness;
        let pressure = parameters.force_curve.pressure(0.5 * thickness) as f32;
        // Unmapped cells are ignored.
        let depth = FaceDepth::of_mosaic(&mosaic([pressure, 1e6], [1.0, f32::INFINITY]), &sensor);
        assert!((depth.mean - 0.75 * thickness).abs() < 1e-8, "{depth:?}");
        assert!((depth.deviation - 0.5 * thickness / 12.0_f64.sqrt()).abs() < 1e-8, "{depth:?}");
        let deep = FaceDepth::of_mosaic(&mosaic([1e6, 0.0], [1.0, 1.0]), &sensor);
        assert_eq!(deep, FaceDepth { mean: thickness, deviation: 0.0 });
    }
}
