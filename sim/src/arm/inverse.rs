//! Inverse kinematics: joint angles that bring the sensor to a target.
//!
//! Damped least squares with Levenberg's choice of the damping, within the joints' limits,
//! restarted from disturbed angles when it gets stuck, for example at stretched links. An
//! angle error counts as the displacement of a point [`LEVER`] from the sensor's origin, so
//! all errors are in metres.

use glam::DVec3;
use nalgebra::{Matrix6, Vector6};
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;
use palpate_core::units::{DEG, MM};

use super::{Arm, Configuration, Placement};

/// Metres of error that one radian counts as.
const LEVER: f64 = 50.0 * MM;
/// Largest error (metres) that one iteration corrects.
const ERROR_MAX: f64 = 60.0 * MM;
/// Bounds of the damping, square metres; a step that needs more than the upper one cannot help.
const DAMPING_MIN: f64 = 1e-9;
const DAMPING_MAX: f64 = 10.0;
/// Increase of the angles' disturbance from one restart to the next, radians.
const RESTART_STEP: f64 = 0.12;

/// Target of the sensor, in the session frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// A full pose, `session_from_sensor`.
    Pose(Pose),
    /// A position of the sensor's origin, metres; its orientation is free.
    Position(DVec3),
    /// A position and a viewing direction; the rotation about that direction is free.
    Facing {
        /// Position of the sensor's origin, metres.
        position: DVec3,
        /// Direction of its +z, of length 1.
        direction: DVec3,
    },
}

/// Tolerances and limits of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseConfig {
    /// Largest distance of the sensor's origin from its target, metres.
    pub position_tolerance: f64,
    /// Largest angle between its orientation and the target's, radians.
    pub angle_tolerance: f64,
    /// Maximum iterations of one attempt.
    pub iterations_max: usize,
    /// Maximum restarts, each from angles that are disturbed more than before.
    pub restarts_max: usize,
}

impl InverseConfig {
    /// Accuracy of recorded poses: 1 µm and 1e-5 rad.
    pub const EXACT: Self = Self {
        position_tolerance: 1e-6,
        angle_tolerance: 1e-5,
        iterations_max: 60,
        restarts_max: 8,
    };

    /// Accuracy for a step through free air: 0.1 mm in position, 20° in direction.
    pub const COARSE: Self = Self {
        position_tolerance: 0.1 * MM,
        angle_tolerance: 20.0 * DEG,
        iterations_max: 40,
        restarts_max: 1,
    };
}

impl Arm {
    /// A configuration that brings the sensor to `target`, near `start` if possible; `None`
    /// if every attempt fails. Restarts are drawn from `stream`.
    #[must_use]
    pub fn inverse(
        &self,
        target: &Target,
        start: &Configuration,
        config: &InverseConfig,
        stream: &mut Stream,
    ) -> Option<Configuration> {
        self.inverse_near(target, start, config).or_else(|| {
            (1..=config.restarts_max).find_map(|attempt| {
                let from = self.disturbed(start, RESTART_STEP * attempt as f64, stream);
                self.descend(target, from, config)
            })
        })
    }

    /// A configuration that brings the sensor to `target` in one descent from `start`; `None`
    /// if there is none nearby.
    #[must_use]
    pub fn inverse_near(
        &self,
        target: &Target,
        start: &Configuration,
        config: &InverseConfig,
    ) -> Option<Configuration> {
        self.descend(target, start.clone(), config)
    }

    /// Adds a normal deviate of standard deviation `deviation` (radians) to every angle.
    fn disturbed(
        &self,
        start: &Configuration,
        deviation: f64,
        stream: &mut Stream,
    ) -> Configuration {
        let angles = start.0.iter().enumerate().map(|(axis, angle)| {
            let limit = self.limit(axis);
            (angle + deviation * stream.normal()).clamp(-limit, limit)
        });
        Configuration(angles.collect())
    }

