//! A picture of an arm before an object: capsules, and touches with their directions.

use std::f64::consts::TAU;

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::units::MM;

use super::canvas::Canvas;
use super::{BACKGROUND, SURFACE, TOUCH, View, shade};
use crate::arm::Capsule;
use crate::mesh::Mesh;

const LINK: [f64; 3] = [205.0, 168.0, 104.0];
/// Vertices around a capsule, and rings from its middle to each end.
const N_AROUND: u32 = 20;
const N_RINGS: u32 = 5;
/// Length of a touch's mark behind its sensor, metres.
const TAIL: f64 = 8.0 * MM;

/// A picture of `size` × `size` pixels: an arm's capsules, a mesh and touches
/// (`session_from_sensor`), all in the session frame.
///
/// A touch is a row of dots from the sensor's origin backwards, against its +z.
#[must_use]
pub fn arm_png(
    capsules: &[Capsule],
    mesh_in_session: &Mesh,
    touches: &[Pose],
    view: View,
    size: usize,
) -> Vec<u8> {
    let mut canvas = Canvas::new(size, size, BACKGROUND);
    let (mut low, mut high) = mesh_in_session.bounds();
    for capsule in capsules {
        low = low.min(capsule.from - capsule.radius).min(capsule.to - capsule.radius);
        high = high.max(capsule.from + capsule.radius).max(capsule.to + capsule.radius);
    }
    let center = 0.5 * (low + high);
    let scale = 0.92 * size as f64 / (high - low).length();
    let in_picture = |point: DVec3| {
        let seen = view.rotation * (point - center) * scale;
        DVec3::new(0.5 * size as f64 + seen.x, 0.5 * size as f64 - seen.y, seen.z)
    };
    let mut add = |corners: [DVec3; 3], color: [f64; 3]| {
        let normal =
            (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(DVec3::Z);
        canvas.add_triangle(&corners.map(in_picture), shade(view.rotation * normal, color));
    };
    for triangle in 0..mesh_in_session.triangles().len() {
        add(mesh_in_session.corners(triangle), SURFACE);
    }
    for corners in capsules.iter().flat_map(triangles) {
        add(corners, LINK);
    }
    for touch in touches {
        for step in 0..=4 {
            let behind = TAIL * f64::from(step) / 4.0;
            let at = *touch * DVec3::new(0.0, 0.0, -behind);
            let radius = (size as f64 / 300.0).max(1.0) * if step == 0 { 1.6 } else { 0.8 };
            canvas.add_dot(in_picture(at), 4.0 * MM * scale, radius, TOUCH);
        }
    }
    canvas.to_png()
}

/// The surface of a capsule as triangles.
fn triangles(capsule: &Capsule) -> Vec<[DVec3; 3]> {
    let along = (capsule.to - capsule.from).normalize_or(DVec3::Z);
    let (side, other) = along.any_orthonormal_pair();
    let ring = |idx: u32| {
        // From one pole over both middles to the other pole.
        let from_pole = idx.min(N_RINGS) + idx.saturating_sub(N_RINGS + 1);
        let angle = 0.25 * TAU * (f64::from(from_pole) / f64::from(N_RINGS) - 1.0);
        let center = if idx <= N_RINGS { capsule.from } else { capsule.to };
        let middle = center + capsule.radius * angle.sin() * along;
        let corner = move |step: u32| {
            let around = TAU * f64::from(step) / f64::from(N_AROUND);
            let direction = around.cos() * side + around.sin() * other;
            middle + capsule.radius * angle.cos() * direction
        };
        (0..=N_AROUND).map(corner).collect::<Vec<_>>()
    };
    let rings: Vec<Vec<DVec3>> = (0..=2 * N_RINGS + 1).map(ring).collect();
    let quads = rings.windows(2).flat_map(|pair| {
        (0..N_AROUND as usize)
            .map(|step| [pair[0][step], pair[0][step + 1], pair[1][step + 1], pair[1][step]])
    });
    quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tests_support::sphere;

    #[test]
    fn a_capsules_surface_is_one_radius_from_its_axis() {
        let capsule = Capsule { from: DVec3::X, to: 3.0 * DVec3::X, radius: 0.5 };
        let corners = triangles(&capsule);
        assert_eq!(corners.len() as u32, 2 * N_AROUND * (2 * N_RINGS + 1));
        for corner in corners.as_flattened() {
            let nearest = DVec3::X * corner.x.clamp(1.0, 3.0);
            assert!((corner.distance(nearest) - 0.5).abs() < 1e-12, "{corner}");
        }
    }

    #[test]
    fn the_picture_shows_arm_and_object_and_touch() {
        let ball = sphere(0.03, 24);
        let capsule = Capsule { from: 0.1 * DVec3::X, to: 0.2 * DVec3::X, radius: 0.01 };
        let view = View::default();
        let with = arm_png(&[capsule], &ball, &[Pose::IDENTITY], view, 64);
        assert_ne!(with, arm_png(&[], &ball, &[Pose::IDENTITY], view, 64));
        let touch = Pose { translation: 0.15 * DVec3::X + 0.011 * DVec3::Z, ..Pose::IDENTITY };
        assert_ne!(with, arm_png(&[capsule], &ball, &[touch], view, 64));
    }
}
