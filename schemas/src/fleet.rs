//! The fleet on the wire: open sessions, their robots and their latest activity.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::session::Session;

/// Parameters of a fleet query.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct FleetQuery {
    /// Maximum number of sessions, 1 to 100. Default: 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 100)]
    pub limit: Option<u32>,
}

/// The open sessions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Fleet {
    /// Time of the answer, by the server's clock.
    #[schema(format = DateTime)]
    pub at: String,
    /// Number of open sessions.
    pub n_open: u32,
    /// The most recently active open sessions, newest first. Follow their beliefs with `GET
    /// /v1/events`.
    #[schema(max_items = 100)]
    pub sessions: Vec<FleetSession>,
}

/// An open session and its recent activity.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct FleetSession {
    /// The session.
    pub session: Session,
    /// The robots that sent the session's 64 newest readings, sorted by name.
    #[schema(max_items = 64)]
    pub robots: Vec<String>,
    /// When the newest reading arrived, by the server's clock; null if there is none.
    #[schema(format = DateTime)]
    pub last_reading_at: Option<String>,
}
