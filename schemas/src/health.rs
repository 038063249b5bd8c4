//! What a supervisor asks: alive, ready, and which version.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The process answers.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Liveness {
    /// Always true: an answer is all there is to know.
    pub alive: bool,
}

/// What a compaction of the stored data did.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Compacted {
    /// Bytes on the disk before.
    pub before_bytes: u64,
    /// Bytes on the disk after.
    pub after_bytes: u64,
    /// Bytes of what is stored: keys and records.
    pub live_bytes: u64,
}

/// Whether the server does its work, check by check.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Readiness {
    /// All checks passed.
    pub ready: bool,
    /// The checks.
    pub checks: Vec<Check>,
}

/// One thing that must be in order.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Check {
    /// What was checked, such as `store`.
    pub name: String,
    /// Whether it is in order.
    pub passed: bool,
    /// What was found.
    pub detail: String,
}

/// Which server this is.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Version {
    /// The name of the service, `palpate`.
    pub name: String,
    /// Its version.
    pub version: String,
    /// The version of the API, as in its path.
    pub api: String,
}
