//! Session history on the wire: readings, replay, and the contribution of each reading.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::access::Writer;
use crate::belief::Belief;
use crate::pose::Pose;
use crate::reading::{Contact, Looseness, Stamp};

/// A stored reading of a session.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SessionReading {
    /// Number of the reading within the session. Its arrival made revision `number` + 1.
    pub number: u32,
    /// The robot that took the reading; null if it came without an id.
    pub robot: Option<String>,
    /// The robot's sequence number of the reading.
    pub seq: Option<u64>,
    /// Id of the sensor.
    pub sensor: Uuid,
    /// When the reading was taken, by the robot's clock.
    pub stamp: Option<Stamp>,
    /// When the reading arrived, by the server's clock.
    #[schema(format = DateTime)]
    pub received_at: String,
    /// The key the reading was written with; null if not recorded, or if the server required no
    /// keys.
    #[serde(default)]
    pub written_by: Option<Writer>,
    /// The revision that retracted the reading; null while it counts.
    pub retracted_by: Option<u32>,
    /// The key the retraction was written with; null as for `written_by`, and while the reading
    /// counts.
    #[serde(default)]
    pub retraction_written_by: Option<Writer>,
    /// The sensor's pose in the session frame as it was sent; null if unknown.
    pub pose: Option<Pose>,
    /// The pose after the correction by the sensor's passport; null if that changed nothing.
    #[serde(default)]
    pub corrected_pose: Option<Pose>,
    /// Pressures in pascal, as sent; empty for a contact without an image.
    pub image: Vec<Option<f64>>,
    /// The contact of a reading without an image; null for one with an image.
    #[serde(default)]
    pub contact: Option<Contact>,
    /// Shear in pascal, as sent: two values for each taxel; null if not sent.
    #[serde(default)]
    pub shear: Option<Vec<Option<[f64; 2]>>>,
    /// Number of the sensor calibration applied to the pressures; null if there was none.
    pub calibration: Option<u32>,
    /// The client's own feature of the press; null if not sent.
    pub feature: Option<Vec<f64>>,
    /// Distance in metres that the sensor travelled along its +z without contact; 0 if not sent.
    pub approach_m: f64,
    /// How far the object may have moved since the previous reading; null if it was announced as
    /// resting.
    pub object_moved: Option<Looseness>,
}

/// A page of a session's readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SessionReadingPage {
    /// The readings in the order of arrival, including retracted ones.
    pub items: Vec<SessionReading>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// Result of a retraction.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingRetracted {
    /// Id of the session.
    pub session: Uuid,
    /// Number of the reading within the session.
    pub number: u32,
    /// The revision that retracted the reading.
    pub revision: u32,
    /// Number of readings that still count.
    pub n_readings: u32,
    /// The belief of that revision; null with `belief=none`.
    pub belief: Option<Belief>,
}

/// Selects a part of a session's history.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct ReplayQuery {
    /// Last revision to return. Default: the newest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub upto: Option<u32>,
    /// Return the steps after this revision. Default: 0, which returns all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub after: Option<u32>,
    /// Maximum number of steps, 1 to 1000. Default: 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 1000)]
    pub limit: Option<u32>,
    /// Maximum number of pose hypotheses in the belief, 0 to 100. Default: 5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0, maximum = 100)]
    pub poses: Option<u32>,
}

/// Replay of a session: its answer at each revision.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Replay {
    /// Id of the session.
    pub session: Uuid,
    /// Last revision of the replay.
    pub upto: u32,
    /// The steps after `after`, oldest first.
    pub steps: Vec<ReplayStep>,
    /// Pass this as `after` to get the remaining steps; null if there are none.
    pub next_after: Option<u32>,
    /// The belief after the last of these steps.
    pub belief: Belief,
}

/// One step of a replay.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReplayStep {
    /// Revision of the step.
    pub revision: u32,
    /// The change that made the revision.
    pub change: SessionChange,
    /// When the change arrived, by the server's clock.
    #[schema(format = DateTime)]
    pub at: String,
    /// Number of readings that counted.
    pub n_readings: u32,
    /// The likeliest object and its probability.
    pub best: Option<BestObject>,
    /// The ten likeliest objects, likeliest first.
    #[serde(default)]
    #[schema(max_items = 10)]
    pub objects: Vec<BestObject>,
    /// Probability that the object was not in the catalogue.
    pub unknown: f64,
    /// Entropy of the identity in bits, including "none of these".
    pub entropy_bits: f64,
}

/// A change that makes a revision.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SessionChange {
    /// A reading arrived.
    #[schema(title = "ReadingChange")]
    Reading {
        /// Number of the reading within the session.
        number: u32,
        /// The robot that took the reading.
        robot: Option<String>,
        /// The robot's sequence number of the reading.
        seq: Option<u64>,
        /// Whether the reading was folded in before readings that arrived earlier.
        late: bool,
    },
    /// A reading was retracted.
    #[schema(title = "RetractionChange")]
    Retraction {
        /// Number of the reading within the session.
        number: u32,
    },
    /// The session was closed.
    #[schema(title = "ClosedChange")]
    Closed,
}

