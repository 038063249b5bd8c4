//! Sessions on the wire: readings of one unknown object in, beliefs about it out.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::access::Writer;
use crate::belief::Belief;
use crate::geometry::PosePrior;
use crate::history::TracePoint;
use crate::labels::{Labels, LabelsSchema};
use crate::method::Method;
use crate::pose::Pose;
use crate::reading::{Looseness, Reading};
use crate::warning::Warning;

/// A new session: one object that is touched. It rests in one frame, except with the methods
/// `appearance…`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateSession {
    /// Name of the catalogue. Default: `default`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "default")]
    pub catalogue: Option<String>,
    /// Version of the catalogue, fixed for the session. Default: the current one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub version: Option<u32>,
    /// Alias of a version, such as `candidate`: the session keeps the version that it names now.
    /// Excludes `version`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64)]
    pub alias: Option<String>,
    /// Recognition method. Default: `surface`, or `sva` if the version has no surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
    /// Frame of all sensor poses of the session, such as `base_link`. A reading that names another
    /// frame is refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 256, example = "base_link")]
    pub frame_id: Option<String>,
    /// Prior of the objects, given that the object is in the catalogue. Objects that are not listed
    /// share the rest evenly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_items = 10_000)]
    pub prior: Option<Vec<PriorEntry>>,
    /// Prior probability that the object is not in the catalogue, above 0 and below 1; for
    /// `surface`. Default: 0.05.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, exclusive_maximum = 1.0, example = 0.05)]
    pub unknown_prior: Option<f64>,
    /// Prior of the object's pose: of kind `camera` for the method `surface`, by default none; of
    /// the other kinds for the methods `geometric…`, by default the planar prior's defaults for
    /// maps of kind `planar`, while maps of kind `solid` require it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_prior: Option<PosePrior>,
    /// Number of bins per object along x, y and the rotation, each 2 to 200, at most 100000 in
    /// total; only for `geometric_histogram`. Default: 25, 25, 16.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<u32>>, min_items = 3, max_items = 3,
        example = json!([25, 25, 16]))]
    pub bins: Option<[u32; 3]>,
    /// Number of particles over all objects, 100 to 100000; only for `geometric_particles`.
    /// Default: 10000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 100, maximum = 100_000)]
    pub particles: Option<u32>,
    /// Seed of the random choices of the methods `geometric…`, at most 2⁵³ − 1. Default: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 9_007_199_254_740_991_u64)]
    pub seed: Option<u64>,
    /// Robots with an inexactly known base, for `surface`. All readings of such a robot (by its
    /// `robot`) are displaced by one unknown motion within this uncertainty. Readings of other
    /// robots are taken as exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_items = 100)]
    pub robots: Option<Vec<RobotBase>>,
    /// Motion of the object between any two touches, for `surface`: pressing may shift the object,
    /// or a hand may hold it. Earlier touches then say less about the pose. For a single motion use
    /// `object_moved` of a reading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_moves: Option<Looseness>,
    /// Accepted risk of a wrong answer, 0.0001 to 0.5, for `surface`. The belief's `stop` says when
    /// it is reached.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 0.5, example = 0.05)]
    pub risk: Option<f64>,
    /// Seconds without a new reading after which the session expires, 1 to 31536000; a lease keeps
    /// it open longer. Default: the server's setting, one day unless the operator changed it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 31_536_000)]
    pub ttl_s: Option<u32>,
    /// Labels for searches: at most 16, as `PUT …/labels` describes them.
    #[serde(default, skip_serializing_if = "Labels::is_empty")]
    #[schema(value_type = LabelsSchema)]
    pub labels: Labels,
}

/// The end of a session and, if known, the true object.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CloseSession {
    /// Id or name of the object that was touched. The server counts how often its answer was right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "mug")]
    pub object: Option<String>,
    /// True if the object was not in the catalogue. Excludes `object`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub none_of_these: Option<bool>,
    /// True pose of the object's frame in the session frame, if it is known, as to a simulator.
    /// Needs `object`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
}

/// The true object of a session, as a client reported it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Truth {
    /// Id of the object; null if it was not in the catalogue.
    pub object: Option<Uuid>,
    /// Name of the object; null if it was not in the catalogue.
    pub name: Option<String>,
    /// Probability that the session's belief gave the true answer.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub probability: f64,
    /// Whether the likeliest answer was the true one.
    pub was_right: bool,
    /// True pose of the object's frame in the session frame, if a client told it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose: Option<Pose>,
    /// Distance of the believed pose of the true object from its true pose, in metres; null if no
    /// pose was told or believed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_error: Option<f64>,
    /// Smallest angle between the two, in radians, up to the symmetry of the object that the
    /// training found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_error: Option<f64>,
}

/// A lease that keeps a session open without new readings.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExtendSession {
    /// Minimum time the session stays open from now, in seconds, 1 to 31536000. A longer lease is
    /// never shortened.
    #[schema(minimum = 1, maximum = 31_536_000, example = 3600)]
    pub seconds: u32,
}

/// A robot with an inexactly known base.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotBase {
    /// Name of the robot, as its readings give it.
    #[schema(min_length = 1, max_length = 64, example = "arm-2")]
    pub robot: String,
    /// Uncertainty of its base.
    pub base: Looseness,
}

/// Prior probability of one object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PriorEntry {
    /// The object's id or name.
    #[schema(max_length = 64)]
    pub object: String,
    /// Probability of the object, 0 to 1; at most 1 over all entries.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub probability: f64,
}

