//! Sessions on the wire: readings of one unknown object go in, beliefs about it come out.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::access::Writer;
use crate::belief::Belief;
use crate::geometry::PosePrior;
use crate::reading::{Looseness, Reading};
use crate::warning::Warning;

/// A new session: one object that is touched, and, but for the methods `appearance…`, rests
/// in one frame.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateSession {
    /// The catalogue to recognise with; `default` when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "default")]
    pub catalogue: Option<String>,
    /// The catalogue's version; the current one when not given. A session keeps its version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub version: Option<u32>,
    /// How to recognise; `surface` when not given, `sva` if the version has no surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
    /// The frame in which all sensor poses of the session are given, such as `base_link`. A
    /// reading that names another frame is refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 256, example = "base_link")]
    pub frame_id: Option<String>,
    /// What is known before the first touch, if the object is one of the catalogue's. Objects
    /// that are not named share the rest evenly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_items = 10_000)]
    pub prior: Option<Vec<PriorEntry>>,
    /// How probable it is before the first touch that the object is none of the catalogue's,
    /// above 0 and below 1, for `surface`; 0.05 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, exclusive_maximum = 1.0, example = 0.05)]
    pub unknown_prior: Option<f64>,
    /// Where the object may lie, for the methods `geometric…`. With maps of kind `planar` the
    /// planar prior's defaults when not given; with maps of kind `solid` it must be given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_prior: Option<PosePrior>,
    /// How many bins an object has along x, y and the turn, each 2 to 200, together at most
    /// 100000; 25, 25, 16 when not given. Only for `geometric_histogram`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<u32>>, min_items = 3, max_items = 3,
        example = json!([25, 25, 16]))]
    pub bins: Option<[u32; 3]>,
    /// How many particles there are, of all objects together, 100 to 100000; 10000 when not
    /// given. Only for `geometric_particles`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 100, maximum = 100_000)]
    pub particles: Option<u32>,
    /// The seed of the random choices of the methods `geometric…`, up to 2⁵³ − 1; 1 when
    /// not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 9_007_199_254_740_991_u64)]
    pub seed: Option<u64>,
    /// Robots whose bases are not exactly where their poses say, for `surface`: all readings of
    /// such a robot (its `robot`) are shifted alike, by an unknown motion of this looseness.
    /// Readings of all others are taken to be exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_items = 100)]
    pub robots: Option<Vec<RobotBase>>,
    /// How far the object moves between any two touches, for `surface`: being pressed shifts it a
    /// little, or a hand holds it. Earlier touches say the less of where it is. For one known
    /// motion see `object_moved` of a reading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_moves: Option<Looseness>,
    /// The risk of a wrong answer at which you want to stop touching, 0.0001 to 0.5, for
    /// `surface`: the belief's `stop` says when it is reached.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 0.5, example = 0.05)]
    pub risk: Option<f64>,
    /// Seconds without a new reading after which the session expires, 1 to 31536000; the
    /// server's own bound, a day if its operator has not chosen another, when not given. A
    /// lease keeps it open for longer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 31_536_000)]
    pub ttl_s: Option<u32>,
}

/// The end of a session, and what its object was if that is known.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CloseSession {
    /// The object that was touched, by id or name: the server counts how often it was right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "mug")]
    pub object: Option<String>,
    /// True when it was none of the catalogue's objects; not together with `object`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub none_of_these: Option<bool>,
}

/// What a session's object was, as a client said when it closed the session.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Truth {
    /// The object's id; null when it was none of the catalogue's.
    pub object: Option<Uuid>,
    /// Its name; null when it was none of the catalogue's.
    pub name: Option<String>,
    /// The probability that the session's belief gave to that.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub probability: f64,
    /// Whether that was the likeliest answer.
    pub was_right: bool,
}

/// A lease: the session stays open although nothing comes.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExtendSession {
    /// Seconds from now on for which it stays open at least, 1 to 31536000. A lease is never
    /// shortened.
    #[schema(minimum = 1, maximum = 31_536_000, example = 3600)]
    pub seconds: u32,
}

/// What a list of sessions is asked for.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct SessionsQuery {
    /// How many items at most, 1 to 1000; 100 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 1000)]
    pub limit: Option<u32>,
    /// The `next_cursor` of the page before; its content is the server's business.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cursor: Option<String>,
    /// Only sessions in this state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(inline)]
    pub state: Option<SessionState>,
}

/// A robot whose base is not exactly where its poses say.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotBase {
    /// The robot, as its readings name it.
    #[schema(min_length = 1, max_length = 64, example = "arm-2")]
    pub robot: String,
    /// How loosely its readings are placed, where the object is.
    pub base: Looseness,
}

/// The probability of one object before the first touch.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PriorEntry {
    /// The object's id or name.
    pub object: String,
    /// Its probability, 0 to 1; all together at most 1.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub probability: f64,
}

/// How to recognise.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Hypotheses that pairs of touches propose, that every touch verifies and that are
    /// refined; also says when the object is none of the catalogue's. Needs a version that was
    /// trained with surfaces, as all are unless asked not to, and takes readings of any sensor.
    #[default]
    Surface,
    /// Spatially varying appearance with the corrections of `docs/equations.md`.
    Sva,
    /// Spatially varying appearance as the dissertation prints it, for its figures.
    SvaLiteral,
    /// Maps of contact and pressure over poses that a prior bounds. Needs a version that was
    /// trained with `geometry`, and takes readings of any sensor.
    Geometric,
    /// Maps of contact with the dissertation's histogram filter, for its figures.
    GeometricHistogram,
    /// Maps of contact with the dissertation's particle filter, for its figures.
    GeometricParticles,
    /// Bags of features: which object it is, not where. Needs a version that was trained with
    /// `appearance`; poses are not needed, and the object may move between touches.
    Appearance,
    /// Bags of features with the rule as the dissertation prints it, for its figures.
    AppearanceLiteral,
}

