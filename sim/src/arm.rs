//! The simulated articulated arm: a chain of links that carries a tactile sensor.
//!
//! Source: section 4.4.1.1. The first link stands on the session's xy-plane. Two neighbouring
//! links are joined by a rotation about y and then one about z; a universal wrist, also y
//! then z, carries the sensor. In the initial configuration all angles are 0: every link but
//! the first lies along x and the sensor faces +x. Lengths in metres, angles in radians; the
//! dissertation gives neither the number of links nor their sizes. Not here: collisions with
//! anything but the arm itself (`explore`).

mod inverse;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::units::{DEG, MM};
use thiserror::Error;

use crate::distance::segment_to_segment_squared;
use crate::press::HOUSING_DEPTH;
pub use inverse::{InverseConfig, Target};

/// Minimum number of links: their joints and the wrist give the six axes that a pose needs.
pub const LINKS_MIN: usize = 3;
/// Maximum number of links.
pub const LINKS_MAX: usize = 32;

/// Sizes of an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmConfig {
    /// Number of links, the standing one included.
    pub n_links: usize,
    /// Foot of the first link in the session frame.
    pub foot: DVec3,
    /// Length of the first link.
    pub first_link_length: f64,
    /// Length of every other link.
    pub link_length: f64,
    /// Distance from a link's axis to its surface.
    pub link_radius: f64,
    /// Distance from the wrist to the free surface of the sensor's covering.
    pub sensor_mount: f64,
    /// Radius of the stem that holds the sensor's housing.
    pub stem_radius: f64,
    /// Range of each joint axis in either direction.
    pub joint_max: f64,
    /// Range of each wrist axis in either direction.
    pub wrist_max: f64,
}

impl ArmConfig {
    /// An arm of `n_links` that reaches everything within `half_width` (metres) of the session
    /// frame's origin along each axis, with a quarter of its length to spare for going round.
    ///
    /// It stands beside that cube and its first link ends above it.
    #[must_use]
    pub fn around(half_width: f64, n_links: usize) -> Self {
        let shoulder = DVec3::new(-1.0, 0.0, 1.0) * (half_width + 60.0 * MM);
        let farthest = DVec3::new(half_width, half_width, -half_width);
        let reach = 1.25 * shoulder.distance(farthest);
        let first_link_length = 2.0 * shoulder.z;
        let foot = shoulder - DVec3::Z * first_link_length;
        let link_length = reach / (n_links.max(2) - 1) as f64;
        Self {
            n_links,
            foot,
            first_link_length,
            link_length,
            link_radius: 7.0 * MM,
            sensor_mount: 25.0 * MM,
            stem_radius: 5.0 * MM,
            joint_max: 110.0 * DEG,
            wrist_max: 90.0 * DEG,
        }
    }
}

/// Error for sizes that do not make an arm.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ArmError {
    /// The number of links is out of range.
    #[error("n_links is {found}, expected {LINKS_MIN} to {LINKS_MAX}")]
    Links {
        /// The given number.
        found: usize,
    },
    /// A length or an angle is not positive.
    #[error("{name} is {found}, expected a finite number above {min}")]
    Size {
        /// The field's name.
        name: &'static str,
        /// The given value.
        found: f64,
        /// The lower bound, which the value must exceed.
        min: f64,
    },
    /// The foot has a coordinate that is not finite.
    #[error("foot is {found}, expected finite coordinates in metres")]
    Foot {
        /// The given foot.
        found: DVec3,
    },
}

/// The angles of an arm's axes: y and z of every joint from the foot on, then of the wrist.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration(Vec<f64>);

impl Configuration {
    /// The angles in radians.
    #[must_use]
    pub fn angles(&self) -> &[f64] {
        &self.0
    }

    /// Interpolates linearly: the configuration at `share` (0 to 1) of the way to `other`.
    #[must_use]
    pub fn towards(&self, other: &Self, share: f64) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(from, to)| from + share * (to - from)).collect())
    }
}

/// A cylinder with round ends: all points within `radius` of a segment. Session frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// One end of the segment, metres.
    pub from: DVec3,
    /// The other end.
    pub to: DVec3,
    /// The radius, metres.
    pub radius: f64,
}

impl Capsule {
    /// Whether two capsules intersect.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        let squared = segment_to_segment_squared(self.from, self.to, other.from, other.to);
        squared < (self.radius + other.radius).powi(2)
    }
}

/// The arm's position in the session frame at one configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// The foot, every joint and the wrist: the ends of the links, metres.
    pub points: Vec<DVec3>,
    /// The directions of all axes, in the order of the angles.
    axes: Vec<DVec3>,
    /// The sensor's pose.
    pub session_from_sensor: Pose,
}

/// A checked arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    config: ArmConfig,
}