/// A session: one object that is touched.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Session {
    /// The session's id.
    pub id: Uuid,
    /// Name of the session's catalogue.
    pub catalogue: String,
    /// Version of the catalogue, fixed when the session was created.
    pub version: u32,
    /// Recognition method.
    pub method: Method,
    /// Prior of the object's pose, with defaults and ids of objects; null without one.
    pub pose_prior: Option<PosePrior>,
    /// Number of bins per object along x, y and the rotation; null unless the method is
    /// `geometric_histogram`.
    #[schema(value_type = Option<Vec<u32>>, min_items = 3, max_items = 3)]
    pub bins: Option<[u32; 3]>,
    /// Number of particles over all objects; null unless the method is `geometric_particles`.
    pub particles: Option<u32>,
    /// Seed of its random choices; null if the method makes none.
    pub seed: Option<u64>,
    /// Robots with an inexactly known base; null if there are none.
    pub robots: Option<Vec<RobotBase>>,
    /// Motion of the object between any two touches; null if it rests.
    pub object_moves: Option<Looseness>,
    /// Prior probability that the object is not in the catalogue; null with methods other than
    /// `surface`.
    pub unknown_prior: Option<f64>,
    /// Accepted risk of a wrong answer; null if not set.
    pub risk: Option<f64>,
    /// Frame of the sensor poses; null if not set.
    pub frame_id: Option<String>,
    /// State of the session.
    pub state: SessionState,
    /// Number of readings that count, that is, without retracted ones.
    pub n_readings: u32,
    /// Number of retracted readings.
    #[serde(default)]
    pub n_retracted: u32,
    /// Number of changes to the readings: arrivals, retractions and the session's end.
    #[serde(default)]
    pub revision: u32,
    /// Seconds without a new reading after which the session expires; null if never.
    pub ttl_s: Option<u32>,
    /// When the session expires if no reading arrives; null if never, or if it has ended.
    #[serde(default)]
    #[schema(format = DateTime)]
    pub expires_at: Option<String>,
    /// End of the lease; null without one.
    #[serde(default)]
    #[schema(format = DateTime)]
    pub leased_until: Option<String>,
    /// The key that requested the lease; null without one, or if the server required no keys.
    #[serde(default)]
    pub leased_by: Option<Writer>,
    /// When the session was created.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When the session ended; null while it is open.
    #[schema(format = DateTime)]
    pub closed_at: Option<String>,
    /// Why the session ended; null while it is open.
    #[serde(default)]
    pub ended: Option<SessionEnd>,
    /// The true object, if a client reported it; null otherwise.
    #[serde(default)]
    pub truth: Option<Truth>,
    /// The newest belief in short; of an ended session, its last belief. Null before the
    /// first, and for sessions that ended before the server kept it. Readings posted with
    /// `belief=none` count soon after the last of them.
    #[serde(default)]
    pub latest: Option<TracePoint>,
    /// The robots that sent the session's 64 newest readings, sorted by name.
    #[serde(default)]
    #[schema(max_items = 64)]
    pub touched_by: Vec<String>,
    /// Its labels.
    #[serde(default)]
    #[schema(value_type = LabelsSchema)]
    pub labels: Labels,
    /// Name of the cell that forwards the session; null if robots use it on this server.
    #[serde(default)]
    pub cell: Option<String>,
}

/// Why a session ended.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SessionEnd {
    /// A client closed the session.
    Closed,
    /// No reading arrived within the time to live, and no lease kept the session open.
    Expired,
}

/// State of a session.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SessionState {
    /// The session accepts readings.
    Open,
    /// The session was closed or has expired. Its belief can still be read.
    Closed,
}

/// Readings to add to a session.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AddReadings {
    /// 1 to 1000 readings, stored whole or not at all. Send a single reading as a list of one.
    #[schema(min_items = 1, max_items = 1000)]
    pub readings: Vec<Reading>,
}

/// How much of the belief an answer contains.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum BeliefDetail {
    /// All objects, and the five likeliest poses.
    #[default]
    Full,
    /// The likeliest object and pose.
    Top,
    /// No belief: the readings are stored, but nothing is computed.
    None,
}

/// Parameters of a request that adds or retracts readings.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct ReadingsQuery {
    /// How much of the belief the answer contains. Default: `full`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub belief: Option<BeliefDetail>,
}

/// Result of adding readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingsAdded {
    /// Id of the session.
    pub session: Uuid,
    /// Number of new readings.
    pub n_new: u32,
    /// Number of readings already stored (same robot, `seq` and content); they are not counted
    /// twice.
    pub n_repeated: u32,
    /// Number of readings that count now, that is, without retracted ones.
    pub n_readings: u32,
    /// Number of presses, where the frames of one press count once; null with `belief=none`.
    #[serde(default)]
    pub n_presses: Option<u32>,
    /// The belief after the readings; null with `belief=none`.
    pub belief: Option<Belief>,
    /// Probable mistakes, such as pressures in kPa or positions in millimetres; at most one of a
    /// kind. The readings count nevertheless: retract those that are wrong.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// Parameters of an event stream.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct EventsQuery {
    /// Ids of 1 to 100 sessions, separated by commas.
    pub sessions: String,
}

/// An event of a session.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SessionEvent {
    /// The belief changed.
    #[schema(title = "BeliefEvent")]
    Belief {
        /// The current belief.
        belief: Belief,
    },
    /// The session was closed.
    #[schema(title = "ClosedEvent")]
    Closed {
        /// The session after closing.
        session: Box<Session>,
    },
    /// The session was deleted.
    #[schema(title = "DeletedEvent")]
    Deleted {
        /// Id of the session.
        session: Uuid,
    },
}
