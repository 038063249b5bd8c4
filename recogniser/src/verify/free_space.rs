//! Free space: the points of a press that contradict a pose (equation R11).

use crate::model::SurfaceMap;
use crate::observe::inverse_pose::InversePose;
use crate::observe::press_space::PressSpace;
use crate::options::ScoreScale;

/// Log-likelihood (ln) of a pose from the free and occupied points of a press: 0 without
/// contradictions, negative with them.
///
/// Equation R11 of docs/recogniser.md.
#[inline]
pub(crate) fn contradiction(
    space: &PressSpace,
    map: &SurfaceMap,
    pose: &InversePose,
    scale: &ScoreScale,
) -> f32 {
    let solid = map.solid();
    let mut sum = 0.0;
    let free = space.free.iter().filter(|point| solid.is_solid(pose.point(**point)));
    for _point in free {
        sum += scale.contradiction;
        if sum >= scale.contradictions_max {
            return -space.weight * scale.contradictions_max;
        }
    }
    let occupied = space.occupied.iter().filter(|p| solid.is_vacant(pose.point(**p)));
    sum += scale.contradiction * occupied.count() as f32;
    -space.weight * sum.min(scale.contradictions_max)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::options::SurfaceOptions;
    use crate::test_support::{map_of, places};
    use glam::{DVec3, Vec3};
    use palpate_core::pose::Pose;
    use palpate_core::reading::Reading;
    use palpate_core::reading::SensorId;
    use palpate_core::sensor::SensorDescription;
    use palpate_core::units::MM;

    /// A press of a 6×6 sensor (12 mm square in the preset), pressed where `rows` has a `#`.
    fn press(rows: &[&str], pose: Pose) -> Reading {
        let sensor = SensorDescription::digitacts_6x6();
        let pressure = |c| Some(if c == '#' { 10_000.0 } else { 0.0 });
        let pressures: Vec<Option<f64>> = rows.concat().chars().map(pressure).collect();
        Reading::new(SensorId(0), &sensor, &pressures, pose).unwrap()
    }

    const BROAD: [&str; 6] = ["......", ".####.", ".####.", ".####.", ".####.", "......"];
    const SPOT: [&str; 6] = ["......", "......", "..##..", "..##..", "......", "......"];

    /// The sensor's face at a height (m) over the middle of the ellipsoid's broad side, looking
    /// down; its half axes are 40, 30 and 20 mm.
    fn above(height: f64) -> Pose {
        let down = DQuat::from_rotation_x(std::f64::consts::PI);
        Pose::from_parts(down, DVec3::new(0.0, 0.0, 20.0 * MM + height))
    }

    fn contradiction(space: &PressSpace) -> f32 {
        let pose = InversePose::new(glam::Quat::IDENTITY, Vec3::ZERO);
        super::contradiction(
            space,
            &map_of(&places(3_000, 0)),
            &pose,
            &SurfaceOptions::default().score,
        )
    }

    fn touch(rows: &[&str], pose: Pose) -> PressSpace {
        let sensor = SensorDescription::digitacts_6x6();
        PressSpace::of_touch(&press(rows, pose), &sensor, DVec3::ZERO)
    }

    #[test]
    fn a_press_on_the_surface_contradicts_nothing() {
        // Sixteen points of the array and five of the body. About the middle four points, some
        // taxels of the spot are pressed and some are free; under the broad contact all are
        // pressed there, and some about every other point.
        let (spot, broad) = (touch(&SPOT, above(0.0)), touch(&BROAD, above(0.0)));
        assert_eq!((spot.free.len(), spot.occupied.len()), (17, 0));
        assert_eq!((broad.free.len(), broad.occupied.len()), (5, 4));
        for space in [spot, broad] {
            assert!(contradiction(&space).abs() < 1e-6);
        }
    }

    #[test]
    fn a_press_inside_the_object_and_one_far_from_it_contradict_it() {
        // 15 mm inside, all free points are within the object: the loss is at its cap.
        assert!((contradiction(&touch(&SPOT, above(-15.0 * MM))) + 3.0).abs() < 1e-6);
        // 30 mm above, four pressed points have no material behind them: 4 · 0.5.
        assert!((contradiction(&touch(&BROAD, above(30.0 * MM))) + 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_miss_through_the_object_contradicts_it() {
        let sensor = SensorDescription::digitacts_6x6();
        let miss = |x: f64, way: f64| {
            // Below the object, having come down along z.
            let pose = above(-60.0 * MM);
            let pose = Pose::from_parts(pose.rotation, pose.translation + DVec3::X * x);
            let reading = press(&["......"; 6], pose).after_approach(way);
            contradiction(&PressSpace::of_miss(&reading, &sensor, DVec3::ZERO))
        };
        assert!((miss(0.0, 0.1) + 3.0).abs() < 1e-6);
        assert!(miss(0.07, 0.1).abs() < 1e-6, "70 mm beside");
        assert!(miss(0.0, 0.0).abs() < 1e-6, "nobody said that it came through");
    }
}
