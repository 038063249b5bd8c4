//! What is stored: how many bytes, which key wrote them, and what takes most of the room.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::access::Writer;

/// What is stored, which key wrote how much of it, and what takes most of the room.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Storage {
    /// Bytes of what is stored: keys and records.
    pub live_bytes: u64,
    /// Bytes of the database on the disk. A compaction gives back what exceeds `live_bytes`.
    pub stored_bytes: u64,
    /// Bytes that are free on the disk; null: nobody can tell.
    pub free_bytes: Option<u64>,
    /// Bytes that must stay free: with fewer, writes are refused.
    pub reserve_bytes: u64,
    /// Bytes that one key may hold; null: no bound.
    pub quota_bytes: Option<u64>,
    /// What each key holds, most first. Removing what a key wrote frees it.
    pub holders: Vec<StorageHolder>,
    /// The things whose removal frees most, most first.
    pub largest: Vec<StoredThing>,
}

/// Bytes that a key holds.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct StorageHolder {
    /// The key; null: nobody was asked for one.
    pub key: Option<Writer>,
    /// Bytes that it holds: sessions, readings, objects, meshes, sensors, versions and jobs that
    /// it wrote. Versions that share a part count it each.
    pub bytes: u64,
}

/// Something stored that can be removed.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct StoredThing {
    /// What kind of thing it is.
    pub kind: StoredKind,
    /// Its name; of a session its id.
    pub name: String,
    /// Its id; null: it has none.
    #[schema(value_type = Option<String>, format = Uuid)]
    pub id: Option<Uuid>,
    /// Bytes that its removal frees.
    pub bytes: u64,
}

/// The kinds of things that take room.
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
    /// Removed and replaced records that a compaction gives back.
    Compaction,
}
