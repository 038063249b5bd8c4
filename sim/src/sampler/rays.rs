//! Blind approaches: rays from a sphere around an object towards points near its middle.
//!
//! For a robot that knows roughly where an object is and nothing of its shape. Poses are
//! `object_from_sensor` with the sensor's +z along the ray. Many rays miss.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;
use palpate_core::units::MM;

use crate::mesh::Mesh;

/// Region of the starts and ends of rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayConfig {
    /// The middle of the sphere in the object's frame, metres.
    pub center: DVec3,
    /// Radius of the sphere on which the sensor starts, metres.
    pub radius: f64,
    /// Largest distance of a ray's end from the middle, metres.
    pub spread: f64,
}

impl RayConfig {
    /// Starts 120 mm from the middle of a mesh's bounds, or farther so as to be outside of
    /// it; ends within a quarter of its largest dimension.
    #[must_use]
    pub fn around(mesh: &Mesh) -> Self {
        let (low, high) = mesh.bounds();
        let extent = mesh.largest_dimension();
        Self { center: 0.5 * (low + high), radius: extent.max(120.0 * MM), spread: 0.25 * extent }
    }

    /// Length of an approach that crosses the whole sphere, metres.
    #[must_use]
    pub fn approach_max(&self) -> f64 {
        2.0 * self.radius
    }
}

/// A ray drawn from `stream`: its start uniform on the sphere, its end uniform in the ball of
/// ends, the sensor turned at random about it.
#[must_use]
pub fn draw_ray(config: &RayConfig, stream: &mut Stream) -> Pose {
    let start = config.center + config.radius * stream.direction();
    // The cube root makes the density in the ball uniform.
    let distance = config.spread * stream.uniform(0.0, 1.0).cbrt();
    let end = config.center + distance * stream.direction();
    let direction = (end - start).try_normalize().unwrap_or(DVec3::Z);
    let roll = DQuat::from_rotation_z(stream.uniform(0.0, TAU));
    Pose::from_parts(DQuat::from_rotation_arc(DVec3::Z, direction) * roll, start)
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::Purpose;

    use super::*;
    use crate::mesh::tests_support::cuboid;

    #[test]
    fn rays_begin_on_the_sphere_and_pass_near_its_middle() {
        let size = DVec3::new(80.0 * MM, 40.0 * MM, 20.0 * MM);
        let config = RayConfig::around(&cuboid(size));
        assert_eq!(config.center, DVec3::ZERO);
        assert!((config.radius - 120.0 * MM).abs() < 1e-12);
        assert!((config.spread - 20.0 * MM).abs() < 1e-12);
        let mut stream = Stream::new(1, Purpose::Sampling, 0);
        let (mut sum, mut n_far) = (DVec3::ZERO, 0);
        for _ in 0..1000 {
            let pose = draw_ray(&config, &mut stream);
            let (start, direction) = (pose.translation - config.center, pose.turn(DVec3::Z));
            assert!((start.length() - config.radius).abs() < 1e-12);
            assert!(start.dot(direction) < 0.0, "goes away from the object");
            let passes_at = (start - start.dot(direction) * direction).length();
            assert!(passes_at <= config.spread + 1e-12);
            n_far += usize::from(passes_at > 0.5 * config.spread);
            sum += start / config.radius;
        }
        // Components of a mean of 1000 directions have deviation 0.018; and of a uniform ball
        // (1 − 1/4)^(3/2) = 65 % lies outside the cylinder of half its radius.
        assert!((sum / 1000.0).abs().max_element() < 0.1);
        assert!((590..710).contains(&n_far), "{n_far}");
    }
}
