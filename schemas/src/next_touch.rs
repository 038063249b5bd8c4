//! Where to touch next on the wire: approaches that a robot can make, and what each is worth.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::pose::Pose;

/// What a robot asks that wants to know where to touch next.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AskNextTouches {
    /// The sensor that will touch: id or name.
    pub sensor: String,
    /// 1 to 1000 approaches that the robot can make; when not given, the service proposes its
    /// own from all sides of the object, whatever the robot can reach.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 1000)]
    pub candidates: Option<Vec<TouchCandidate>>,
    /// How many are answered at most, 1 to 1000; 5 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1000)]
    pub n: Option<u32>,
    /// When to stop evaluating, milliseconds from the request's arrival, 1 to 10000; 100 when
    /// not given. At least one approach is evaluated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 10_000)]
    pub deadline_ms: Option<u32>,
    /// Whether the robot re-centres: touches, reads where contact began, lifts, shifts there
    /// and touches again. False when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recenters: Option<bool>,
    /// Where the object is, as far as is known; needed before the first touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub workspace: Option<TouchWorkspace>,
    /// Decides what is drawn at random, 0 to 2⁵³ − 1; 0 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 9_007_199_254_740_991_u64)]
    pub seed: Option<u64>,
}

/// An approach that a robot can make: from a pose straight along the sensor's +z until it feels
/// something.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TouchCandidate {
    /// The sensor's pose in the session frame where the approach begins, outside of the object.
    pub pose: Pose,
    /// How far it goes at most, in metres, above 0 to 10.
    #[schema(exclusive_minimum = 0.0, maximum = 10.0)]
    pub reach_m: f64,
    /// What trying it costs, above 0: seconds, or metres of travel, or any other unit that is
    /// the same for all candidates. Given with all of them or with none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1e9)]
    pub cost: Option<f64>,
}

/// A ball in which the object lies.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TouchWorkspace {
    /// Its middle in the session frame, in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub center: [f64; 3],
    /// Its radius in metres, above 0 to 10.
    #[schema(exclusive_minimum = 0.0, maximum = 10.0)]
    pub radius: f64,
}

/// Where to touch next, best first.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct NextTouches {
    /// The session.
    pub session: Uuid,
    /// The revision of the belief that the answer rests on.
    pub revision: u32,
    /// Uncertainty about the identity now in bits, "none of these" included.
    pub entropy_bits: f64,
    /// How many approaches were evaluated.
    pub evaluated: u32,
    /// False when the deadline came before all approaches were evaluated.
    pub complete: bool,
    /// The best approaches of those evaluated, best first.
    pub touches: Vec<NextTouch>,
}

/// An approach and what it is worth.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct NextTouch {
    /// The sensor's pose in the session frame where the approach begins; it moves along its +z.
    pub pose: Pose,
    /// How far it goes at most, in metres.
    pub reach_m: f64,
    /// Its place in `candidates`, from 0; null for the service's own.
    pub candidate: Option<u32>,
    /// What its outcome is expected to say about which object it is, in bits.
    pub information_bits: f64,
    /// What it is expected to say about the object's pose, given which object it is, in bits.
    pub pose_bits: f64,
    /// The probability of a contact from which a reading can be taken.
    pub contact_probability: f64,
    /// What it is worth for its cost, in bits per unit of `cost`: what candidates with costs are
    /// ranked by. Null without a cost.
    pub bits_per_cost: Option<f64>,
}
