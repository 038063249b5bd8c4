//! Beliefs on the wire: which object it is, where it is and how it is turned, and how sure that is.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::pose::Pose;
use crate::symmetry::SymmetryAxis;

/// What a belief query asks for.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct BeliefQuery {
    /// How many pose hypotheses at most, 0 to 100; 5 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0, maximum = 100)]
    pub poses: Option<u32>,
    /// Of which revision, such as the one of an earlier belief: after so many readings and
    /// retractions, as they came; 0 is before the first, the newest when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub at: Option<u32>,
}

/// What is known of a session's object: which one it is, where, and how certainly.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Belief {
    /// The session.
    pub session: Uuid,
    /// Counts the changes of the session's readings (one that came, one that was withdrawn, the
    /// session's end); its value is the `ETag`.
    pub revision: u32,
    /// How many presses it rests on: readings of the session that are not withdrawn, the frames
    /// of one press (one robot, one place, each within a second of the one before) counted once.
    pub n_readings: u32,
    /// The objects, likeliest first; with `unknown` their probabilities sum to 1 when all are
    /// listed.
    pub objects: Vec<ObjectProbability>,
    /// How probable it is that the object is none of the catalogue's, 0 to 1; 0 with methods
    /// other than `surface`, which take it for one of them.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub unknown: f64,
    /// Whether to stop touching, for sessions that named a `risk`; null otherwise.
    #[serde(default)]
    pub stop: Option<StopAdvice>,
    /// Whether the probabilities were calibrated on readings that training held back. If not,
    /// they and `stop` rest on simulated touches of other objects, or on none.
    #[serde(default)]
    pub calibrated: bool,
    /// Why the probabilities are not calibrated; null when they are.
    #[serde(default)]
    pub uncalibrated_reason: Option<UncalibratedReason>,
    /// Uncertainty about the identity in bits, "none of these" included: 0 is certain, log2(n)
    /// knows nothing of n objects.
    pub entropy_bits: f64,
    /// Pose hypotheses, likeliest first; do not average them. With the methods `surface` and
    /// `sva`, poses that look the same by the object's `symmetry` are one. Empty with the methods `appearance…`, which know nothing of poses.
    pub poses: Vec<PoseHypothesis>,
}

/// Why probabilities are not calibrated.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum UncalibratedReason {
    /// The catalogue was trained with one object: no touches are known of any other.
    OneObject,
    /// No object has the 100 readings of which training holds a tenth back.
    FewReadings,
    /// The session's method has no calibration.
    Method,
}

/// Whether the answer is sure enough to stop.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct StopAdvice {
    /// The risk that the client named.
    pub risk: f64,
    /// The risk that the likeliest answer, an object or "none of these", is wrong.
    pub found: f64,
    /// Whether it is low enough.
    pub reached: bool,
}

/// How probable one object is.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectProbability {
    /// The object's id.
    pub object: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Its probability, 0 to 1.
    pub probability: f64,
}

/// One hypothesis of what the object is and where.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct PoseHypothesis {
    /// The object's id.
    pub object: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// The hypothesis's share of the belief, 0 to 1, that of all poses that look the same
    /// included.
    pub weight: f64,
    /// The object's pose in the session frame (`session_from_object`). The object frame has its
    /// origin at the centroid of the mesh or of the training touches, see `origin_in_mesh` of
    /// the version's report.
    pub pose: Pose,
    /// The pose of the model frame in the session frame. The model frame is the frame of the
    /// object's training readings when a robot taught it, else its mesh file's own frame (the
    /// coordinates in metres); it is the same for every version. A point p of that frame lies
    /// at `session_from_model · p`. It is `pose` with another origin and the same axes.
    pub session_from_model: Pose,
    /// 6 × 6 covariance of `pose`, row-major, in the order of ROS: x, y, z in metres, then rotation about
    /// the fixed x, y, z axes of the session frame in radians. About an axis that every turn
    /// leaves as it is, the angle is unknown: its variance is π²/3 rad² and more.
    #[schema(min_items = 36, max_items = 36)]
    pub covariance: Vec<f64>,
    /// Which turns of this pose look the same, as axes in the session frame, highest order
    /// first: `pose` stands for all of them. Empty when the object only looks like itself, with
    /// the other methods, and with versions that were trained without surfaces.
    #[serde(default)]
    pub symmetry: Vec<SymmetryAxis>,
}
