//! The fleet on the wire: open sessions, whether they need attention, and their latest beliefs.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::history::TracePoint;
use crate::session::Session;

/// Parameters of a fleet query.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct FleetQuery {
    /// Maximum number of sessions, 1 to 100. Default: 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 100)]
    pub limit: Option<u32>,
    /// Where the page begins: `next_cursor` of the page before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cursor: Option<String>,
    /// Only sessions that need attention. Default: false.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub needed: Option<bool>,
    /// Only sessions whose id, robots, catalogue, method, labels or likeliest answer contain each
    /// of these words, in any case. At most 200 characters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(max_length = 200)]
    pub search: Option<String>,
    /// Whether sessions have their `trace`. Default: false.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trace: Option<bool>,
}

/// A page of the open sessions, those that need attention first.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Fleet {
    /// Time of the answer, by the server's clock.
    #[schema(format = DateTime)]
    pub at: String,
    /// Number of open sessions.
    pub n_open: u32,
    /// Number of open sessions that need attention.
    pub n_needed: u32,
    /// The sessions: those that need attention, newest alarm first and surprising ones before
    /// stuck ones; then those at work, alarms that were acknowledged or muted, those without a
    /// reading, and sure ones. Follow their beliefs with `GET /v1/events`.
    #[schema(max_items = 100)]
    pub sessions: Vec<FleetSession>,
    /// Where the next page begins; null on the last page.
    pub next_cursor: Option<String>,
}

/// An open session and its recent activity.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct FleetSession {
    /// The session.
    pub session: Session,
    /// When the newest reading arrived, by the server's clock; null if there is none.
    #[schema(format = DateTime)]
    pub last_reading_at: Option<String>,
    /// Whether it needs attention, and why.
    pub attention: Attention,
    /// With `?trace=true` the newest beliefs, at most 24, oldest first; else empty.
    #[schema(max_items = 24)]
    pub trace: Vec<TracePoint>,
}

/// Whether a session needs attention, and why.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Attention {
    /// The session's state.
    pub level: AttentionLevel,
    /// The reason in words.
    pub reason: String,
    /// Since when the reason holds, by the server's clock.
    #[schema(format = DateTime)]
    pub since: String,
    /// Whether somebody should look: surprising or stuck, not acknowledged since and not muted.
    pub is_needed: bool,
    /// When the session's alarms were last acknowledged; null if they never were. Alarms with a
    /// later `since` need attention again.
    #[schema(format = DateTime)]
    pub acknowledged_at: Option<String>,
    /// Until when alarms of the session need no attention; null if it is not muted.
    #[schema(format = DateTime)]
    pub muted_until: Option<String>,
}

/// State of an open session.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, PartialOrd, Ord, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AttentionLevel {
    /// Probably none of the known objects, a changed answer, or touches that do not fit.
    Surprising,
    /// Undecided, without readings or without progress.
    Stuck,
    /// Readings arrive.
    Working,
    /// No reading has arrived yet.
    Waiting,
    /// One object is likely.
    Sure,
}

/// Acknowledges the alarms of sessions.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AcknowledgeSessions {
    /// Ids of open sessions.
    #[schema(min_items = 1, max_items = 100)]
    pub sessions: Vec<Uuid>,
    /// Seconds, up to a week, for which new alarms of the sessions need no attention either; 0
    /// ends this. Default: unchanged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 604_800)]
    pub mute_s: Option<u32>,
}

/// Closes sessions, without a truth.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CloseSessions {
    /// Ids of sessions.
    #[schema(min_items = 1, max_items = 100)]
    pub sessions: Vec<Uuid>,
}

/// What became of each session of a request for many.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct FleetChanged {
    /// Number of sessions for which it was done.
    pub n_done: u32,
    /// One result for each session, in the order of the request.
    #[schema(max_items = 100)]
    pub results: Vec<FleetResult>,
}

/// What became of one session.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct FleetResult {
    /// The session's id.
    pub session: Uuid,
    /// Why it was not done; null if it was.
    pub problem: Option<String>,
}
