//! The arm, the object and the walls, and the collisions and contacts among them.
//!
//! A motion is a straight line in the joints' angles, checked in steps so short that the
//! sensor meets the object with the outer part of its covering. The object's pose is known
//! here and nowhere in the planner.

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::units::MM;

use crate::arm::{Arm, Capsule, Configuration, Placement};
use crate::press::{HOUSING_DEPTH, PressSimulator};

/// A box along the session frame's axes, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lowest corner.
    pub low: DVec3,
    /// Highest corner.
    pub high: DVec3,
}

impl Bounds {
    /// A cube around the session frame's origin.
    #[must_use]
    pub fn cube(half_width: f64) -> Self {
        Self { low: DVec3::splat(-half_width), high: DVec3::splat(half_width) }
    }

    /// Whether a ball lies within.
    #[must_use]
    pub fn holds(&self, center: DVec3, radius: f64) -> bool {
        (center - radius).cmpge(self.low).all() && (center + radius).cmple(self.high).all()
    }
}

/// The arm, the object at its present pose, and the walls.
#[derive(Clone, Debug)]
pub(super) struct Scene<'a> {
    arm: &'a Arm,
    simulator: &'a PressSimulator,
    pub(super) session_from_object: Pose,
    room: Bounds,
}

/// Result of a motion.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Motion {
    /// The motion reached its end without contact.
    Arrived,
    /// The sensor's covering met the object at `touching`; `free` is the step before.
    Sensed { free: Configuration, touching: Configuration },
    /// Another pair of bodies collided.
    Blocked,
}

/// Contact of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Met {
    Nothing,
    /// The object lies in the covering and nowhere else.
    Covering,
    Obstacle,
}

/// Longest step of any point of the arm between two checks, metres.
const CHECK_STEP: f64 = 1.0 * MM;

impl<'a> Scene<'a> {
    /// The arm in its `room`, before an object at `session_from_object`.
    pub(super) fn new(
        arm: &'a Arm,
        simulator: &'a PressSimulator,
        session_from_object: Pose,
        room: Bounds,
    ) -> Self {
        Self { arm, simulator, session_from_object, room }
    }

    /// Moves from a free configuration towards another until it arrives or touches something.
    pub(super) fn motion(&self, from: &Configuration, to: &Configuration) -> Motion {
        let n_steps = self.n_steps(from, to);
        let mut free = from.clone();
        for step in 1..=n_steps {
            let at = from.towards(to, step as f64 / n_steps as f64);
            match self.met(&at) {
                Met::Nothing => free = at,
                Met::Covering => return Motion::Sensed { free, touching: at },
                Met::Obstacle => return Motion::Blocked,
            }
        }
        Motion::Arrived
    }

    /// Whether the motion touches nothing, its start included.
    pub(super) fn is_free(&self, from: &Configuration, to: &Configuration) -> bool {
        self.met(from) == Met::Nothing && self.motion(from, to) == Motion::Arrived
    }

    /// Whether the arm can follow a command during contact: only the sensor's covering and
    /// housing may touch the object.
    pub(super) fn can_follow(&self, from: &Configuration, to: &Configuration) -> bool {
        let n_steps = self.n_steps(from, to);
        (1..=n_steps).all(|step| {
            let at = from.towards(to, step as f64 / n_steps as f64);
            let placement = self.arm.forward(&at);
            let capsules = self.arm.capsules(&placement);
            !self.hits_itself_or_walls(&capsules) && !self.hits_object(&capsules)
        })
    }

    /// The sensor's pose in the object's frame.
    pub(super) fn object_from_sensor(&self, configuration: &Configuration) -> Pose {
        let session_from_sensor = self.arm.forward(configuration).session_from_sensor;
        self.session_from_object.inverse() * session_from_sensor
    }

