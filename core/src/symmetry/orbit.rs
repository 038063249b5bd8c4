//! Poses modulo symmetry: equality and distance of poses of a symmetric object.
//!
//! A symmetry turns the object before it is placed: the orbit of `session_from_object` is
//! `session_from_object · turn` over all turns. Every turn fixes the centre, so positions are
//! compared there, and orientations at the turn that brings them closest. Each is a
//! pseudo-metric, zero between poses of one orbit.

use glam::{DQuat, DVec3};

use super::{AxisOrder, Symmetry, group};
use crate::pose::{Pose, rotation_angle};

impl Symmetry {
    /// Whether the object has no symmetry.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.axes.is_empty()
    }

    /// The same symmetry in a frame with the same axes whose origin lies at `origin` (metres).
    #[must_use]
    pub fn seen_from(&self, origin: DVec3) -> Self {
        let Some(first) = self.axes.first() else { return Self::NONE };
        let moved = self.center - origin;
        // Along a single axis the centre is free: it is the point nearest to the origin.
        let center = if self.axes.len() == 1 {
            moved.reject_from_normalized(first.direction)
        } else {
            moved
        };
        let axes: Vec<(DVec3, AxisOrder)> =
            self.axes.iter().map(|axis| (axis.direction, axis.order)).collect();
        Self::through(center, &axes)
    }

    /// The distance of two poses modulo the symmetry: between the positions of the centre
    /// (metres) and the smallest angle between the orientations (rad, 0 to π). Without a
    /// symmetry these are the distances of the poses themselves.
    #[must_use]
    pub fn distance(&self, a: &Pose, b: &Pose) -> (f64, f64) {
        let moved = (*a * self.center).distance(*b * self.center);
        (moved, rotation_angle(self.least_turn(a.rotation.conjugate() * b.rotation)))
    }

    /// Whether two poses are equal modulo the symmetry, within a distance of the centre
    /// (metres) and an angle (rad).
    #[must_use]
    pub fn look_alike(&self, a: &Pose, b: &Pose, distance: f64, angle: f64) -> bool {
        // Far poses are the usual case, and are rejected without trying any turn.
        (*a * self.center).distance(*b * self.center) <= distance && self.distance(a, b).1 <= angle
    }

    /// The pose of the orbit of `pose` whose orientation is nearest to that of `reference`.
    #[must_use]
    pub fn nearest_to(&self, pose: &Pose, reference: &Pose) -> Pose {
        let rotation =
            reference.rotation * self.least_turn(reference.rotation.conjugate() * pose.rotation);
        self.placed_as(pose, rotation)
    }

    /// The orbit of `pose`, itself first, at most 60 poses. With a continuous axis these are
    /// `pose` and, if the object can be turned over, `pose` turned over; all turns of each
    /// about the axis are equal to it.
    #[must_use]
    pub fn orbit(&self, pose: &Pose) -> Vec<Pose> {
        let turned = |turn: DQuat| self.placed_as(pose, pose.rotation * turn);
        self.turns().into_iter().map(turned).collect()
    }

    /// The finite turns, the identity first, without those about continuous axes.
    fn turns(&self) -> Vec<DQuat> {
        let mut turns = vec![DQuat::IDENTITY];
        for axis in &self.axes {
            if let AxisOrder::Finite(order) = axis.order {
                turns.extend(group::about(axis.direction, order));
            }
        }
        turns
    }

    /// The rotation of least angle among `rotation · turn` over all turns.
    fn least_turn(&self, rotation: DQuat) -> DQuat {
        let mut continuous = self.axes.iter().filter(|axis| axis.order == AxisOrder::Continuous);
        let (axis, second) = (continuous.next(), continuous.next());
        if second.is_some() {
            return DQuat::IDENTITY;
        }
        let straightened = |turn: DQuat| {
            let turned = rotation * turn;
            axis.map_or(turned, |axis| without_twist(turned, axis.direction))
        };
        let least = |a: DQuat, b: DQuat| if b.w.abs() > a.w.abs() { b } else { a };
        self.turns().into_iter().map(straightened).reduce(least).unwrap_or(rotation)
    }

    /// The pose with the given orientation and the centre of `pose`.
    fn placed_as(&self, pose: &Pose, rotation: DQuat) -> Pose {
        Pose::from_parts(rotation, *pose * self.center - rotation * self.center)
    }
}

