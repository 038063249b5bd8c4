//! Disturbances between a touch and the session: errors of the arm's pose, errors of the robots'
//! bases, or motion of the object.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Base, Looseness, Reading};
use palpate_core::rng::Stream;
use palpate_sim::explore::Perturbation;

/// Error of the poses in a session.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Disturbance {
    /// No error.
    #[default]
    None,
    /// Independent error of each reading's stated pose.
    Arm {
        /// Standard deviation of the sensor's position along each axis, metres.
        position: f64,
        /// Standard deviation of a rotation about a random axis through the sensor, rad.
        angle: f64,
    },
    /// The stated tool centre is wrong, by a constant in the sensor's frame.
    Tool {
        /// Distance between the true and the stated tool centre, metres, in a random direction.
        offset: f64,
    },
    /// The object moves between any two readings; the motions accumulate.
    Moving(Perturbation),
    /// Robots take turns; the base of each but the first has an error that is constant over its
    /// readings.
    Robots {
        /// Number of robots.
        robots: usize,
        /// Standard deviations of the bases' errors.
        base: Looseness,
        /// Whether each reading states the deviations of its base.
        is_told: bool,
    },
    /// Every place is touched twice: the reading comes again from beside its place.
    Doubled {
        /// Distance along the surface, metres, in a random direction.
        distance: f64,
    },
    /// The object moves once.
    Jolt {
        /// Maximum of the motion.
        by: Perturbation,
        /// Readings before it moves.
        after: usize,
        /// Whether the first reading after the motion announces it, with its range.
        is_told: bool,
    },
}

/// A reading as it reaches the session.
#[derive(Clone, Debug)]
pub struct Presented {
    /// The reading.
    pub reading: Reading,
    /// Pose of the object in the session frame.
    pub session_from_object: Pose,
    /// Announced motion of the object before this reading.
    pub moved: Option<Looseness>,
}

impl Disturbance {
    /// Transforms readings from the object frame into a session whose object is at
    /// `session_from_object` at first.
    #[must_use]
    pub fn present(
        &self,
        readings: Vec<Reading>,
        session_from_object: Pose,
        stream: &mut Stream,
    ) -> Vec<Presented> {
        let mut place = session_from_object;
        let bases = self.bases(place.translation, stream);
        let tool = self.tool(stream);
        let mut presented = Vec::with_capacity(readings.len());
        for (before, reading) in readings.into_iter().enumerate() {
            // The objects of experiments have their centre at their origin.
            let mut move_by = |by: &Perturbation| place = by.drawn(place, DVec3::ZERO, stream);
            let mut moved = None;
            match self {
                Self::Moving(by) if before > 0 => move_by(by),
                Self::Jolt { by, after, is_told } if before == *after => {
                    move_by(by);
                    moved = is_told.then(|| stated(by));
                }
                _ => {}
            }
            let felt = reading.moved_by(place);
            let reading = match self {
                Self::Arm { position, angle } => misplaced(&felt, *position, *angle, stream),
                Self::Robots { base, is_told, .. } => {
                    let robot = before % bases.len();
                    let heard = felt.moved_by(bases[robot]);
                    let looseness = if robot == 0 { Looseness::default() } else { *base };
                    let base = Base { robot: robot as u32, looseness };
                    if *is_told { heard.with_base(base) } else { heard }
                }
                Self::Tool { .. } => {
                    let stated = felt.session_from_sensor();
                    let off = stated * Pose::from_parts(DQuat::IDENTITY, tool);
                    felt.moved_by(off * stated.inverse())
                }
                Self::Doubled { distance } => {
                    let around = stream.uniform(0.0, std::f64::consts::TAU);
                    let along = DQuat::from_rotation_z(around) * DVec3::X * *distance;
                    let off = felt.session_from_sensor().turn(along);
                    let reading = felt.moved_by(Pose::from_parts(DQuat::IDENTITY, off));
                    presented.push(Presented { reading, session_from_object: place, moved: None });
                    felt
                }
                Self::None | Self::Moving(_) | Self::Jolt { .. } => felt,
            };
            presented.push(Presented { reading, session_from_object: place, moved });
        }
        presented
    }

