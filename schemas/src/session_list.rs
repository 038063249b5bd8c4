//! Lists of sessions on the wire: what to search for, in which order, and a page of what was found.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use crate::method::Method;
use crate::session::{Session, SessionState};

/// Parameters of a list of sessions. A page looks at 10,000 sessions at most, so it may be short and
/// still have a `next_cursor`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct SessionsQuery {
    /// Maximum number of items, 1 to 1000. Default: 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 1000)]
    pub limit: Option<u32>,
    /// The `next_cursor` of the previous page, passed back unchanged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cursor: Option<String>,
    /// Only sessions in this state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(inline)]
    pub state: Option<SessionState>,
    /// Order of the list. Default: `oldest`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(inline)]
    pub order: Option<SessionOrder>,
    /// Only sessions of this catalogue.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub catalogue: Option<String>,
    /// Only sessions of this method.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(inline)]
    pub method: Option<Method>,
    /// Only sessions of this robot: one of `touched_by`. A name, or the beginning of names followed
    /// by `*`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<String>,
    /// Only sessions whose true object, or without a truth the likeliest answer of `latest`, has this
    /// id or name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// Only sessions that are (true) or are not (false) "none of these", by their truth, or without
    /// one by the likeliest answer of `latest`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub none_of_these: Option<bool>,
    /// Only sessions with a truth (true) or without one (false).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub with_truth: Option<bool>,
    /// Only sessions created at this time or later.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(format = DateTime)]
    pub since: Option<String>,
    /// Only sessions created before this time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(format = DateTime)]
    pub until: Option<String>,
    /// Only sessions with all these labels: `key` or `key:value`, separated by commas.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(example = "site:oslo,shift")]
    pub labels: Option<String>,
    /// Only sessions that this cell forwarded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<String>,
}

/// Order of a list of sessions, by the time of their creation.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SessionOrder {
    /// Oldest first.
    #[default]
    Oldest,
    /// Newest first.
    Newest,
}

/// A page of sessions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SessionPage {
    /// The sessions, in the requested order.
    pub items: Vec<Session>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}
