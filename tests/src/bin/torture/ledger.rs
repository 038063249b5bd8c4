//! What a client sent and what it was told: the truth that the server is held to.

use std::collections::BTreeMap;

use serde_json::Value;

/// What a client knows of something it asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    /// It was told that it is done.
    Acknowledged,
    /// It was told nothing: done or not, both are right.
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
    /// Whether anything was sent since it was last checked.
    pub(crate) is_fresh: bool,
}

impl Session {
    pub(crate) fn is_open(&self) -> bool {
        self.closed.is_none() && self.deleted.is_none()
    }
}

/// An object that was asked for.
#[derive(Clone, Debug)]
pub(crate) struct Object {
    pub(crate) created: Fate,
    pub(crate) deleted: Option<Fate>,
    /// Lengths of the mesh files that it may have, and the fate of the newest.
    pub(crate) meshes: Vec<(usize, Fate)>,
    pub(crate) n_readings: u64,
    pub(crate) n_readings_unknown: u64,
}

/// A key that was asked for.
#[derive(Clone, Debug)]
pub(crate) struct Key {
    pub(crate) name: String,
    /// What its holder sends; not known when nobody was told.
    pub(crate) secret: Option<String>,
    pub(crate) created: Fate,
    pub(crate) revoked: Option<Fate>,
    /// Whether anything was sent since it was last checked.
    pub(crate) is_fresh: bool,
}

/// All that one client did.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ledger {
    pub(crate) sessions: Vec<Session>,
    /// How many beginnings of sessions were not answered.
    pub(crate) sessions_unknown: u64,
    pub(crate) objects: BTreeMap<String, Object>,
    pub(crate) calibrations: u64,
    pub(crate) calibrations_unknown: u64,
    pub(crate) jobs: Vec<String>,
    pub(crate) jobs_unknown: u64,
    pub(crate) keys: Vec<Key>,
    pub(crate) keys_created: u64,
    pub(crate) keys_revoked: u64,
    /// How often a key was tried after a restart.
    pub(crate) keys_tried: u64,
    pub(crate) acknowledged: u64,
    pub(crate) unanswered: u64,
    /// Answers that no client should get, in words.
    pub(crate) unexpected: Vec<String>,
}
