//! Comparison of two versions on recorded sessions, on the wire: requests and reports.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// Request to compare a version with another one by replaying ended sessions with both.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ShadowVersion {
    /// Version to compare with. Default: the current one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub against: Option<u32>,
    /// Sessions to replay: ended ones of this catalogue with the method `surface` and a reading.
    /// Default: the newest 100 of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 300)]
    pub sessions: Option<Vec<Uuid>>,
    /// Accepted risk of a wrong answer, 0.0001 to 0.5, at which a session counts as decided. A
    /// session's own `risk` does not count. Default: 0.05.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 0.5)]
    pub risk: Option<f64>,
}

/// Report of a comparison of two versions on the same sessions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ShadowReport {
    /// The version that was tried.
    pub version: u32,
    /// The version that it was compared with.
    pub against: u32,
    /// Accepted risk at which a session counts as decided.
    pub risk: f64,
    /// Number of sessions that were replayed by both.
    pub n_sessions: u32,
    /// Number of sessions that could not be replayed, such as those of removed sensors.
    pub n_left_out: u32,
    /// Number of sessions whose truth is known and says something about both versions.
    pub n_with_truth: u32,
    /// Figures of the version that it was compared with.
    pub old: ShadowSide,
    /// Figures of the version that was tried.
    pub new: ShadowSide,
    /// Number of sessions with another answer at the end.
    pub n_changed: u32,
    /// The sessions with another answer, newest first; at most 100.
    #[schema(max_items = 100)]
    pub changed: Vec<ShadowChange>,
    /// Duration of the comparison, in seconds.
    pub seconds: f64,
}

/// What one version makes of the sessions. The first 16 readings of a session count, up to the first
/// `object_moved`.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ShadowSide {
    /// Number of sessions that were decided: at some touch the risk was accepted.
    pub n_decided: u32,
    /// Number of sessions that were decided for an answer other than their truth.
    pub n_decided_wrongly: u32,
    /// Mean number of touches until the decision; null without any.
    pub touches: Option<f64>,
    /// Share of sessions with a truth whose last answer was right; null without any.
    pub accuracy: Option<f64>,
    /// Mean probability of "none of these" at the end.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub unknown: f64,
    /// Mean time to fold in a touch, in milliseconds, when nothing else runs in the job.
    pub touch_ms: f64,
}

/// A session with another answer.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ShadowChange {
    /// The session.
    pub session: Uuid,
    /// Number of its readings that were replayed.
    pub n_readings: u32,
    /// Name of the true object, or `none of these`; null if it is not known.
    pub truth: Option<String>,
    /// The answer of the version compared with.
    pub old: ShadowAnswer,
    /// The answer of the version that was tried.
    pub new: ShadowAnswer,
}

/// An answer at the end of a replay.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ShadowAnswer {
    /// Name of the likeliest object; null for "none of these".
    pub name: Option<String>,
    /// Probability of the answer.
    pub probability: f64,
    /// Number of touches until the decision; null if there was none.
    pub decided_after: Option<u32>,
}