impl Arm {
    /// Checks an arm's sizes.
    ///
    /// # Errors
    /// [`ArmError`] names the field that is out of range.
    pub fn new(config: ArmConfig) -> Result<Self, ArmError> {
        if !(LINKS_MIN..=LINKS_MAX).contains(&config.n_links) {
            return Err(ArmError::Links { found: config.n_links });
        }
        if !config.foot.is_finite() {
            return Err(ArmError::Foot { found: config.foot });
        }
        let stem_min = HOUSING_DEPTH + config.stem_radius;
        for (name, found, min) in [
            ("first_link_length", config.first_link_length, 0.0),
            ("link_length", config.link_length, 0.0),
            ("link_radius", config.link_radius, 0.0),
            ("stem_radius", config.stem_radius, 0.0),
            ("sensor_mount", config.sensor_mount, stem_min),
            ("joint_max", config.joint_max, 0.0),
            ("wrist_max", config.wrist_max, 0.0),
        ] {
            if !(found.is_finite() && found > min) {
                return Err(ArmError::Size { name, found, min });
            }
        }
        Ok(Self { config })
    }

    /// The arm's sizes.
    #[must_use]
    pub fn config(&self) -> &ArmConfig {
        &self.config
    }

    /// The number of angles of a configuration: two for each joint and two for the wrist.
    #[must_use]
    pub fn n_axes(&self) -> usize {
        2 * self.config.n_links
    }

    /// The initial configuration: the first link upright, all others along x.
    #[must_use]
    pub fn initial(&self) -> Configuration {
        Configuration(vec![0.0; self.n_axes()])
    }

    /// The configuration with the given angles (radians), each clamped to its axis's limits.
    /// `None` unless there are exactly [`Arm::n_axes`] finite angles.
    #[must_use]
    pub fn configuration(&self, angles: &[f64]) -> Option<Configuration> {
        let valid = angles.len() == self.n_axes() && angles.iter().all(|angle| angle.is_finite());
        let within = |(axis, angle): (usize, &f64)| {
            let limit = self.limit(axis);
            angle.clamp(-limit, limit)
        };
        valid.then(|| Configuration(angles.iter().enumerate().map(within).collect()))
    }

    /// The limit of an axis in either direction, radians.
    fn limit(&self, axis: usize) -> f64 {
        let is_wrist = axis >= self.n_axes() - 2;
        if is_wrist { self.config.wrist_max } else { self.config.joint_max }
    }

    /// Forward kinematics: the arm's position at a configuration.
    #[must_use]
    pub fn forward(&self, configuration: &Configuration) -> Placement {
        let config = &self.config;
        let shoulder = config.foot + DVec3::Z * config.first_link_length;
        let mut points = Vec::with_capacity(config.n_links + 1);
        points.extend([config.foot, shoulder]);
        let mut axes = Vec::with_capacity(self.n_axes());
        let mut session_from_link = Pose::from_parts(DQuat::IDENTITY, shoulder);
        for (joint, angles) in configuration.0.chunks_exact(2).enumerate() {
            axes.push(session_from_link.rotation * DVec3::Y);
            let turned = session_from_link.rotation * DQuat::from_rotation_y(angles[0]);
            axes.push(turned * DVec3::Z);
            session_from_link.rotation = (turned * DQuat::from_rotation_z(angles[1])).normalize();
            if joint < config.n_links - 1 {
                let along = session_from_link.rotation * DVec3::X;
                session_from_link.translation += config.link_length * along;
                points.push(session_from_link.translation);
            }
        }
        // The last frame is the hand's; the sensor's +z is its x.
        let hand_from_sensor =
            Pose::from_parts(DQuat::from_rotation_y(90.0 * DEG), DVec3::X * config.sensor_mount);
        Placement { points, axes, session_from_sensor: session_from_link * hand_from_sensor }
    }

    /// The arm's bodies: every link from the foot on, then the stem and the sensor's housing.
    #[must_use]
    pub fn capsules(&self, placement: &Placement) -> Vec<Capsule> {
        let config = &self.config;
        let links = placement.points.windows(2);
        let mut capsules: Vec<Capsule> = links
            .map(|ends| Capsule { from: ends[0], to: ends[1], radius: config.link_radius })
            .collect();
        let wrist = placement.points[config.n_links];
        let facing = placement.session_from_sensor.turn(DVec3::Z);
        let stem_length = config.sensor_mount - HOUSING_DEPTH - config.stem_radius;
        let stem_end = wrist + stem_length * facing;
        capsules.push(Capsule { from: wrist, to: stem_end, radius: config.stem_radius });
        let middle = placement.session_from_sensor.translation - SENSOR_RADIUS * facing;
        capsules.push(Capsule { from: middle, to: middle, radius: SENSOR_RADIUS });
        capsules
    }

    /// Whether two bodies that are not neighbours intersect; `capsules` from [`Arm::capsules`].
    #[must_use]
    pub fn meets_itself(&self, capsules: &[Capsule]) -> bool {
        // Stem and housing are one rigid hand: the last link is the neighbour of both.
        let hand = self.config.n_links;
        let place = |body: usize| body.min(hand);
        (0..capsules.len()).any(|first| {
            (first + 2..capsules.len()).any(|second| {
                place(second) >= place(first) + 2 && capsules[first].meets(&capsules[second])
            })
        })
    }
}