    /// The error of the tool centre in the sensor's frame, metres.
    fn tool(&self, stream: &mut Stream) -> DVec3 {
        match self {
            Self::Tool { offset } if *offset > 0.0 => *offset * stream.direction(),
            _ => DVec3::ZERO,
        }
    }

    /// Transforms from the stated to the true poses of the robots' bases, rotated about the
    /// object, since their looseness is stated there.
    fn bases(&self, object: DVec3, stream: &mut Stream) -> Vec<Pose> {
        let Self::Robots { robots, base, .. } = self else { return Vec::new() };
        let off = |_| {
            let mut three =
                |deviation: f64| deviation * DVec3::from_array([0; 3].map(|_| stream.normal()));
            let (turn, shift) = (three(base.angle), three(base.position));
            let turn = DQuat::from_scaled_axis(turn);
            Pose::from_parts(turn, object + shift - turn * object)
        };
        std::iter::once(Pose::IDENTITY).chain((1..*robots).map(off)).collect()
    }
}

/// Standard deviations of a motion along and about each axis. A length drawn uniformly up to its
/// maximum has a mean square of a third of the maximum's square, and each axis has a third of
/// that.
pub fn stated(by: &Perturbation) -> Looseness {
    Looseness { position: by.shift_max / 3.0, angle: by.angle_max / 3.0 }
}

/// A reading whose stated pose has a normally distributed error.
fn misplaced(reading: &Reading, position: f64, angle: f64, stream: &mut Stream) -> Reading {
    let stated = reading.session_from_sensor();
    let turn = DQuat::from_axis_angle(stream.direction(), angle * stream.normal());
    let shift = position * DVec3::from_array([0; 3].map(|_| stream.normal()));
    let off = Pose::from_parts(turn * stated.rotation, stated.translation + shift);
    reading.moved_by(off * stated.inverse())
}

#[cfg(test)]
mod tests {
    use palpate_core::reading::SensorId;
    use palpate_core::rng::Purpose;
    use palpate_core::sensor::SensorDescription;
    use palpate_core::units::{DEG, MM};

    use super::*;

    fn readings(n: usize) -> Vec<Reading> {
        let sensor = SensorDescription::digitacts_6x6();
        let pose = Pose::from_parts(DQuat::from_rotation_x(0.4), DVec3::new(0.01, 0.02, 0.03));
        let one = Reading::new(SensorId(0), &sensor, &[Some(1e3); 36], pose).unwrap();
        vec![one; n]
    }

    #[test]
    fn an_arm_is_off_by_its_deviations_and_the_object_stays() {
        let arm = Disturbance::Arm { position: 1.0 * MM, angle: 2.0 * DEG };
        let mut stream = Stream::new(1, Purpose::Perturbation, 0);
        let place = Pose::from_parts(DQuat::from_rotation_z(1.0), DVec3::new(0.3, 0.0, 0.1));
        let readings = readings(2_000);
        let truth = place * readings[0].session_from_sensor();
        let (mut shifts, mut turns) = (0.0, 0.0);
        for heard in arm.present(readings, place, &mut stream) {
            assert_eq!((heard.session_from_object, heard.moved), (place, None));
            let heard = heard.reading;
            shifts += heard.session_from_sensor().distance_to(&truth).powi(2) / 2_000.0;
            turns += heard.session_from_sensor().angle_to(&truth).powi(2) / 2_000.0;
        }
        // Three axes of 1 mm; the mean of 2,000 squares has a relative error of about 3 %.
        assert!((shifts / (3.0 * MM * MM) - 1.0).abs() < 0.1, "{shifts}");
        assert!((turns / (2.0 * DEG).powi(2) - 1.0).abs() < 0.15, "{turns}");
    }

