//! Objects that move a little at every touch.
//!
//! Source: section 4.4.2.4: up to 10° in orientation and 10 % of the object's width in
//! translation, both at once, each time a reading is taken. Moves add up, so they are kept
//! within the workspace (`docs/equations.md`).

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;
use palpate_core::units::DEG;

use crate::mesh::Mesh;

/// Limits of an object's motion at one touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// Largest turn about the middle of the object, radians.
    pub angle_max: f64,
    /// Longest translation, metres.
    pub shift_max: f64,
}

impl Perturbation {
    /// The dissertation's limits: 10° and a tenth of the object's width, here its largest
    /// dimension.
    #[must_use]
    pub fn printed(mesh: &Mesh) -> Self {
        Self { angle_max: 10.0 * DEG, shift_max: 0.1 * mesh.largest_dimension() }
    }

    /// A random pose near `session_from_object`. The object turns about `middle_in_object`
    /// (metres) and shifts; angle and length are uniform, axis and direction uniform on the
    /// sphere.
    #[must_use]
    pub fn drawn(
        &self,
        session_from_object: Pose,
        middle_in_object: DVec3,
        stream: &mut Stream,
    ) -> Pose {
        let axis = stream.direction();
        let turn = DQuat::from_axis_angle(axis, stream.uniform(0.0, self.angle_max));
        let direction = stream.direction();
        let shift = direction * stream.uniform(0.0, self.shift_max);
        let middle = session_from_object * middle_in_object;
        let rotation = turn * session_from_object.rotation;
        let moved = Pose::from_parts(rotation, DVec3::ZERO);
        Pose::from_parts(rotation, middle + shift - moved * middle_in_object)
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::Purpose;
    use palpate_core::units::MM;

    use super::*;
    use crate::mesh::tests_support::cuboid;

    #[test]
    fn an_object_turns_about_its_middle_within_its_limits() {
        let box_of_80_mm = cuboid(DVec3::new(80.0 * MM, 30.0 * MM, 20.0 * MM));
        let perturbation = Perturbation::printed(&box_of_80_mm);
        assert!((perturbation.shift_max - 8.0 * MM).abs() < 1e-12);
        let mut stream = Stream::new(1, Purpose::Perturbation, 0);
        let before = Pose::from_parts(stream.rotation(), DVec3::new(0.1, 0.2, 0.3));
        let middle = DVec3::new(0.05, 0.0, 0.0);
        let (mut widest, mut longest) = (0.0f64, 0.0f64);
        for _ in 0..500 {
            let after = perturbation.drawn(before, middle, &mut stream);
            widest = widest.max(after.angle_to(&before));
            longest = longest.max((after * middle).distance(before * middle));
        }
        assert!((9.5 * DEG..=10.0 * DEG + 1e-9).contains(&widest), "{widest}");
        assert!((7.6 * MM..=8.0 * MM + 1e-9).contains(&longest), "{longest}");
    }
}