/// Radius of the ball that stands for the sensor's housing in collision checks.
const SENSOR_RADIUS: f64 = 8.0 * MM;

#[cfg(test)]
mod tests {
    use super::*;

    /// Four links, 0.2 m upright and three of 0.1 m; the sensor is 0.05 m before the wrist.
    pub(super) fn small_arm() -> Arm {
        let config = ArmConfig {
            n_links: 4,
            foot: DVec3::new(1.0, 2.0, 3.0),
            first_link_length: 0.2,
            link_length: 0.1,
            sensor_mount: 0.05,
            ..ArmConfig::around(0.1, 4)
        };
        Arm::new(config).unwrap()
    }

    #[track_caller]
    fn check(angles: [f64; 8], position: [f64; 3], facing: [f64; 3], x_of_sensor: [f64; 3]) {
        let arm = small_arm();
        let angles = angles.map(f64::to_radians);
        let placement = arm.forward(&arm.configuration(&angles).unwrap());
        let pose = placement.session_from_sensor;
        let expected = DVec3::from(position) + arm.config().foot;
        assert!(pose.translation.distance(expected) < 1e-12, "{}", pose.translation);
        assert!(pose.turn(DVec3::Z).distance(facing.into()) < 1e-12, "{}", pose.turn(DVec3::Z));
        assert!(pose.turn(DVec3::X).distance(x_of_sensor.into()) < 1e-12);
    }

    #[test]
    fn initial_configuration_is_upright_and_then_along_x() {
        // 0.3 m of links and 0.05 m of hand along x, 0.2 m up; the sensor's x points down.
        check([0.0; 8], [0.35, 0.0, 0.2], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]);
        let arm = small_arm();
        let points = arm.forward(&arm.initial()).points;
        assert_eq!(points.len(), 5);
        assert!(points[1].distance(arm.config().foot + 0.2 * DVec3::Z) < 1e-12);
        assert!(points[4].distance(points[1] + 0.3 * DVec3::X) < 1e-12);
    }

    #[test]
    fn joints_turn_about_y_and_then_about_z() {
        // A quarter about y at the shoulder: x goes to −z, so the arm hangs down: 0.2 − 0.35.
        let hanging = [90.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        check(hanging, [0.0, 0.0, -0.15], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]);
        // A quarter about z at the second joint: 0.1 m along x, then 0.25 m along y.
        let bent = [0.0, 0.0, 0.0, 90.0, 0.0, 0.0, 0.0, 0.0];
        check(bent, [0.1, 0.25, 0.2], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]);
        // Both at the shoulder: y first, then z about what was z: the links lie along y.
        let both = [90.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        check(both, [0.0, 0.35, 0.2], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]);
        // The wrist alone: a quarter about y, 0.05 m down from the end of the links.
        let wrist = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 90.0, 0.0];
        check(wrist, [0.3, 0.0, 0.15], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]);
    }

    #[test]
    fn angles_are_clamped_to_their_limits() {
        let arm = small_arm();
        let wild = arm.configuration(&[9.0; 8]).unwrap();
        assert!((wild.angles()[0] - 110.0 * DEG).abs() < 1e-12);
        assert!((wild.angles()[7] - 90.0 * DEG).abs() < 1e-12);
        assert_eq!(arm.configuration(&[0.0; 7]), None);
        assert_eq!(arm.configuration(&[f64::NAN; 8]), None);
    }

    #[test]
    fn a_folded_arm_meets_itself() {
        let arm = small_arm();
        let meets = |angles: [f64; 8]| {
            let configuration = arm.configuration(&angles.map(f64::to_radians)).unwrap();
            arm.meets_itself(&arm.capsules(&arm.forward(&configuration)))
        };
        assert!(!meets([0.0; 8]));
        // Three corners of 110° bring the third link back through the upright one.
        assert!(meets([0.0, 0.0, 110.0, 0.0, 110.0, 0.0, 0.0, 0.0]));
        // A square corner and the hand bent to the side stays clear.
        assert!(!meets([0.0, 0.0, 0.0, 90.0, 0.0, 0.0, 0.0, 90.0]));
    }

    #[test]
    fn invalid_sizes_are_refused_by_name() {
        let config = ArmConfig::around(0.1, 8);
        let error = |config| Arm::new(config).unwrap_err();
        assert_eq!(error(ArmConfig { n_links: 2, ..config }), ArmError::Links { found: 2 });
        let flat = ArmConfig { link_length: 0.0, ..config };
        assert!(matches!(error(flat), ArmError::Size { name: "link_length", .. }));
        let short = ArmConfig { sensor_mount: 12.0 * MM, ..config };
        assert!(matches!(error(short), ArmError::Size { name: "sensor_mount", .. }));
        let lost = ArmConfig { foot: DVec3::NAN, ..config };
        assert!(matches!(error(lost), ArmError::Foot { .. }));
    }
}
