//! A touch: what one reading says about the piece of surface under the sensor.
//!
//! Where, which way the surface faces, which way the contact is stretched along it, and what
//! it looks like. The frame is that of the reading's pose. The stretch is the second moment
//! of the contact's pressure (section 4.3.2.4); it has no sign: ±direction are one.

use glam::{DVec2, DVec3};

use super::appearance::{AppearanceSpace, Feature};
use crate::contact::{CONTACT_SHARE, center_of_pressure, contact_points, normal_constraint};
use crate::patch::touches;
use crate::reading::{Reading, TactileImage};
use crate::sensor::SensorDescription;

/// One press that touched something.
#[derive(Clone, Debug, PartialEq)]
pub struct Touch {
    /// The centre of pressure on the covering's surface, metres.
    pub position: DVec3,
    /// The outward normal of the surface, norm 1.
    pub normal: DVec3,
    /// Along which the contact is stretched: norm 1, at right angles to the normal.
    pub direction: DVec3,
    /// How much it is stretched: (λ₁ − λ₂)/(λ₁ + λ₂) of the second moments, 0 to 1.
    pub elongation: f64,
    /// How well the contact fixes the normal, 0 to 1 (Algorithm 2).
    pub normal_confidence: f64,
    /// What it looks like.
    pub feature: Feature,
}

/// The touch of a reading, or `None` when the press touched nothing.
#[must_use]
pub fn observe_touch(
    reading: &Reading,
    sensor: &SensorDescription,
    space: &AppearanceSpace,
) -> Option<Touch> {
    if !touches(reading, sensor) {
        return None;
    }
    let image = reading.image();
    let session_from_sensor = reading.session_from_sensor();
    let (direction, elongation) = stretch(image, sensor);
    Some(Touch {
        position: session_from_sensor * center_of_pressure(image, sensor),
        normal: session_from_sensor.turn(DVec3::NEG_Z),
        direction: session_from_sensor.turn(direction.extend(0.0)),
        elongation,
        normal_confidence: normal_constraint(&contact_points(image, sensor)),
        feature: space.feature(image, sensor.grid()),
    })
}

/// The direction (in the sensor's plane, norm 1) and the elongation of a contact.
fn stretch(image: &TactileImage, sensor: &SensorDescription) -> (DVec2, f64) {
    let center = center_of_pressure(image, sensor).truncate();
    let threshold = 0.5 * CONTACT_SHARE * image.max();
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for row in 0..image.rows {
        for col in 0..image.cols {
            let excess = (image.at(row, col) - threshold).max(0.0);
            let off = DVec2::from(sensor.grid().center(row, col)) - center;
            xx += excess * off.x * off.x;
            xy += excess * off.x * off.y;
            yy += excess * off.y * off.y;
        }
    }
    let (along, across, total) = (xx - yy, 2.0 * xy, xx + yy);
    if total <= 0.0 {
        return (DVec2::X, 0.0);
    }
    let angle = 0.5 * across.atan2(along);
    (DVec2::from_angle(angle), (along.hypot(across) / total).min(1.0))
}
