//! Requests of a client and their answers: the ground truth for the checks.

use std::collections::BTreeMap;

use serde_json::Value;

/// The client's knowledge of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    /// The server acknowledged it.
    Acknowledged,
    /// No answer: done or not, both are correct.
    Unknown,
}

/// A reading that was sent.
#[derive(Clone, Debug)]
pub(crate) struct Sent {
    pub(crate) reading: Value,
    pub(crate) fate: Fate,
}

/// A session whose beginning was acknowledged.
#[derive(Clone, Debug)]
pub(crate) struct Session {
    pub(crate) id: String,
    pub(crate) request: Value,
    pub(crate) readings: Vec<Sent>,
    pub(crate) closed: Option<Fate>,
    pub(crate) deleted: Option<Fate>,
    /// Whether it changed since the last check.
    pub(crate) is_fresh: bool,
}

impl Session {
    pub(crate) fn is_open(&self) -> bool {
        self.closed.is_none() && self.deleted.is_none()
    }
}

/// A requested object.
#[derive(Clone, Debug)]
pub(crate) struct Object {
    pub(crate) created: Fate,
    pub(crate) deleted: Option<Fate>,
    /// Possible lengths of its mesh file, and the fate of the newest.
    pub(crate) meshes: Vec<(usize, Fate)>,
    pub(crate) n_readings: u64,
    pub(crate) n_readings_unknown: u64,
}

/// A requested key.
#[derive(Clone, Debug)]
pub(crate) struct Key {
    pub(crate) name: String,
    /// The key's secret; unknown if the creation was not answered.
    pub(crate) secret: Option<String>,
    pub(crate) created: Fate,
    pub(crate) revoked: Option<Fate>,
    /// Whether it changed since the last check.
    pub(crate) is_fresh: bool,
}

/// All requests of one client.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ledger {
    pub(crate) sessions: Vec<Session>,
    /// Number of unanswered session starts.
    pub(crate) sessions_unknown: u64,
    pub(crate) objects: BTreeMap<String, Object>,
    pub(crate) calibrations: u64,
    pub(crate) calibrations_unknown: u64,
    pub(crate) jobs: Vec<String>,
    pub(crate) jobs_unknown: u64,
    pub(crate) keys: Vec<Key>,
    pub(crate) keys_created: u64,
    pub(crate) keys_revoked: u64,
    /// Number of keys tried after a restart.
    pub(crate) keys_tried: u64,
    pub(crate) acknowledged: u64,
    pub(crate) unanswered: u64,
    /// Descriptions of answers that no client should get.
    pub(crate) unexpected: Vec<String>,
}
