//! A reading on the wire: one press of a tactile sensor, or one contact without an image.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa::openapi::schema::{Array, ArrayBuilder, ObjectBuilder, SchemaType, Type};

use crate::pose::Pose;

/// One press: the image and, if known, the sensor's pose; or one contact without an image.
///
/// A press without contact is evidence too: send it.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Reading {
    /// Name of the robot that took the reading. `robot` and `seq` together identify the reading, so
    /// that a repeated request is not counted twice. Give both or neither.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "arm-3")]
    pub robot: Option<String>,
    /// The robot's sequence number of the reading within the session or object, at most 2⁵³ − 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 9_007_199_254_740_991_u64, example = 17)]
    pub seq: Option<u64>,
    /// Id or unique name of the sensor.
    #[schema(max_length = 64, example = "digitacts-6x6")]
    pub sensor: String,
    /// Frame of the pose; if given, it must be the session's. Empty is none, and a leading slash is
    /// left out, as ROS writes them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 256, example = "base_link")]
    pub frame_id: Option<String>,
    /// When the reading was taken, by the robot's clock. It is not compared with the server's
    /// clock, so simulated time may start at 0. A session folds its readings by stamp (readings
    /// without one first), then robot, then `seq`: always give a stamp if several robots share a
    /// session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp: Option<Stamp>,
    /// The sensor's pose in the session frame (`session_from_sensor`); for training readings, in
    /// the frame in which the object is at rest. The sensor frame has its origin at the centre of
    /// the covering's free surface, +z out of the sensor towards the object, +x along columns, +y
    /// along rows. Optional with the methods `appearance…`, required with all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// Pressures in pascal, row by row as the sensor's driver sends them; `null` marks a taxel
    /// without a value. Exactly one of `image` and `contact` is given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 16_384)]
    pub image: Vec<Option<f64>>,
    /// A contact without an image, as a bumper, a force–torque sensor or a single taxel feels it.
    /// It has its own position, so the reading has no `pose`. The method `surface` uses it, the
    /// others ignore it with a warning. Sessions only: objects are learnt from images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<Contact>,
    /// Shear of three-axis taxels in pascal: two values for each taxel, along the sensor's +x and
    /// +y, in the order of the image; `null` marks a taxel without a value. It is stored and
    /// returned with the reading. No method uses it yet, and the answer warns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = shears)]
    pub shear: Option<Vec<Option<[f64; 2]>>>,
    /// The client's own feature of the press, such as a learned code: 1 to 4096 numbers within
    /// ±10⁹. Only for catalogues whose appearance is trained from `features`. All readings of a
    /// catalogue have the same number of components.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 4096)]
    pub feature: Option<Vec<f64>>,
    /// Distance in metres that the sensor travelled along its +z to the pose without contact, 0 to
    /// 10; for a `contact`, against its normal to its position. If the press met nothing, `surface`
    /// takes the whole path as free space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 10.0, example = 0.12)]
    pub approach_m: Option<f64>,
    /// How far the object may have moved since the session's previous reading, in folding order.
    /// With `surface`, the identity stays as probable as it was and the pose becomes uncertain by
    /// this amount. Retracting the reading retracts the motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_moved: Option<Looseness>,
}

/// A contact without an image: where a surface was felt, or that nothing was felt there.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Whether something was touched; `false` means that nothing is at the position. Default: true.
    #[serde(default = "touched")]
    #[schema(default = true)]
    pub touched: bool,
    /// Position of the contact in the session frame, in metres: x, y, z.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3,
        example = json!([0.412, -0.085, 0.163]))]
    pub position: [f64; 3],
    /// Standard deviation of the position in each direction, in metres, at most 0.1: of the sensor
    /// and of the arm's pose together. A bumper may know 0.02, a taxel half its width.
    #[schema(minimum = 1e-9, maximum = 0.1, example = 0.002)]
    pub position_deviation_m: f64,
    /// Outward normal of the touched surface in the session frame, a unit vector x, y, z: against
    /// the direction of the push. Leave it out if it is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<f64>>, min_items = 3, max_items = 3,
        example = json!([0.0, 0.0, 1.0]))]
    pub normal: Option<[f64; 3]>,
    /// Standard deviation of the normal about either axis, in radians, at most 1. Given with
    /// `normal`, and only then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1.0, example = 0.2)]
    pub normal_deviation_rad: Option<f64>,
    /// Normal force in newton, 0 to 100,000. It is stored and returned; no method uses it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 100_000.0, example = 2.5)]
    pub force_n: Option<f64>,
}

/// The list of shears: the derive bounds the outer list alone.
fn shears() -> Array {
    let or_null = |one| SchemaType::Array(vec![one, Type::Null]);
    let number = ObjectBuilder::new().schema_type(Type::Number);
    let pair = ArrayBuilder::new().schema_type(or_null(Type::Array)).items(number);
    let pair = pair.min_items(Some(2)).max_items(Some(2));
    ArrayBuilder::new()
        .schema_type(or_null(Type::Array))
        .items(pair)
        .max_items(Some(16_384))
        .description(Some(
            "Shear of three-axis taxels in pascal: two values for each taxel, along the sensor's \
             +x and +y, in the order of the image; `null` marks a taxel without a value. It is \
             stored and returned with the reading. No method uses it yet, and the answer warns.",
        ))
        .build()
}

/// A contact touches unless it says otherwise.
fn touched() -> bool {
    true
}

/// Uncertainty of a position and orientation, as standard deviations.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Looseness {
    /// Standard deviation in each direction, in metres, 1e-9 to 0.1.
    #[schema(minimum = 1e-9, maximum = 0.1, example = 0.003)]
    pub position_m: f64,
    /// Standard deviation about each axis, in radians, 1e-9 to 1.
    #[schema(minimum = 1e-9, maximum = 1.0, example = 0.05)]
    pub angle_rad: f64,
}

/// A time by the robot's clock, as in ROS.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Stamp {
    /// Whole seconds.
    #[schema(minimum = 0, maximum = 9_000_000_000_u64, example = 1_790_000_000)]
    pub sec: u64,
    /// Nanoseconds after the whole seconds.
    #[schema(minimum = 0, maximum = 999_999_999, example = 250_000_000)]
    pub nanosec: u32,
}