    /// The number of checks of a motion. Every point of the arm lies on a straight line
    /// between joints, so none moves farther than the joints, the sensor and the sensor's
    /// rotation together.
    fn n_steps(&self, from: &Configuration, to: &Configuration) -> usize {
        let (start, end) = (self.arm.forward(from), self.arm.forward(to));
        let joints = start.points.iter().zip(&end.points).map(|(a, b)| a.distance(*b));
        let (first, last) = (start.session_from_sensor, end.session_from_sensor);
        let corner = first.distance_to(&last) + first.angle_to(&last) * self.half_diagonal();
        let longest = joints.fold(corner, f64::max);
        let thickness = self.simulator.sensor().parameters().covering_thickness;
        let step = CHECK_STEP.min(0.4 * thickness);
        // Joints that turn and turn back move points on the way that end where they were.
        let turned = from.angles().iter().zip(to.angles()).map(|(a, b)| (a - b).abs());
        let widest = turned.fold(0.0, f64::max) / 0.05;
        ((longest / step).max(widest).ceil() as usize).max(1)
    }

    fn met(&self, configuration: &Configuration) -> Met {
        let placement = self.arm.forward(configuration);
        let capsules = self.arm.capsules(&placement);
        if self.hits_itself_or_walls(&capsules) || self.hits_object(&capsules) {
            return Met::Obstacle;
        }
        self.met_by_sensor(&placement)
    }

    fn hits_itself_or_walls(&self, capsules: &[Capsule]) -> bool {
        // The first link stands on the floor, which may lie outside the room.
        let outside = capsules[1..].iter().any(|capsule| {
            !self.room.holds(capsule.from, capsule.radius)
                || !self.room.holds(capsule.to, capsule.radius)
        });
        outside || self.arm.meets_itself(capsules)
    }

    /// Whether a link or the stem collides with the object; `met_by_sensor` checks the housing.
    fn hits_object(&self, capsules: &[Capsule]) -> bool {
        let object_from_session = self.session_from_object.inverse();
        capsules[..capsules.len() - 1].iter().any(|capsule| {
            let from = object_from_session * capsule.from;
            let to = object_from_session * capsule.to;
            self.simulator.is_near_segment(from, to, capsule.radius)
        })
    }

    /// Contact of the sensor: an object in its covering is felt, one in its housing collides.
    fn met_by_sensor(&self, placement: &Placement) -> Met {
        let object_from_sensor = self.session_from_object.inverse() * placement.session_from_sensor;
        let back = object_from_sensor * (-HOUSING_DEPTH * DVec3::Z);
        let front = object_from_sensor.translation;
        if !self.simulator.is_near_segment(front, back, self.half_diagonal()) {
            return Met::Nothing;
        }
        let lowest = self.simulator.heights(object_from_sensor, 0.0).lowest();
        let thickness = self.simulator.sensor().parameters().covering_thickness;
        if lowest >= 0.0 {
            Met::Nothing
        } else if lowest >= -thickness {
            Met::Covering
        } else {
            Met::Obstacle
        }
    }

    /// Distance from the middle of the sensor's array to its corners, metres.
    fn half_diagonal(&self) -> f64 {
        let grid = self.simulator.sensor().grid();
        0.5 * grid.pitch * ((grid.rows * grid.rows + grid.cols * grid.cols) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::SensorDescription;
    use palpate_core::units::DEG;

    use super::*;
    use crate::arm::ArmConfig;
    use crate::mesh::tests_support::sphere;

    /// 0.2 m upright at the origin, three links of 0.1 m along x, the sensor 0.05 m on.
    fn arm() -> Arm {
        let config = ArmConfig {
            foot: DVec3::ZERO,
            first_link_length: 0.2,
            link_length: 0.1,
            sensor_mount: 0.05,
            ..ArmConfig::around(0.1, 4)
        };
        Arm::new(config).unwrap()
    }

    /// A ball of 60 mm diameter, its middle at the origin of its frame.
    fn ball() -> PressSimulator {
        PressSimulator::new(sphere(30.0 * MM, 60), SensorDescription::digitacts_6x6())
    }

    /// The scene with the ball's middle at `middle` (metres) within walls `half_width` away.
    fn scene<'a>(
        arm: &'a Arm,
        simulator: &'a PressSimulator,
        middle: DVec3,
        half_width: f64,
    ) -> Scene<'a> {
        let session_from_object = Pose::from_parts(glam::DQuat::IDENTITY, middle);
        Scene::new(arm, simulator, session_from_object, Bounds::cube(half_width))
    }

