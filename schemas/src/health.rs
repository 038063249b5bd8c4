//! Health and version, for load balancers and supervisors.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Answer of a live process.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Liveness {
    /// Always true.
    pub alive: bool,
}

/// Result of a compaction.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Compacted {
    /// Bytes on the disk before compaction.
    pub before_bytes: u64,
    /// Bytes on the disk after compaction.
    pub after_bytes: u64,
    /// Bytes of live keys and records.
    pub live_bytes: u64,
}

/// Readiness of the server, check by check.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Readiness {
    /// Whether all checks passed.
    pub ready: bool,
    /// The checks.
    pub checks: Vec<Check>,
}

/// One readiness check.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Check {
    /// Name of the check, such as `store`.
    pub name: String,
    /// Whether the check passed.
    pub passed: bool,
    /// The finding, in words.
    pub detail: String,
}

/// Name and version of the server.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[schema(as = ServerVersion)]
pub struct Version {
    /// Name of the service: `palpate`.
    pub name: String,
    /// Version of the server.
    pub version: String,
    /// Version of the API, as in its path.
    pub api: String,
}
