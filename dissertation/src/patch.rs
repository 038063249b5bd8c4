//! A surface patch: the piece of surface that one reading touched.
//!
//! Source: sections 5.3.1 and 5.4.2. The frame is that of the reading's pose: the object's in
//! training, the session's in recognition. A press without contact has no patch.

use glam::DVec3;

use palpate_core::contact::{center_of_pressure, contact_points, normal_constraint, touches};
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::vocabulary::{Association, AssociationRule, Vocabulary};

/// Position, outward normal and appearance of a touched piece of surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Position, metres: the centre of pressure on the covering's surface.
    pub position: DVec3,
    /// The outward surface normal, norm 1.
    pub normal: DVec3,
    /// Constraint of the contact on the normal, 0 to 1 (Algorithm 2).
    pub normal_confidence: f64,
    /// The possible appearance classes; weights sum to 1.
    pub classes: Vec<Association>,
}

/// The patch of a reading, or `None` for a press without contact.
#[must_use]
pub fn observe_patch(
    reading: &Reading,
    sensor: &SensorDescription,
    vocabulary: &Vocabulary,
    rule: AssociationRule,
) -> Option<Patch> {
    let image = reading.image();
    if !touches(reading, sensor) {
        return None;
    }
    let session_from_sensor = reading.session_from_sensor();
    Some(Patch {
        position: session_from_sensor * center_of_pressure(image, sensor),
        normal: session_from_sensor.turn(DVec3::NEG_Z),
        normal_confidence: normal_constraint(&contact_points(image, sensor)),
        classes: vocabulary.associate(&vocabulary.feature(image), rule),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_core::descriptor::DescriptorKind;
    use palpate_core::pose::Pose;
    use palpate_core::reading::SensorId;
    use palpate_core::units::MM;

    fn vocabulary() -> Vocabulary {
        let mut medoid = vec![0.0; 36];
        medoid[0] = 1.0;
        Vocabulary {
            descriptor: DescriptorKind::Vectorize,
            rows: 6,
            cols: 6,
            mean: vec![0.0; 36],
            medoids: vec![medoid],
            spreads: vec![0.1],
        }
    }

    #[test]
    fn the_normal_points_out_of_the_surface_towards_the_sensor() {
        // The sensor faces along its +z; here it is turned to face along −x from x = 10 mm.
        let sensor = SensorDescription::digitacts_6x6();
        let turn = glam::DQuat::from_rotation_arc(DVec3::Z, DVec3::NEG_X);
        let pose = Pose::from_parts(turn, DVec3::new(10.0 * MM, 0.0, 0.0));
        let reading = Reading::new(SensorId(0), &sensor, &[Some(5_000.0); 36], pose).unwrap();
        let patch =
            observe_patch(&reading, &sensor, &vocabulary(), AssociationRule::default()).unwrap();
        assert!(patch.normal.distance(DVec3::X) < 1e-12);
        assert!((patch.normal_confidence - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_press_within_the_noise_has_no_patch() {
        let sensor = SensorDescription::digitacts_6x6();
        let reading =
            Reading::new(SensorId(0), &sensor, &[Some(90.0); 36], Pose::IDENTITY).unwrap();
        assert_eq!(
            observe_patch(&reading, &sensor, &vocabulary(), AssociationRule::default()),
            None
        );
    }
}