    /// Levenberg's descent: damping falls after a step that helped and rises after one that
    /// did not, which is discarded. Near stretched links undamped steps would overshoot
    /// forever.
    fn descend(
        &self,
        target: &Target,
        mut configuration: Configuration,
        config: &InverseConfig,
    ) -> Option<Configuration> {
        let mut placement = self.forward(&configuration);
        let mut error = target.error(placement.session_from_sensor);
        let mut damping = 1e-4;
        for _ in 0..config.iterations_max {
            if error.position() <= config.position_tolerance
                && error.angle() <= config.angle_tolerance
            {
                return Some(configuration);
            }
            let columns = self.columns(&placement, target);
            let next = self.stepped(&configuration, &columns, error.clamped(), damping);
            let next_placement = self.forward(&next);
            let next_error = target.error(next_placement.session_from_sensor);
            if next_error.0.norm() < error.0.norm() {
                (configuration, placement, error) = (next, next_placement, next_error);
                damping = (damping * 0.2).max(DAMPING_MIN);
            } else {
                damping *= 5.0;
            }
            if damping > DAMPING_MAX {
                return None;
            }
        }
        None
    }

    /// One damped step. Axes that would leave their limits stay there; the others take over.
    fn stepped(
        &self,
        configuration: &Configuration,
        columns: &[Vector6<f64>],
        error: Vector6<f64>,
        damping: f64,
    ) -> Configuration {
        let beyond =
            |axis: usize, change: f64| (configuration.0[axis] + change).abs() > self.limit(axis);
        let changes = damped_changes(columns, |_| true, error, damping);
        let hits: Vec<bool> =
            changes.iter().enumerate().map(|(axis, change)| beyond(axis, *change)).collect();
        let changes = if hits.contains(&true) {
            damped_changes(columns, |axis| !hits[axis], error, damping)
        } else {
            changes
        };
        let angles =
            configuration.0.iter().zip(&changes).enumerate().map(|(axis, (angle, change))| {
                let limit = self.limit(axis);
                (angle + change).clamp(-limit, limit)
            });
        Configuration(angles.collect())
    }

    /// The Jacobian's columns: the motion of the sensor per radian of each axis.
    fn columns(&self, placement: &Placement, target: &Target) -> Vec<Vector6<f64>> {
        let sensor = placement.session_from_sensor;
        let facing = sensor.turn(DVec3::Z);
        let columns = placement.axes.iter().enumerate().map(|(axis, direction)| {
            let joint = placement.points[axis / 2 + 1];
            let turn = match target {
                Target::Pose(_) => *direction,
                Target::Position(_) => DVec3::ZERO,
                Target::Facing { .. } => *direction - direction.dot(facing) * facing,
            };
            stacked(direction.cross(sensor.translation - joint), turn)
        });
        columns.collect()
    }
}

/// The changes of all free axes that reduce `error`: Jᵀ (J Jᵀ + damping)⁻¹ error.
fn damped_changes(
    columns: &[Vector6<f64>],
    is_free: impl Fn(usize) -> bool,
    error: Vector6<f64>,
    damping: f64,
) -> Vec<f64> {
    let mut normal = Matrix6::identity() * damping;
    for (_, column) in columns.iter().enumerate().filter(|(axis, _)| is_free(*axis)) {
        normal += column * column.transpose();
    }
    // Damping makes it positive definite; if rounding does not, no step is taken.
    let weights = normal.cholesky().map_or_else(Vector6::zeros, |factor| factor.solve(&error));
    let change = |(axis, column): (usize, &Vector6<f64>)| {
        if is_free(axis) { column.dot(&weights) } else { 0.0 }
    };
    columns.iter().enumerate().map(change).collect()
}

/// The remaining error: a translation and, times [`LEVER`], a rotation; metres, session frame.
#[derive(Clone, Copy, Debug)]
struct Residual(Vector6<f64>);

impl Residual {
    fn position(&self) -> f64 {
        self.0.fixed_rows::<3>(0).norm()
    }

    fn angle(&self) -> f64 {
        self.0.fixed_rows::<3>(3).norm() / LEVER
    }

    /// The error shortened to what one step corrects.
    fn clamped(&self) -> Vector6<f64> {
        self.0 * (ERROR_MAX / self.0.norm()).min(1.0)
    }
}

impl Target {
    fn error(&self, session_from_sensor: Pose) -> Residual {
        let (shift, turn) = self.shift_and_turn(session_from_sensor);
        Residual(stacked(shift, turn))
    }