/// An object and its probability.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct BestObject {
    /// The object's id.
    pub object: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Probability of the object, 0 to 1.
    pub probability: f64,
}

/// A belief of a session in short.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct TracePoint {
    /// Revision of the belief.
    pub revision: u32,
    /// Number of readings that counted.
    pub n_readings: u32,
    /// When the session's newest change of the revision arrived, by the server's clock.
    #[schema(format = DateTime)]
    pub at: String,
    /// The likeliest object and its probability.
    pub best: Option<BestObject>,
    /// Probability that the object is not in the catalogue.
    pub unknown: f64,
    /// Entropy of the identity in bits, including "none of these".
    pub entropy_bits: f64,
}

/// Selects the belief to explain.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct ExplainQuery {
    /// Revision to explain. Default: the newest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub at: Option<u32>,
}

/// Contribution of each reading to a belief, measured against the belief without it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Explanation {
    /// Id of the session.
    pub session: Uuid,
    /// The explained revision.
    pub revision: u32,
    /// The explained answer: the likeliest object, or "none of these".
    pub answer: ExplainedAnswer,
    /// The known object that fits best, to which each reading's `misfit` refers: also when "none
    /// of these" is likelier. Only with `surface`, from three touches on; null otherwise.
    #[serde(default)]
    pub nearest: Option<NearestObject>,
    /// What speaks against the nearest object when the answer is "none of these", the objection of
    /// most readings first; empty otherwise.
    #[serde(default)]
    pub against: Vec<Objection>,
    /// The readings that count, in the order of folding.
    pub readings: Vec<ReadingContribution>,
    /// Whether all readings were compared. False if time ran out: ask again.
    pub complete: bool,
}

/// The explained answer.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ExplainedAnswer {
    /// Id of the likeliest object; null if "none of these" is likelier than any.
    pub object: Option<Uuid>,
    /// Name of the object when it was trained.
    pub name: Option<String>,
    /// Probability of the answer.
    pub probability: f64,
}

/// The known object that fits best.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct NearestObject {
    /// Id of the object.
    pub object: Uuid,
    /// Name of the object when it was trained.
    pub name: String,
    /// Probability of the object.
    pub probability: f64,
}

/// Something that speaks against the nearest object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Objection {
    /// Kind of the objection, for programs; stable between releases.
    pub code: ObjectionCode,
    /// Numbers of the readings that object, in the order of folding.
    pub readings: Vec<u32>,
    /// What was found, and what its causes may be.
    pub detail: String,
}

/// Kind of an objection.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectionCode {
    /// Touches lie above the object's surface.
    AboveSurface,
    /// Touches lie below the object's surface.
    BelowSurface,
    /// Touches lie away from all of the object's surface.
    AwayFromSurface,
    /// Touches feel another normal than the surface has there.
    OtherNormal,
    /// Images are unlike those of training at these places.
    UnlikeImages,
    /// The object fills space in which nothing was felt, or is missing where something was.
    FreeSpace,
}

/// How a reading lies on the nearest object in its likeliest pose.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingMisfit {
    /// Whether the reading touched something.
    pub touched: bool,
    /// Distance of the touch from the object's surface along its outward normal, in metres:
    /// positive above it. Null if nothing was touched, and away from the surface.
    pub height_m: Option<f64>,
    /// Angle between the felt normal and that of the surface, in radians; null as for `height_m`,
    /// and for a contact without a normal.
    pub turn_rad: Option<f64>,
    /// log2 of the image's likelihood at this place over that of a touch anywhere: negative if the
    /// image is unlike those of training. Null as for `height_m`, and for a contact.
    pub appearance_bits: Option<f64>,
    /// Loss in bits, 0 or less, because the object fills space that was found free, or is missing
    /// where something was felt.
    pub free_space_bits: f64,
}

/// Contribution of one reading.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingContribution {
    /// Number of the reading within the session.
    pub number: u32,
    /// The robot that took the reading.
    pub robot: Option<String>,
    /// The robot's sequence number of the reading.
    pub seq: Option<u64>,
    /// Gain in log2 probability of the answer from this reading, in bits. Null if it was not
    /// compared.
    pub bits: Option<f64>,
    /// Information about the identity in bits: the Kullback–Leibler divergence of the belief
    /// without the reading from the belief with it, including "none of these". Never negative.
    pub information_bits: Option<f64>,
    /// Support for the answer of the other readings, in bits: the gain in log2 odds of that answer
    /// from this reading. Odds are capped at 1024 to 1.
    pub support_bits: Option<f64>,
    /// Fit of the reading to the object in the pose found by the others, in bits: log2 of its
    /// likelihood there over that of a touch at a random place. Negative if it fits nowhere. Only
    /// with `surface`, after three other touches and for readings since the object last moved; null
    /// otherwise.
    pub fit_bits: Option<f64>,
    /// How the reading lies on the nearest object; null without one, and for readings before the
    /// object last moved.
    #[serde(default)]
    pub misfit: Option<ReadingMisfit>,
    /// Whether the reading disagrees with the rest, given at least three readings. With `surface`:
    /// `fit_bits` is at most −8. With other methods: `support_bits` is at most −4.
    pub disagrees: bool,
}
