//! A reading on the wire: one press of a tactile sensor.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::pose::Pose;

/// One press: the image, and where the sensor was, if that is known.
///
/// A press without contact is evidence too: send it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Reading {
    /// Which robot took it. With `seq` it identifies the reading, so that a repeated request
    /// is not counted twice. Give both or neither.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "arm-3")]
    pub robot: Option<String>,
    /// The robot's own number of this reading within the session or object, up to 2⁵³ − 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 9_007_199_254_740_991_u64, example = 17)]
    pub seq: Option<u64>,
    /// The sensor's id or unique name.
    #[schema(example = "digitacts-6x6")]
    pub sensor: String,
    /// The frame in which the pose is given; when given it must be the session's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 256, example = "base_link")]
    pub frame_id: Option<String>,
    /// When it was taken, by the robot's clock. Simulated time may begin at 0: the server does
    /// not compare the stamp with its own clock. A session's readings are folded in the order of
    /// their stamps, those without one first, then of robots, then of `seq`: give one always
    /// where several robots share a session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp: Option<Stamp>,
    /// The sensor's pose in the session frame (`session_from_sensor`); for training readings
    /// in the frame in which the object is at rest. The sensor frame has its origin at the
    /// centre of the covering's free surface, +z out of the sensor towards the object, +x
    /// along columns, +y along rows. May be left out for the methods `appearance…`; all others
    /// need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// Pressures in pascal, row by row as the sensor's driver sends them; `null` marks a taxel
    /// that has no value.
    #[schema(max_items = 16_384)]
    pub image: Vec<Option<f64>>,
    /// A code of the press that the client has computed itself, such as a learned one: 1 to
    /// 4096 numbers within ±10⁹. Only for catalogues whose appearance is trained from
    /// `features`; all readings of an object, and of a catalogue, have as many.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 4096)]
    pub feature: Option<Vec<f64>>,
    /// How far the sensor came along its own +z to the pose with nothing in touch, metres, 0 to
    /// 10. With a press that met nothing, `surface` knows that the whole way is free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 10.0, example = 0.12)]
    pub approach_m: Option<f64>,
    /// How far the object may have moved since the session's reading before, in the order of
    /// stamps, robots and `seq`. For `surface`: what the object is stays as probable as it was,
    /// where it is becomes loose by so much. Withdrawn with the reading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_moved: Option<Looseness>,
}

/// How far something may be from where it is said to be: standard deviations.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Looseness {
    /// In each direction, metres, up to 0.1.
    #[schema(exclusive_minimum = 0.0, maximum = 0.1, example = 0.003)]
    pub position_m: f64,
    /// About each axis, rad, up to 1.
    #[schema(exclusive_minimum = 0.0, maximum = 1.0, example = 0.05)]
    pub angle_rad: f64,
}

/// A time of the robot's clock, as ROS has it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Stamp {
    /// Whole seconds.
    #[schema(minimum = 0, maximum = 9_000_000_000_u64, example = 1_790_000_000)]
    pub sec: u64,
    /// Nanoseconds after them.
    #[schema(minimum = 0, maximum = 999_999_999, example = 250_000_000)]
    pub nanosec: u32,
}
