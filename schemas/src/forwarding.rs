//! Forwarding on the wire: sessions that a cell brings to the central service, what a cell fetches
//! from there, and how far it is.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::reading::Reading;
use crate::session::CreateSession;
use crate::warning::Warning;

/// A session of a cell, as the cell created it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForwardSession {
    /// Name of the cell.
    #[schema(min_length = 1, max_length = 64, example = "cell-7")]
    pub cell: String,
    /// Hash of the version that the session began with, as `GET …/package` states it.
    #[schema(min_length = 64, max_length = 64)]
    pub version_hash: String,
    /// The settings of the session. `catalogue` and `version` are required; `ttl_s` has no effect.
    pub session: CreateSession,
}

/// Entries of a forwarded session's journal.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForwardEntries {
    /// Number of the first entry in the session's journal, from 0.
    #[schema(minimum = 0)]
    pub from: u32,
    /// 1 to 1000 entries in the order of the journal, stored whole or not at all.
    #[schema(min_items = 1, max_items = 1000)]
    pub entries: Vec<ForwardedEntry>,
}

/// A journal's entry: a reading or a retraction.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForwardedEntry {
    /// The reading. Exactly one of `reading` and `retracts` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reading: Option<Reading>,
    /// Number of the reading that is retracted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0)]
    pub retracts: Option<u32>,
}

/// Result of forwarding entries.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct EntriesForwarded {
    /// The session's id.
    pub session: Uuid,
    /// Number of entries that were new.
    pub n_new: u32,
    /// Number of entries of the session's journal now, with those that were already there.
    pub revision: u32,
    /// Probable mistakes in the readings, as when they are added directly.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// A version of a catalogue, to be fetched by a cell: its description, and its blocks by hash.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct VersionPackage {
    /// Name of the catalogue.
    pub catalogue: String,
    /// Number of the version.
    pub version: u32,
    /// Hash of the version: equal if and only if the content is.
    pub hash: String,
    /// The version's stored record (`docs/formats.md`), in base64.
    pub record: String,
    /// Total bytes of its blocks.
    pub bytes: u64,
    /// Hashes of its blocks, in hexadecimal.
    pub blocks: Vec<String>,
}

/// A sensor with a page of its calibrations, to be fetched by a cell.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct SensorPackage {
    /// Name of the sensor.
    pub name: String,
    /// The sensor's stored record (`docs/formats.md`), in base64.
    pub record: String,
    /// Number of its calibrations before those of this page.
    #[serde(default)]
    pub first: u32,
    /// The stored records of its calibrations, the oldest first, in base64.
    pub calibrations: Vec<String>,
    /// Cursor of the next page; null on the last page.
    #[serde(default)]
    pub next_cursor: Option<String>,
}

/// Whether this server is a cell that forwards its sessions, and how far it is.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Forwarding {
    /// Address of the central service; null if this server does not forward.
    pub to: Option<String>,
    /// Name under which the central service knows this cell; null if this server does not forward.
    pub cell: Option<String>,
    /// Since when the central service cannot be reached, or refuses the key or all writes; null
    /// while it takes them.
    #[schema(format = DateTime)]
    pub down_since: Option<String>,
    /// When the central service last answered; null before the first time.
    #[schema(format = DateTime)]
    pub last_answer_at: Option<String>,
    /// The last error of the line; null if there was none since the start.
    pub last_error: Option<String>,
    /// Number of sessions with something that the central service does not have.
    pub sessions_waiting: u32,
    /// Number of their readings and retractions that wait.
    pub entries_waiting: u64,
    /// Since when the longest waiting session waits; null if none does. After a restart the
    /// time counts from the session's creation.
    #[schema(format = DateTime)]
    pub oldest_waiting_since: Option<String>,
    /// Number of waiting sessions that the central service refused.
    pub sessions_refused: u32,
    /// The first of them, with the reasons. They are tried again every few minutes.
    #[schema(max_items = 100)]
    pub refused: Vec<RefusedSession>,
    /// The followed catalogues.
    pub catalogues: Vec<FollowedCatalogue>,
    /// Sensors that differ from those of the same name at the central service, and why.
    #[schema(max_items = 100)]
    pub sensors: Vec<DifferentSensor>,
}

/// A waiting session that the central service refused.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct RefusedSession {
    /// The session's id.
    pub session: Uuid,
    /// Why.
    pub reason: String,
}

/// A catalogue whose current version a cell takes from the central service.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct FollowedCatalogue {
    /// Name of the catalogue.
    pub name: String,
    /// Current version at the central service, as last heard; null if none was.
    pub current_there: Option<u32>,
    /// Current version of this server; null without one.
    pub current_here: Option<u32>,
    /// Why the two differ, if something is wrong.
    pub problem: Option<String>,
}

/// A sensor that differs from the one of the same name at the central service.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct DifferentSensor {
    /// Name of the sensor.
    pub name: String,
    /// How it differs.
    pub problem: String,
}