    #[test]
    fn readings_move_with_the_object_from_the_second_touch() {
        let perturbation = Perturbation { angle_max: 10.0 * DEG, shift_max: 8.0 * MM };
        let mut stream = Stream::new(2, Purpose::Perturbation, 0);
        let own = readings(1)[0].session_from_sensor();
        let moved = Disturbance::Moving(perturbation);
        let presented = moved.present(readings(20), Pose::IDENTITY, &mut stream);
        let places: Vec<Pose> = presented.iter().map(|p| p.session_from_object).collect();
        assert_eq!(places[0], Pose::IDENTITY);
        for pair in places.windows(2) {
            assert!(pair[0].distance_to(&pair[1]) <= 8.0 * MM + 1e-12);
            assert!(pair[0] != pair[1]);
        }
        for (heard, place) in presented.iter().zip(&places) {
            assert!(heard.reading.session_from_sensor().distance_to(&(*place * own)) < 1e-12);
        }
        let mut stream = Stream::new(2, Purpose::Perturbation, 0);
        let rests = Disturbance::None.present(readings(3), Pose::IDENTITY, &mut stream);
        assert!(rests.iter().all(|heard| heard.reading.session_from_sensor() == own));
    }

    #[test]
    fn a_wrong_tool_centre_is_off_by_a_constant() {
        let tool = Disturbance::Tool { offset: 3.0 * MM };
        let mut turned = readings(2);
        turned[1] = turned[1].moved_by(Pose::from_parts(DQuat::from_rotation_y(2.0), DVec3::Z));
        let place = Pose::from_parts(DQuat::from_rotation_z(1.0), DVec3::new(0.3, 0.0, 0.1));
        let true_poses: Vec<Pose> =
            turned.iter().map(|reading| place * reading.session_from_sensor()).collect();
        let mut stream = Stream::new(5, Purpose::Perturbation, 0);
        let heard = tool.present(turned, place, &mut stream);
        let off = |n: usize| {
            let stated = heard[n].reading.session_from_sensor();
            true_poses[n].inverse() * stated.translation
        };
        assert!((off(0).length() - 3.0 * MM).abs() < 1e-12);
        assert!(off(0).distance(off(1)) < 1e-12);
    }

    #[test]
    fn an_object_is_jolted_once_and_the_session_hears_of_it_if_told() {
        let by = Perturbation { angle_max: 0.3, shift_max: 30.0 * MM };
        let presented = |is_told| {
            let jolt = Disturbance::Jolt { by, after: 4, is_told };
            let mut stream = Stream::new(3, Purpose::Perturbation, 0);
            jolt.present(readings(8), Pose::IDENTITY, &mut stream)
        };
        let heard = presented(true);
        let (before, after) = heard.split_at(4);
        assert!(before.iter().all(|p| p.session_from_object == Pose::IDENTITY));
        assert!(after[0].session_from_object != Pose::IDENTITY);
        assert!(after.iter().all(|p| p.session_from_object == after[0].session_from_object));
        let told: Vec<usize> =
            heard.iter().enumerate().filter(|(_, p)| p.moved.is_some()).map(|(n, _)| n).collect();
        assert_eq!(told, [4]);
        let moved = after[0].moved.unwrap();
        assert!((moved.position - 10.0 * MM).abs() < 1e-12 && (moved.angle - 0.1).abs() < 1e-12);
        assert!(presented(false).iter().all(|p| p.moved.is_none()));
    }

    #[test]
    fn robots_take_turns_and_the_first_one_is_where_it_says() {
        let base = Looseness { position: 5.0 * MM, angle: 0.05 };
        let own = readings(1)[0].session_from_sensor();
        let presented = |is_told| {
            let robots = Disturbance::Robots { robots: 3, base, is_told };
            let mut stream = Stream::new(4, Purpose::Perturbation, 0);
            robots.present(readings(9), Pose::IDENTITY, &mut stream)
        };
        let heard = presented(true);
        let place = |n: usize| heard[n].reading.session_from_sensor();
        for n in 3..9 {
            assert!(place(n).distance_to(&place(n % 3)) < 1e-12, "a base stays where it is");
        }
        assert!(place(0).distance_to(&own) < 1e-12 && place(1).distance_to(&own) > 1e-4);
        assert!(place(1).distance_to(&place(2)) > 1e-4);
        let told = [0, 1, 2].map(|n| heard[n].reading.base().unwrap());
        assert_eq!(told.map(|base| base.robot), [0, 1, 2]);
        assert_eq!(told.map(|t| t.looseness), [Looseness::default(), base, base]);
        assert!(presented(false).iter().all(|p| p.reading.base().is_none()));
    }
}
