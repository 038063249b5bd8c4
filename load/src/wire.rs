//! Readings of a simulated sensor in a robot's wire form.

use palpate_core::reading::Reading;
use palpate_schemas as wire;

/// A reading of the named sensor in its wire form, with its pose, without a robot and its number.
#[must_use]
pub fn on_the_wire(reading: &Reading, sensor: &str) -> wire::Reading {
    let pose = reading.sent_pose();
    wire::Reading {
        robot: None,
        seq: None,
        sensor: sensor.to_owned(),
        frame_id: None,
        stamp: None,
        pose: Some(wire::Pose {
            position: pose.translation.to_array(),
            orientation: pose.rotation.to_array(),
        }),
        image: reading.values(),
        feature: None,
        approach_m: None,
        object_moved: None,
        contact: None,
        shear: None,
    }
}
