//! What comes between a touch and what a session hears of it: an arm that is not where it
//! says, or an object that moves when it is touched.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::Stream;
use palpate_sim::explore::Perturbation;

/// How poses of a session are off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Disturbance {
    /// They are true.
    #[default]
    None,
    /// Each reading's stated pose is off by itself.
    Arm {
        /// Standard deviation of the sensor's place along each axis, metres.
        position: f64,
        /// Standard deviation of a turn about a random axis through the sensor, rad.
        angle: f64,
    },
    /// The object moves between any two readings; moves add up.
    Moving(Perturbation),
}

impl Disturbance {
    /// Brings readings in the object's frame to a session whose object is at
    /// `session_from_object` at first; with each reading comes where the object was.
    #[must_use]
    pub fn present(
        &self,
        readings: Vec<Reading>,
        session_from_object: Pose,
        stream: &mut Stream,
    ) -> Vec<(Reading, Pose)> {
        let mut place = session_from_object;
        let mut presented = Vec::with_capacity(readings.len());
        for (before, reading) in readings.into_iter().enumerate() {
            if let (Self::Moving(perturbation), true) = (self, before > 0) {
                // The objects of experiments have their middle at their origin.
                place = perturbation.drawn(place, DVec3::ZERO, stream);
            }
            let felt = reading.moved_by(place);
            let heard = match self {
                Self::Arm { position, angle } => misplaced(&felt, *position, *angle, stream),
                Self::None | Self::Moving(_) => felt,
            };
            presented.push((heard, place));
        }
        presented
    }
}

/// A reading with a stated pose that is off by normal deviations.
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
        for (heard, object) in arm.present(readings, place, &mut stream) {
            assert_eq!(object, place);
            shifts += heard.session_from_sensor().distance_to(&truth).powi(2) / 2_000.0;
            turns += heard.session_from_sensor().angle_to(&truth).powi(2) / 2_000.0;
        }
        // Three axes of 1 mm; means of 2,000 squares are off by some 3 %.
        assert!((shifts / (3.0 * MM * MM) - 1.0).abs() < 0.1, "{shifts}");
        assert!((turns / (2.0 * DEG).powi(2) - 1.0).abs() < 0.15, "{turns}");
    }

    #[test]
    fn an_object_moves_from_the_second_touch_on_and_readings_with_it() {
        let perturbation = Perturbation { angle_max: 10.0 * DEG, shift_max: 8.0 * MM };
        let mut stream = Stream::new(2, Purpose::Perturbation, 0);
        let own = readings(1)[0].session_from_sensor();
        let moved = Disturbance::Moving(perturbation);
        let presented = moved.present(readings(20), Pose::IDENTITY, &mut stream);
        assert_eq!(presented[0].1, Pose::IDENTITY);
        for pair in presented.windows(2) {
            assert!(pair[0].1.distance_to(&pair[1].1) <= 8.0 * MM + 1e-12);
            assert!(pair[0].1 != pair[1].1);
        }
        for (heard, place) in &presented {
            assert!(heard.session_from_sensor().distance_to(&(*place * own)) < 1e-12);
        }
        let mut stream = Stream::new(2, Purpose::Perturbation, 0);
        let rests = Disturbance::None.present(readings(3), Pose::IDENTITY, &mut stream);
        assert!(rests.iter().all(|(heard, _)| heard.session_from_sensor() == own));
    }
}
