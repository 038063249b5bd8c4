//! Points and poses on the wire: position in metres, orientation as a unit quaternion x, y, z, w.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A rigid pose: where one frame is in another.
///
/// A sensor's pose in a session maps sensor coordinates into the session frame
/// (`session_from_sensor`), like the transform of the sensor in the base frame in ROS.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Translation x, y, z in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3, example = json!([0.4, -0.1, 0.25]))]
    pub position: [f64; 3],
    /// Unit quaternion in the order x, y, z, w. The identity is 0, 0, 0, 1.
    #[schema(value_type = Vec<f64>, min_items = 4, max_items = 4, example = json!([0.0, 0.0, 0.0, 1.0]))]
    pub orientation: [f64; 4],
}

/// A point in metres, or a unit direction.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Point {
    /// Along +x.
    pub x: f64,
    /// Along +y.
    pub y: f64,
    /// Along +z.
    pub z: f64,
}
