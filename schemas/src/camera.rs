//! A camera's word on the wire: hypotheses of an object's pose, weights of objects, a workspace.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::pose::Pose;
use crate::reading::Looseness;

/// A possible pose of the object, with its uncertainty: `deviation` or `covariance`.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StatedPose {
    /// Id or name of the object that was seen. Default: any object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "mug")]
    pub object: Option<String>,
    /// Mean pose of the object's frame in the session frame, as `pose` of a belief states it.
    pub pose: Pose,
    /// Standard deviations along each axis and about each axis of the session frame, at least
    /// 0.00001 m and 0.0001 rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation: Option<Looseness>,
    /// 6 × 6 covariance, row-major, in the order of ROS and of a belief's `covariance`: x, y, z in
    /// metres, then rotation about the fixed x, y, z axes of the session frame in radians.
    /// Symmetric and positive definite, with deviations of 0.00001 to 1 m and 0.0001 to π rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 36, max_items = 36)]
    pub covariance: Option<Vec<f64>>,
    /// Weight beside the other hypotheses, 0 to 1000000. Default: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub weight: Option<f64>,
}

/// A detector's weight of an object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ClassWeight {
    /// Id or name of the object.
    #[schema(max_length = 64, example = "mug")]
    pub object: String,
    /// Weight, 0 to 1000000; only ratios count.
    #[schema(minimum = 0.0, maximum = 1_000_000.0)]
    pub weight: f64,
}

/// A box in the session frame that holds the origin of the object's frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct WorkspaceBox {
    /// The corner with the smallest x, y and z, in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3, example = json!([0.2, -0.3, 0.0]))]
    pub low: [f64; 3],
    /// The corner with the largest x, y and z, in metres: larger than `low` by 0.001 to 100.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3, example = json!([0.6, 0.1, 0.2]))]
    pub high: [f64; 3],
}
