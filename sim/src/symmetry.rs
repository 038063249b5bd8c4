//! True symmetries of a mesh: the rotations that leave it unchanged. Touches can only
//! estimate them.
//!
//! `palpate_core::symmetry::Shape` decides which differences count. Frames: the mesh's own.

use glam::DVec3;
use palpate_core::symmetry::{Shape, Symmetry};

use crate::mesh::Mesh;
use crate::press::bvh::Bvh;

/// Number of surface points that are turned. Chosen: four and more on each part of 2 mm
/// radius of objects that are 80 mm large.
const POINTS: usize = 6_000;

/// The symmetry of a mesh, in its frame.
#[must_use]
pub fn of_mesh(mesh: &Mesh) -> Symmetry {
    let bvh = Bvh::new(mesh);
    let points = points(mesh);
    let nearest = |point: DVec3| bvh.nearest(point);
    let shape = Shape { points: &points, nearest: &nearest, size: mesh.largest_dimension() };
    Symmetry::of_shape(&shape)
}

/// Points distributed uniformly over a mesh by area, as is every prefix of the list:
/// Kronecker sequences of the generalised golden ratio (Roberts, 2018), the first choosing
/// the triangle.
fn points(mesh: &Mesh) -> Vec<DVec3> {
    let mut ends = Vec::with_capacity(mesh.triangles().len());
    let mut total = 0.0;
    for triangle in 0..mesh.triangles().len() {
        total += mesh.area(triangle);
        ends.push(total);
    }
    // The root of x⁴ = x + 1.
    let golden = 1.220_744_084_605_759_5_f64;
    let point = |index: usize| {
        let [share, u, v] =
            [1, 2, 3].map(|power| (0.5 + index as f64 * golden.powi(-power)).fract());
        let triangle = ends.partition_point(|end| *end <= share * total).min(ends.len() - 1);
        let [a, b, c] = mesh.corners(triangle);
        let u = u.sqrt();
        a * (1.0 - u) + b * (u * (1.0 - v)) + c * (u * v)
    };
    (0..POINTS).map(point).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::{DQuat, DVec2};
    use palpate_core::pose::Pose;
    use palpate_core::symmetry::AxisOrder;
    use palpate_core::units::MM;

    use super::*;
    use crate::shapes;

    /// A prism with a regular outline of `n` sides and this radius and height, mm; the
    /// corners in `moved` are pulled in to three quarters.
    fn prism(n: u32, radius: f64, height: f64, moved: &[u32]) -> Mesh {
        let corner = |k: u32| {
            let angle = TAU * f64::from(k) / f64::from(n);
            let share = if moved.contains(&k) { 0.75 } else { 1.0 };
            share * radius * MM * DVec2::from_angle(angle)
        };
        let half = 0.5 * height * MM;
        let mut vertices: Vec<DVec3> = Vec::new();
        for k in 0..n {
            vertices.extend([corner(k).extend(-half), corner(k).extend(half)]);
        }
        vertices.extend([DVec3::NEG_Z * half, DVec3::Z * half]);
        let mut triangles = Vec::new();
        for k in 0..n {
            let (a, b, next) = (2 * k, 2 * k + 1, (k + 1) % n);
            let (c, d) = (2 * next, 2 * next + 1);
            triangles.extend([[a, c, d], [a, d, b], [2 * n, c, a], [2 * n + 1, b, d]]);
        }
        Mesh::new(vertices, triangles).unwrap()
    }

    /// The orders of a mesh's axes, highest first, in a pose aligned with no axis of the frame.
    fn orders(mesh: &Mesh) -> Vec<AxisOrder> {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7));
        let pose = Pose::from_parts(turn, DVec3::new(7.0, -30.0, 12.0) * MM);
        let found = of_mesh(&mesh.moved_by(pose));
        if !found.is_none() {
            let center = pose * mesh.centroid();
            let off = found.center - center;
            let along = if found.axes.len() == 1 { found.axes[0].direction } else { DVec3::ZERO };
            assert!(off.cross(along).length() < 0.2 * MM, "{found:?}");
            assert!(found.axes.len() == 1 || off.length() < 0.2 * MM, "{found:?}");
        }
        found.axes.iter().map(|axis| axis.order).collect()
    }

    fn finite(orders: &[u8]) -> Vec<AxisOrder> {
        orders.iter().map(|order| AxisOrder::Finite(*order)).collect()
    }

    #[test]
    fn prisms_have_as_many_turns_as_sides_without_a_notch() {
        for n in [3, 16] {
            let expected = [vec![n as u8], vec![2; n as usize]].concat();
            assert_eq!(orders(&prism(n, 22.0, 80.0, &[])), finite(&expected), "{n} sides");
            // The symmetries left of a notched prism are the turns that keep the notch.
            let notched = orders(&prism(n, 22.0, 80.0, &[1]));
            assert_eq!(notched, finite(&[2]), "{n} sides");
        }
        // A cube, and a prism whose three moments of spread are nearly equal.
        let cube = [vec![4; 3], vec![3; 4], vec![2; 6]].concat();
        assert_eq!(orders(&prism(4, 40.0 / 2.0_f64.sqrt(), 40.0, &[])), finite(&cube));
        assert_eq!(orders(&prism(5, 30.0, 46.0, &[])), finite(&[5, 2, 2, 2, 2, 2]));
    }

    #[test]
    fn symmetry_is_continuous_when_sides_are_too_fine_to_feel() {
        let round = [AxisOrder::Continuous, AxisOrder::Finite(2)];
        // 120 sides of a radius of 22 mm leave the round by 0.008 mm, 48 by 0.05 mm.
        assert_eq!(orders(&prism(120, 22.0, 80.0, &[])), round);
        assert_eq!(orders(&prism(48, 22.0, 80.0, &[])), round);
        // 36 sides of a radius of 40 mm leave it by 0.15 mm, but are finer than any order.
        assert_eq!(orders(&prism(36, 40.0, 30.0, &[])), round);
        // 24 of them by 0.34 mm.
        assert_eq!(orders(&prism(24, 40.0, 30.0, &[]))[0], AxisOrder::Finite(24));
        let ball = of_mesh(&crate::mesh::tests_support::sphere(0.03, 48));
        assert_eq!(ball.axes.len(), 3, "{ball:?}");
    }

    #[test]
    fn examples_have_their_designed_symmetries() {
        for (name, first, n) in [
            ("mug", None, 0),
            ("gear", None, 0),
            ("hammer", None, 0),
            ("wine_glass", Some(AxisOrder::Continuous), 1),
            ("screwdriver", Some(AxisOrder::Finite(2)), 1),
            ("tyre", Some(AxisOrder::Finite(26)), 27),
        ] {
            let found = of_mesh(&shapes::example(name).unwrap());
            let orders = found.axes.iter().map(|axis| axis.order);
            assert_eq!((orders.clone().next(), found.axes.len()), (first, n), "{name} {found:?}");
        }
    }
}
