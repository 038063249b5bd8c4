//! Stored bytes on the wire: totals, per key, and the things that take most.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::access::Writer;

/// Stored bytes: totals, per key, and the things that take most.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Storage {
    /// Bytes of live keys and records.
    pub live_bytes: u64,
    /// Bytes of the database on the disk. A compaction frees what exceeds `live_bytes`.
    pub stored_bytes: u64,
    /// Free bytes of the disk, those of the held reserve included; null if unknown.
    pub free_bytes: Option<u64>,
    /// Bytes to keep free; with fewer, writes are refused.
    pub reserve_bytes: u64,
    /// Number of stored readings of sessions and of objects in training, retracted ones included.
    #[serde(default)]
    pub n_readings: u64,
    /// Quota of stored bytes per key; null if there is none.
    pub quota_bytes: Option<u64>,
    /// Stored bytes per key, largest first. Removing what a key wrote frees them.
    pub holders: Vec<StorageHolder>,
    /// The things whose removal frees most, largest first.
    pub largest: Vec<StoredThing>,
}

/// Stored bytes of one key.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct StorageHolder {
    /// The key; null for data written without keys.
    pub key: Option<Writer>,
    /// Bytes of the sessions, readings, objects, meshes, sensors, versions and jobs that the key
    /// wrote. A part that versions share counts for each of them.
    pub bytes: u64,
}

/// A stored thing that can be removed.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct StoredThing {
    /// Kind of the thing.
    pub kind: StoredKind,
    /// Name of the thing; the id of a session.
    pub name: String,
    /// Id of the thing; null if it has none.
    #[schema(value_type = Option<String>, format = Uuid)]
    pub id: Option<Uuid>,
    /// Bytes freed by its removal.
    pub bytes: u64,
}

/// Kind of a stored thing.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, PartialOrd, Ord, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StoredKind {
    /// A session with its readings.
    Session,
    /// An object with its mesh and training readings.
    Object,
    /// A sensor with its calibrations.
    Sensor,
    /// A catalogue with its versions.
    Catalogue,
    /// Removed and replaced records, which a compaction frees.
    Compaction,
}