    /// The arm turned about z at the shoulder, the hand about z at the wrist; degrees.
    fn swung(arm: &Arm, shoulder: f64, wrist: f64) -> Configuration {
        let angles = [0.0, shoulder * DEG, 0.0, 0.0, 0.0, 0.0, 0.0, wrist * DEG];
        arm.configuration(&angles).unwrap()
    }

    const FAR: DVec3 = DVec3::new(0.0, 0.0, 5.0);

    #[test]
    fn walls_and_the_arm_itself_block_a_motion() {
        let (arm, simulator) = (arm(), ball());
        let (from, to) = (arm.initial(), swung(&arm, 40.0, 0.0));
        let free = scene(&arm, &simulator, FAR, 1.0);
        assert_eq!(free.motion(&from, &to), Motion::Arrived);
        assert!(free.is_free(&from, &to) && free.can_follow(&from, &to));
        // The sensor gets as far as 0.35 m · sin 40° = 0.225 m in y; in x it starts at 0.35 m.
        let low = Bounds { high: DVec3::new(1.0, 0.2, 1.0), ..Bounds::cube(1.0) };
        let walled = Scene { room: low, ..free.clone() };
        assert_eq!(walled.motion(&from, &to), Motion::Blocked);
        assert!(!walled.can_follow(&from, &to));
        assert!(!scene(&arm, &simulator, FAR, 0.3).is_free(&from, &from));
        // Corners of 110° bring the third link back through the upright one.
        let folded = [0.0, 0.0, 110.0, 0.0, 110.0, 0.0, 0.0, 0.0].map(f64::to_radians);
        let folded = arm.configuration(&folded).unwrap();
        assert_eq!(free.motion(&from, &folded), Motion::Blocked);
        assert!(!free.can_follow(&from, &folded));
    }

    #[test]
    fn an_object_before_link_or_housing_blocks_a_motion() {
        let (arm, simulator) = (arm(), ball());
        let (from, to) = (arm.initial(), swung(&arm, 40.0, 0.0));
        // 0.19 m from the shoulder at 39°: between the first and the second 0.1 m of links.
        let by_link = scene(&arm, &simulator, DVec3::new(0.15, 0.12, 0.2), 1.0);
        assert_eq!(by_link.motion(&from, &to), Motion::Blocked);
        assert!(!by_link.can_follow(&from, &to));
        // Beside the housing at the end of the swing, its middle 5 mm behind the sensor's face.
        let pose = arm.forward(&to).session_from_sensor;
        let left = DVec3::new(0.0, 33.0 * MM, -5.0 * MM);
        let beside = [left, left * DVec3::new(1.0, -1.0, 1.0)].map(|at| pose * at);
        let beside = beside.into_iter().max_by(|a, b| a.y.total_cmp(&b.y)).unwrap();
        let by_housing = scene(&arm, &simulator, beside, 1.0);
        assert!(by_housing.is_free(&from, &from));
        assert_eq!(by_housing.motion(&from, &to), Motion::Blocked);
    }

    #[test]
    fn the_covering_senses_an_object_before_it_is_deep() {
        let (arm, simulator) = (arm(), ball());
        let thickness = simulator.sensor().parameters().covering_thickness;
        // The hand points along the swing; at 20° the ball is 1 mm deep in the covering.
        let (from, at, to) = (swung(&arm, 0.0, 90.0), swung(&arm, 20.0, 90.0), 25.0);
        let to = swung(&arm, to, 90.0);
        let middle = arm.forward(&at).session_from_sensor * DVec3::new(0.0, 0.0, 29.0 * MM);
        let scene = scene(&arm, &simulator, middle, 1.0);
        let Motion::Sensed { free, touching } = scene.motion(&from, &to) else {
            panic!("nothing was sensed")
        };
        let lowest =
            |at: &Configuration| simulator.heights(scene.object_from_sensor(at), 0.0).lowest();
        assert!(lowest(&free) >= 0.0, "{}", lowest(&free));
        assert!((-0.41 * thickness..0.0).contains(&lowest(&touching)), "{}", lowest(&touching));
        assert!(!scene.is_free(&from, &touching));
        // The controllers may press further into the covering.
        assert!(scene.can_follow(&from, &at));
    }
}
