//! Beliefs on the wire: the object's identity and pose, with their uncertainty.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::pose::Pose;
use crate::symmetry::SymmetryAxis;
use crate::warning::Warning;

/// Parameters of a belief query.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct BeliefQuery {
    /// Maximum number of pose hypotheses, 0 to 100. Default: 5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0, maximum = 100)]
    pub poses: Option<u32>,
    /// Revision to return: the belief after that many journal entries. 0 is the prior. Default: the
    /// latest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub at: Option<u32>,
}

/// Belief about a session's object: its identity and pose, with their uncertainty.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Belief {
    /// The session.
    pub session: Uuid,
    /// Number of changes to the session's readings: arrivals, retractions and the session's end.
    /// Its value is the `ETag`.
    pub revision: u32,
    /// Number of presses the belief rests on: readings that are not retracted, where the frames of
    /// one press (same robot, same place, each within a second of the previous) count once.
    pub n_readings: u32,
    /// The objects, likeliest first. If all are listed, their probabilities and `unknown` sum to 1.
    pub objects: Vec<ObjectProbability>,
    /// Probability that the object is not in the catalogue, 0 to 1. 0 with methods other than
    /// `surface`, which assume that it is.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub unknown: f64,
    /// Whether to stop touching; null unless the session set a `risk`.
    #[serde(default)]
    pub stop: Option<StopAdvice>,
    /// Whether the probabilities were calibrated on readings that training held back. If not, they
    /// and `stop` rest on simulated touches of other objects, or are uncalibrated.
    #[serde(default)]
    pub calibrated: bool,
    /// Why the probabilities are not calibrated; null if they are.
    #[serde(default)]
    pub uncalibrated_reason: Option<UncalibratedReason>,
    /// Entropy of the identity in bits, including "none of these". 0 is certainty; log2(n) is no
    /// knowledge of n objects.
    pub entropy_bits: f64,
    /// Pose hypotheses, likeliest first; do not average them. With `surface` and `sva`, poses
    /// equivalent under the object's `symmetry` are one hypothesis. Empty with the methods
    /// `appearance…`, which estimate no pose.
    pub poses: Vec<PoseHypothesis>,
    /// What all touches together suggest to be wrong, with the likeliest cause, such as a tool
    /// centre that is off. With `surface` only.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// Reason why probabilities are not calibrated.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum UncalibratedReason {
    /// The catalogue was trained with one object, so there are no touches of any other.
    OneObject,
    /// No object has the 100 readings of which training holds a tenth back.
    FewReadings,
    /// The session's method has no calibration.
    Method,
}

/// Advice on whether to stop touching.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct StopAdvice {
    /// The risk that the client set.
    pub risk: f64,
    /// The risk that the likeliest answer, an object or "none of these", is wrong.
    pub found: f64,
    /// Whether `found` is at most `risk`.
    pub reached: bool,
}

/// Probability of one object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectProbability {
    /// The object's id.
    pub object: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Probability of the object, 0 to 1.
    pub probability: f64,
}

/// Hypothesis of an object and its pose.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct PoseHypothesis {
    /// The object's id.
    pub object: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Share of the belief, 0 to 1, including all poses equivalent under the object's symmetry.
    pub weight: f64,
    /// The object's pose in the session frame (`session_from_object`). The origin of the object
    /// frame is the centroid of the mesh or of the training touches; see `origin_in_mesh` in the
    /// version's report.
    pub pose: Pose,
    /// The pose of the model frame in the session frame. The model frame is the frame of the
    /// object's training readings, or, for an object trained from its mesh, the frame of the mesh
    /// file in metres. It is the same for every version. A point p of the model frame lies at
    /// `session_from_model · p` in the session. The axes are those of `pose`; the origin differs.
    pub session_from_model: Pose,
    /// 6 × 6 covariance of `pose`, row-major, in the order of ROS: x, y, z in metres, then rotation
    /// about the fixed x, y, z axes of the session frame in radians. About an axis of full
    /// rotational symmetry the angle is unknown: its variance is at least π²/3 rad².
    #[schema(min_items = 36, max_items = 36)]
    pub covariance: Vec<f64>,
    /// Symmetry axes of this pose in the session frame, highest order first. `pose` stands for all
    /// equivalent poses. Empty if the object has no symmetry, with other methods, and with versions
    /// trained without surfaces.
    #[serde(default)]
    pub symmetry: Vec<SymmetryAxis>,
}