/// The rotation of least angle among `rotation · turn` over all turns about `axis`. The
/// scalar part is w cos(α/2) − (v · axis) sin(α/2): largest at tan(α/2) = −(v · axis)/w.
fn without_twist(rotation: DQuat, axis: DVec3) -> DQuat {
    let half = (-rotation.xyz().dot(axis)).atan2(rotation.w);
    rotation * DQuat::from_axis_angle(axis, 2.0 * half)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use proptest::prelude::*;

    use super::*;
    use crate::rng::{Purpose, Stream};
    use crate::units::MM;

    const CENTER: DVec3 = DVec3::new(3.0 * MM, -2.0 * MM, 7.0 * MM);

    fn symmetry(axes: &[(DVec3, AxisOrder)]) -> Symmetry {
        Symmetry::through(CENTER, axes)
    }

    /// Groups of every kind that a search can find.
    fn kinds() -> Vec<Symmetry> {
        let tilted = DVec3::new(1.0, 2.0, -0.5).normalize();
        let (across, other) = tilted.any_orthonormal_pair();
        let (finite, continuous) = (AxisOrder::Finite, AxisOrder::Continuous);
        vec![
            Symmetry::NONE,
            symmetry(&[(tilted, finite(5))]),
            symmetry(&[(tilted, finite(2)), (across, finite(2)), (other, finite(2))]),
            symmetry(&[(tilted, continuous)]),
            symmetry(&[(tilted, continuous), (across, finite(2))]),
            symmetry(&DVec3::AXES.map(|axis| (axis, continuous))),
        ]
    }

    fn random_pose(seed: u64) -> Pose {
        let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
        Pose::from_parts(stream.rotation(), 0.1 * stream.direction())
    }

    #[test]
    fn a_half_turn_of_a_letter_is_no_distance_a_quarter_turn_is() {
        let half = symmetry(&[(DVec3::Z, AxisOrder::Finite(2))]);
        let turned = |angle: f64| {
            let rotation = DQuat::from_rotation_z(angle);
            Pose::from_parts(rotation, CENTER - rotation * CENTER)
        };
        let (moved, angle) = half.distance(&Pose::IDENTITY, &turned(PI));
        assert!(moved < 1e-12 && angle < 1e-9, "{moved} {angle}");
        let (moved, angle) = half.distance(&Pose::IDENTITY, &turned(0.5 * PI));
        assert!(moved < 1e-12 && (angle - 0.5 * PI).abs() < 1e-9, "{moved} {angle}");
        // Turned about the origin by half, the centre goes from (3, −2) to (−3, 2): √52 mm.
        let about_origin = Pose::from_parts(DQuat::from_rotation_z(PI), DVec3::ZERO);
        let (moved, angle) = half.distance(&Pose::IDENTITY, &about_origin);
        assert!((moved - 52.0_f64.sqrt() * MM).abs() < 1e-12 && angle < 1e-9, "{moved} {angle}");
    }

    #[test]
    fn a_shifted_origin_keeps_the_orbits() {
        let origin = DVec3::new(5.0, 9.0, -1.0) * MM;
        let old_from_new = Pose::from_parts(DQuat::IDENTITY, origin);
        for kind in kinds() {
            let moved = kind.seen_from(origin);
            let (a, b) = (random_pose(3), random_pose(4));
            for turned in kind.orbit(&a) {
                let (off, angle) = moved.distance(&(a * old_from_new), &(turned * old_from_new));
                assert!(off < 1e-12 && angle < 1e-7, "{off} {angle} {kind:?}");
            }
            let (plain, there) =
                (kind.distance(&a, &b), moved.distance(&(a * old_from_new), &(b * old_from_new)));
            assert!((plain.1 - there.1).abs() < 1e-9);
        }
        let axis = symmetry(&[(DVec3::Z, AxisOrder::Finite(2))]).seen_from(origin);
        assert!(axis.center.distance(DVec3::new(-2.0, -11.0, 0.0) * MM) < 1e-12, "{axis:?}");
    }

    #[test]
    fn look_alike_compares_within_distance_and_angle_of_any_turn() {
        let half = symmetry(&[(DVec3::Z, AxisOrder::Finite(2))]);
        let turned = |angle: f64, off: f64| {
            let rotation = DQuat::from_rotation_z(angle);
            Pose::from_parts(rotation, CENTER - rotation * CENTER + off * DVec3::X)
        };
        let alike =
            |angle, off| half.look_alike(&Pose::IDENTITY, &turned(angle, off), 2.0 * MM, 0.2);
        assert!(alike(PI + 0.15, 1.5 * MM) && alike(0.15, 1.5 * MM));
        assert!(!alike(PI + 0.25, 1.5 * MM) && !alike(PI, 2.5 * MM));
    }

    #[test]
    fn only_a_spindles_tilt_counts() {
        let spindle = symmetry(&[(DVec3::Z, AxisOrder::Continuous)]);
        let tilted = DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(2.0);
        let (_, angle) = spindle.distance(&Pose::IDENTITY, &Pose::from_parts(tilted, DVec3::ZERO));
        assert!((angle - 0.3).abs() < 1e-12, "{angle}");
    }

    #[test]
    fn orbits_have_the_size_of_the_group() {
        let n: Vec<usize> = kinds().iter().map(|kind| kind.orbit(&random_pose(1)).len()).collect();
        assert_eq!(n, [1, 5, 4, 1, 2, 1]);
    }

    #[test]
    fn without_symmetry_the_distance_is_the_plain_one() {
        let (a, b) = (random_pose(1), random_pose(2));
        let (moved, angle) = Symmetry::NONE.distance(&a, &b);
        assert!((moved - a.distance_to(&b)).abs() < 1e-12);
        assert!((angle - a.angle_to(&b)).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn poses_of_one_orbit_have_distance_zero(seed in 0u64..300, angle in 0.0..6.0_f64) {
            let pose = random_pose(seed);
            for kind in kinds() {
                let mut alike = kind.orbit(&pose);
                for axis in kind.axes.iter().filter(|a| a.order == AxisOrder::Continuous) {
                    let turn = DQuat::from_axis_angle(axis.direction, angle);
                    let turned = |pose: &Pose| kind.placed_as(pose, pose.rotation * turn);
                    alike.extend(alike.iter().map(turned).collect::<Vec<_>>());
                }
                for other in alike {
                    let (moved, angle) = kind.distance(&pose, &other);
                    prop_assert!(moved < 1e-12 && angle < 1e-7, "{moved} {angle} {kind:?}");
                    let [a, b] = [pose, other].map(|pose| kind.nearest_to(&pose, &Pose::IDENTITY));
                    prop_assert!((a.angle_to(&Pose::IDENTITY) - b.angle_to(&Pose::IDENTITY)).abs() < 1e-7);
                }
            }
        }

        #[test]
        fn distances_are_symmetric_and_obey_the_triangle_inequality(seed in 0u64..300) {
            let [a, b, c] = [0, 1, 2].map(|n| random_pose(1_000 + 3 * seed + n));
            for kind in kinds() {
                let (ab, ba) = (kind.distance(&a, &b), kind.distance(&b, &a));
                let (bc, ac) = (kind.distance(&b, &c), kind.distance(&a, &c));
                prop_assert!((ab.0 - ba.0).abs() < 1e-12 && (ab.1 - ba.1).abs() < 1e-9);
                prop_assert!(ac.0 <= ab.0 + bc.0 + 1e-12 && ac.1 <= ab.1 + bc.1 + 1e-9);
                prop_assert!(ab.1 <= a.angle_to(&b) + 1e-9);
            }
        }

        #[test]
        fn nearest_to_attains_the_distance(seed in 0u64..300) {
            let (a, b) = (random_pose(seed), random_pose(seed + 5_000));
            for kind in kinds() {
                let near = kind.nearest_to(&b, &a);
                prop_assert!((near.angle_to(&a) - kind.distance(&a, &b).1).abs() < 1e-7);
                let (moved, angle) = kind.distance(&near, &b);
                prop_assert!(moved < 1e-12 && angle < 1e-7);
            }
        }
    }
}