/// A session: one object that is touched.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Session {
    /// The session's id.
    pub id: Uuid,
    /// The catalogue that it recognises with.
    pub catalogue: String,
    /// The catalogue's version, fixed when the session was created.
    pub version: u32,
    /// How it recognises.
    pub method: Method,
    /// Where its object may lie, defaults filled in; null with methods that need no prior.
    pub pose_prior: Option<PosePrior>,
    /// Bins of an object along x, y and the turn; null unless the method is
    /// `geometric_histogram`.
    #[schema(value_type = Option<Vec<u32>>, min_items = 3, max_items = 3)]
    pub bins: Option<[u32; 3]>,
    /// Particles of all objects; null unless the method is `geometric_particles`.
    pub particles: Option<u32>,
    /// The seed of its random choices; null when it makes none.
    pub seed: Option<u64>,
    /// Robots whose bases are not exact; null when all are.
    pub robots: Option<Vec<RobotBase>>,
    /// How far the object moves between any two touches; null when it rests.
    pub object_moves: Option<Looseness>,
    /// How probable it was before the first touch that the object is none of the catalogue's;
    /// null with methods other than `surface`.
    pub unknown_prior: Option<f64>,
    /// The risk of a wrong answer at which its client wants to stop; null when not named.
    pub risk: Option<f64>,
    /// The frame of its sensor poses, if it was named.
    pub frame_id: Option<String>,
    /// Whether it takes readings.
    pub state: SessionState,
    /// How many readings it has; withdrawn ones do not count.
    pub n_readings: u32,
    /// How many readings are withdrawn.
    #[serde(default)]
    pub n_retracted: u32,
    /// Counts what changed its readings: readings that came, withdrawals, and its end.
    #[serde(default)]
    pub revision: u32,
    /// Seconds without a new reading after which it expires; null when it never does.
    pub ttl_s: Option<u32>,
    /// When it expires if nothing new comes; null when it never does, or has ended.
    #[serde(default)]
    #[schema(format = DateTime)]
    pub expires_at: Option<String>,
    /// Until when a lease keeps it open; null without one.
    #[serde(default)]
    #[schema(format = DateTime)]
    pub leased_until: Option<String>,
    /// The key that asked for the lease; null without one, and when nobody was asked for a key.
    #[serde(default)]
    pub leased_by: Option<Writer>,
    /// When it was created.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When it ended; null while it is open.
    #[schema(format = DateTime)]
    pub closed_at: Option<String>,
    /// Why it ended; null while it is open.
    #[serde(default)]
    pub ended: Option<SessionEnd>,
    /// What its object was, if a client has said; null otherwise.
    #[serde(default)]
    pub truth: Option<Truth>,
}

/// Why a session takes no more readings.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SessionEnd {
    /// A client closed it.
    Closed,
    /// Nothing new came within its time to live, and no lease kept it open.
    Expired,
}

/// Whether a session takes readings.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SessionState {
    /// It takes readings.
    Open,
    /// It has ended: it was closed, or it expired. Its belief can still be read.
    Closed,
}

/// A page of sessions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SessionPage {
    /// The sessions, oldest first.
    pub items: Vec<Session>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// Readings of a session; one reading is a list of one.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AddReadings {
    /// 1 to 1000 readings. All are taken or none.
    #[schema(min_items = 1, max_items = 1000)]
    pub readings: Vec<Reading>,
}

/// How much of the belief an answer holds.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum BeliefDetail {
    /// Every object, and the five likeliest poses.
    #[default]
    Full,
    /// The likeliest object and pose.
    Top,
    /// No belief: the readings are stored, nothing is computed now.
    None,
}

/// What to answer to readings.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct ReadingsQuery {
    /// How much of the belief to answer; `full` when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub belief: Option<BeliefDetail>,
}

/// What became of readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingsAdded {
    /// The session.
    pub session: Uuid,
    /// How many were new.
    pub n_new: u32,
    /// How many were there already (same robot and seq, same content) and are not counted twice.
    pub n_repeated: u32,
    /// How many readings the session has now; withdrawn ones do not count.
    pub n_readings: u32,
    /// How many presses these are, frames of one press counted once; null with `belief=none`.
    #[serde(default)]
    pub n_presses: Option<u32>,
    /// The belief after them; null with `belief=none`.
    pub belief: Option<Belief>,
    /// What is probably a mistake, such as pressures in kPa or positions in millimetres; at most
    /// one of a kind. The readings count all the same: withdraw those that are wrong.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// Which sessions a stream of events follows.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct EventsQuery {
    /// Ids of 1 to 100 sessions, separated by commas.
    pub sessions: String,
}

/// Something happened to a session.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SessionEvent {
    /// The belief as it is now.
    #[schema(title = "BeliefEvent")]
    Belief {
        /// The belief.
        belief: Belief,
    },
    /// The session was closed.
    #[schema(title = "ClosedEvent")]
    Closed {
        /// The session as it is now.
        session: Box<Session>,
    },
    /// The session was deleted.
    #[schema(title = "DeletedEvent")]
    Deleted {
        /// The session's id.
        session: Uuid,
    },
}
