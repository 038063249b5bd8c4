//! The history of a session on the wire: its readings one by one, what it believed when, and
//! what each reading contributed.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::access::Writer;
use crate::belief::Belief;
use crate::pose::Pose;
use crate::reading::{Looseness, Stamp};

/// A reading of a session, as it came.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SessionReading {
    /// Its number within the session: it was the entry that made revision `number` + 1.
    pub number: u32,
    /// The robot that took it; null when it came without an id.
    pub robot: Option<String>,
    /// The robot's number of it.
    pub seq: Option<u64>,
    /// The id of its sensor.
    pub sensor: Uuid,
    /// When it was taken, by the robot's clock.
    pub stamp: Option<Stamp>,
    /// When it came, by the server's clock.
    #[schema(format = DateTime)]
    pub received_at: String,
    /// The key that it was written with; null when that was not recorded, or nobody was asked
    /// for a key.
    #[serde(default)]
    pub written_by: Option<Writer>,
    /// The revision that withdrew it; null while it counts.
    pub retracted_by: Option<u32>,
    /// The key that withdrew it; null as above, and while it counts.
    #[serde(default)]
    pub retraction_written_by: Option<Writer>,
    /// The sensor's pose in the session frame; null when it was not known.
    pub pose: Option<Pose>,
    /// Pressures in pascal, as they were sent.
    pub image: Vec<Option<f64>>,
    /// The number of the sensor's calibration that corrects them; null when there was none.
    pub calibration: Option<u32>,
    /// The client's own code of the press; null when it sent none.
    pub feature: Option<Vec<f64>>,
    /// How far the sensor came along its +z with nothing in touch, metres; 0 when not said.
    pub approach_m: f64,
    /// How far the object may have moved since the reading before; null when it may not.
    pub object_moved: Option<Looseness>,
}

/// A page of a session's readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SessionReadingPage {
    /// The readings in the order in which they came, withdrawn ones included.
    pub items: Vec<SessionReading>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// What became of a reading that is withdrawn.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingRetracted {
    /// The session.
    pub session: Uuid,
    /// The reading's number within the session.
    pub number: u32,
    /// The revision that withdrew it.
    pub revision: u32,
    /// How many readings count now.
    pub n_readings: u32,
    /// The belief of that revision; null with `belief=none`.
    pub belief: Option<Belief>,
}

/// Which part of a session's history to answer.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct ReplayQuery {
    /// The last revision; the newest when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub upto: Option<u32>,
    /// The revision behind which the steps begin; 0 when not given: all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub after: Option<u32>,
    /// How many steps at most, 1 to 1000; 100 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 1000)]
    pub limit: Option<u32>,
    /// How many pose hypotheses of the belief at most, 0 to 100; 5 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0, maximum = 100)]
    pub poses: Option<u32>,
}

/// What a session believed, revision by revision.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Replay {
    /// The session.
    pub session: Uuid,
    /// The last revision.
    pub upto: u32,
    /// The steps behind `after`, oldest first.
    pub steps: Vec<ReplayStep>,
    /// Ask again with this `after` for the steps that are missing; null when none are.
    pub next_after: Option<u32>,
    /// The belief of `upto`.
    pub belief: Belief,
}

/// What one revision brought.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReplayStep {
    /// The revision.
    pub revision: u32,
    /// What made it.
    pub change: SessionChange,
    /// When it came, by the server's clock.
    #[schema(format = DateTime)]
    pub at: String,
    /// How many readings counted.
    pub n_readings: u32,
    /// The likeliest object and its probability.
    pub best: Option<BestObject>,
    /// The ten likeliest objects, likeliest first.
    #[serde(default)]
    #[schema(max_items = 10)]
    pub objects: Vec<BestObject>,
    /// How probable it was that the object is none of the catalogue's.
    pub unknown: f64,
    /// Uncertainty about the identity in bits, "none of these" included.
    pub entropy_bits: f64,
}

/// What makes a revision.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SessionChange {
    /// A reading came.
    #[schema(title = "ReadingChange")]
    Reading {
        /// Its number within the session.
        number: u32,
        /// The robot that took it.
        robot: Option<String>,
        /// The robot's number of it.
        seq: Option<u64>,
        /// Whether it was folded before readings that had come earlier.
        late: bool,
    },
    /// A reading was withdrawn.
    #[schema(title = "RetractionChange")]
    Retraction {
        /// The reading's number within the session.
        number: u32,
    },
    /// The session was closed.
    #[schema(title = "ClosedChange")]
    Closed,
}

/// The likeliest object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct BestObject {
    /// The object's id.
    pub object: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Its probability, 0 to 1.
    pub probability: f64,
}

/// Which belief to explain.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct ExplainQuery {
    /// The revision; the newest when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub at: Option<u32>,
}

/// What each reading contributed to a belief: it is compared with the belief of all others.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Explanation {
    /// The session.
    pub session: Uuid,
    /// The revision that is explained.
    pub revision: u32,
    /// The answer that is explained: the likeliest object, or "none of these".
    pub answer: ExplainedAnswer,
    /// The readings that count, in the order in which they are folded.
    pub readings: Vec<ReadingContribution>,
    /// Whether all readings were compared; false when time ran out, ask again then.
    pub complete: bool,
}

/// The answer that is explained.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ExplainedAnswer {
    /// The likeliest object's id; null when "none of these" is likelier than any.
    pub object: Option<Uuid>,
    /// Its name when it was trained.
    pub name: Option<String>,
    /// The answer's probability.
    pub probability: f64,
}

/// What one reading contributed.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingContribution {
    /// The reading's number within the session.
    pub number: u32,
    /// The robot that took it.
    pub robot: Option<String>,
    /// The robot's number of it.
    pub seq: Option<u64>,
    /// By how many bits it makes the answer more probable: log2 of its probability with all
    /// readings, less that without this one. Null when it was not compared.
    pub bits: Option<f64>,
    /// How much it says about which object it is: the Kullback–Leibler divergence of the belief
    /// without it from the belief with all, in bits, "none of these" included. Never negative.
    pub information_bits: Option<f64>,
    /// By how many bits it supports what the others say: log2 of the odds of their answer with
    /// all readings, less that without this one. Odds beyond 1024 to 1 count as that.
    pub support_bits: Option<f64>,
    /// By how many bits the others, where they have the object, expect this reading more than a
    /// touch anywhere; negative when it fits nowhere. With `surface`, once three others touched it
    /// and for readings since it last moved; null otherwise.
    pub fit_bits: Option<f64>,
    /// Whether it disagrees with the rest, of three readings or more. With `surface`:
    /// `fit_bits` is −8 or less. With the other methods: `support_bits` is −4 or less.
    pub disagrees: bool,
}