    /// The remaining translation (metres) and rotation (axis times radians), session frame.
    fn shift_and_turn(&self, session_from_sensor: Pose) -> (DVec3, DVec3) {
        let at = session_from_sensor.translation;
        match *self {
            Self::Pose(wanted) => {
                let missing = wanted.rotation * session_from_sensor.rotation.conjugate();
                let short = if missing.w < 0.0 { -missing } else { missing };
                (wanted.translation - at, short.to_scaled_axis())
            }
            Self::Position(position) => (position - at, DVec3::ZERO),
            Self::Facing { position, direction } => {
                let facing = session_from_sensor.turn(DVec3::Z);
                let axis = facing.cross(direction);
                let angle = axis.length().atan2(facing.dot(direction));
                // Facing the opposite way, any axis across will do.
                let axis = axis.try_normalize().unwrap_or_else(|| facing.any_orthonormal_vector());
                (position - at, angle * axis)
            }
        }
    }
}

fn stacked(shift: DVec3, turn: DVec3) -> Vector6<f64> {
    let turn = LEVER * turn;
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::Purpose;

    use super::*;
    use crate::arm::ArmConfig;

    fn random(arm: &Arm, share: f64, stream: &mut Stream) -> Configuration {
        let angles: Vec<f64> = (0..arm.n_axes())
            .map(|axis| share * arm.limit(axis) * stream.uniform(-1.0, 1.0))
            .collect();
        arm.configuration(&angles).unwrap()
    }

    #[test]
    fn reachable_poses_are_reached_within_the_limits() {
        for n_links in [3, 5, 8, 12] {
            let arm = Arm::new(ArmConfig::around(0.1, n_links)).unwrap();
            let mut stream = Stream::new(1, Purpose::Exploration, n_links as u64);
            let config = InverseConfig { restarts_max: 40, ..InverseConfig::EXACT };
            let reached = (0..50)
                .filter(|_| {
                    let wanted = arm.forward(&random(&arm, 0.6, &mut stream)).session_from_sensor;
                    let target = Target::Pose(wanted);
                    let found = arm.inverse(&target, &arm.initial(), &config, &mut stream);
                    found.is_some_and(|found| {
                        let pose = arm.forward(&found).session_from_sensor;
                        assert!(pose.distance_to(&wanted) <= 1e-6);
                        assert!(pose.angle_to(&wanted) <= 1e-5);
                        assert_eq!(arm.configuration(found.angles()).as_ref(), Some(&found));
                        true
                    })
                })
                .count();
            assert!(reached >= 49, "{n_links} links: {reached} of 50");
        }
    }

    #[test]
    fn a_small_step_stays_near_its_start() {
        let arm = Arm::new(ArmConfig::around(0.1, 8)).unwrap();
        let mut stream = Stream::new(2, Purpose::Exploration, 0);
        for _ in 0..50 {
            let start = random(&arm, 0.5, &mut stream);
            let pose = arm.forward(&start).session_from_sensor;
            let position = pose.translation + 5.0 * MM * stream.direction();
            let target = Target::Facing { position, direction: pose.turn(DVec3::Z) };
            let found = arm.inverse(&target, &start, &InverseConfig::COARSE, &mut stream).unwrap();
            let moved = start.angles().iter().zip(found.angles());
            let largest = moved.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(largest < 0.3, "{largest}");
            let reached = arm.forward(&found).session_from_sensor;
            assert!(reached.translation.distance(position) < 0.1 * MM);
            assert!(reached.turn(DVec3::Z).angle_between(pose.turn(DVec3::Z)) < 20.0 * DEG);
        }
    }

    #[test]
    fn targets_out_of_reach_have_no_configuration() {
        let arm = Arm::new(ArmConfig::around(0.1, 6)).unwrap();
        let mut stream = Stream::new(3, Purpose::Exploration, 0);
        let target = Target::Facing { position: DVec3::splat(2.0), direction: DVec3::X };
        let config = InverseConfig::COARSE;
        assert_eq!(arm.inverse(&target, &arm.initial(), &config, &mut stream), None);
    }
}
