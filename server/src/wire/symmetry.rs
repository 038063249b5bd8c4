//! Conversion of symmetries.

use palpate_core::pose::Pose;
use palpate_core::symmetry::{AxisOrder, Symmetry, SymmetryAxis};
use palpate_schemas as wire;

/// The axes of an object's symmetry in the frame of a pose of the object; the identity gives
/// the object's own frame.
pub(crate) fn axes(symmetry: &Symmetry, frame_from_object: &Pose) -> Vec<wire::SymmetryAxis> {
    let axis = |axis: &SymmetryAxis| wire::SymmetryAxis {
        point: (*frame_from_object * axis.point).to_array(),
        direction: frame_from_object.turn(axis.direction).to_array(),
        order: match axis.order {
            AxisOrder::Finite(order) => Some(order),
            AxisOrder::Continuous => None,
        },
    };
    symmetry.axes.iter().map(axis).collect()
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    #[test]
    fn axes_move_with_their_object() {
        let axes_of = [(DVec3::Z, AxisOrder::Continuous), (DVec3::X, AxisOrder::Finite(2))];
        let symmetry = Symmetry::through(DVec3::new(0.01, 0.0, 0.02), &axes_of);
        // A quarter turn about z takes x to y, then 5 cm up.
        let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let found = axes(&symmetry, &Pose::from_parts(turn, DVec3::new(0.0, 0.0, 0.05)));
        assert_eq!(found.iter().map(|axis| axis.order).collect::<Vec<_>>(), [None, Some(2)]);
        for axis in &found {
            let off = DVec3::from_array(axis.point) - DVec3::new(0.0, 0.01, 0.07);
            assert!(off.length() < 1e-12, "{axis:?}");
        }
        let directions = found.iter().map(|axis| DVec3::from_array(axis.direction));
        for (direction, expected) in directions.zip([DVec3::Z, DVec3::Y]) {
            assert!(direction.distance(expected) < 1e-12);
        }
        assert!(axes(&Symmetry::NONE, &Pose::IDENTITY).is_empty());
    }
}
