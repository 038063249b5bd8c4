//! The fleet on the wire: which sessions are open, who touches in them, and since when not.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::session::Session;

/// How much of the fleet to answer.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct FleetQuery {
    /// How many sessions at most, 1 to 100; 100 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 100)]
    pub limit: Option<u32>,
}

/// The open sessions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Fleet {
    /// When it was so, by the server's clock.
    #[schema(format = DateTime)]
    pub at: String,
    /// How many sessions are open.
    pub n_open: u32,
    /// The open sessions in which something happened last, newest first. Follow their beliefs
    /// with `GET /v1/events`.
    #[schema(max_items = 100)]
    pub sessions: Vec<FleetSession>,
}

/// An open session, as whoever looks after the robots sees it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct FleetSession {
    /// The session.
    pub session: Session,
    /// The robots that sent its 64 newest readings, in the order of their names.
    #[schema(max_items = 64)]
    pub robots: Vec<String>,
    /// When its newest reading came, by the server's clock; null before the first.
    #[schema(format = DateTime)]
    pub last_reading_at: Option<String>,
}
