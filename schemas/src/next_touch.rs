//! Next touches on the wire: candidate approaches and their expected information.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::pose::Pose;

/// Request to rank the next touches.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AskNextTouches {
    /// Id or name of the sensor that will touch.
    pub sensor: String,
    /// 1 to 1000 approaches that the robot can make. Default: the service generates approaches from
    /// all sides of the object, without regard to the robot's reach.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 1000)]
    pub candidates: Option<Vec<TouchCandidate>>,
    /// Maximum number of approaches to return, 1 to 1000. Default: 5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1000)]
    pub n: Option<u32>,
    /// Time limit of the evaluation in milliseconds from the request's arrival, 1 to 10000. At
    /// least one approach is evaluated. Default: 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 10_000)]
    pub deadline_ms: Option<u32>,
    /// Whether the robot re-centres: it touches, finds the centre of contact, lifts, moves there
    /// and touches again. Default: false.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recenters: Option<bool>,
    /// Where the object is, roughly; required before the first touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub workspace: Option<TouchWorkspace>,
    /// Seed of random choices, 0 to 2⁵³ − 1. Default: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 9_007_199_254_740_991_u64)]
    pub seed: Option<u64>,
}

/// A candidate approach: a straight move from a pose along the sensor's +z until contact.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TouchCandidate {
    /// Start of the approach, outside the object: the sensor's pose in the session frame.
    pub pose: Pose,
    /// Maximum travel in metres, above 0 and at most 10.
    #[schema(exclusive_minimum = 0.0, maximum = 10.0)]
    pub reach_m: f64,
    /// Cost of the approach, above 0, in a unit common to all candidates, such as seconds or metres
    /// of travel. Give it for all candidates or for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1e9)]
    pub cost: Option<f64>,
}

/// A ball in which the object lies.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TouchWorkspace {
    /// Centre in the session frame, in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub center: [f64; 3],
    /// Radius in metres, above 0 and at most 10.
    #[schema(exclusive_minimum = 0.0, maximum = 10.0)]
    pub radius: f64,
}

/// Ranked next touches.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct NextTouches {
    /// Id of the session.
    pub session: Uuid,
    /// Revision of the belief used.
    pub revision: u32,
    /// Current entropy of the identity in bits, including "none of these".
    pub entropy_bits: f64,
    /// Number of approaches evaluated.
    pub evaluated: u32,
    /// False if the deadline came before all approaches, and the presses after the best of them,
    /// were evaluated.
    pub complete: bool,
    /// The best evaluated approaches, best first. Without costs the first ones are ordered by what
    /// they and the best press after them are expected to tell.
    pub touches: Vec<NextTouch>,
}

/// An approach and its expected information.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct NextTouch {
    /// Start of the approach: the sensor's pose in the session frame. It moves along its +z.
    pub pose: Pose,
    /// Maximum travel in metres.
    pub reach_m: f64,
    /// Index into `candidates`; null for an approach that the service generated.
    pub candidate: Option<u32>,
    /// Expected information about the object's identity, in bits.
    pub information_bits: f64,
    /// Expected information about the object's pose given its identity, in bits.
    pub pose_bits: f64,
    /// Probability of a contact that yields a reading.
    pub contact_probability: f64,
    /// Score by which candidates with costs are ranked, in bits per unit of `cost`; null without a
    /// cost.
    pub bits_per_cost: Option<f64>,
}
