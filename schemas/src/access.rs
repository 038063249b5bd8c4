//! API keys, roles and the audit log: who may do what, and who did it.
//!
//! A secret is sent once, in the answer that creates or rotates its key.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

/// Role of a key. `x-palpate-roles` of each operation lists the roles that may call it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, PartialOrd, Ord, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Touches objects: sessions, readings and next touches; reads sensors and catalogues.
    Robot,
    /// Trains: objects, sensors, trainings and catalogues; reads everything but keys and the audit
    /// log.
    Trainer,
    /// Reads everything but keys and the audit log.
    Viewer,
    /// May do everything, including managing keys.
    Admin,
}

/// A new key.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateKey {
    /// Name of the key: 1 to 64 letters, digits, `.`, `_`, `-`; unique among the keys that are not
    /// revoked.
    #[schema(min_length = 1, max_length = 64, pattern = "^[A-Za-z0-9][A-Za-z0-9._-]*$")]
    pub name: String,
    /// Role of the key.
    pub role: Role,
    /// Seconds until the key expires, 60 to 315,360,000 (ten years). Default: never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 60, maximum = 315_360_000)]
    pub expires_in_s: Option<u64>,
}

/// Rotation of a key's secret.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RotateKey {
    /// Seconds for which the previous secret stays valid, 0 to 2,592,000 (30 days). Default: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 2_592_000)]
    pub grace_s: Option<u64>,
}

/// A key, without its secret.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct ApiKey {
    /// Id of the key.
    #[schema(value_type = String, format = Uuid)]
    pub id: Uuid,
    /// Name of the key.
    pub name: String,
    /// Role of the key.
    pub role: Role,
    /// Whether the key is valid: neither revoked nor expired.
    pub active: bool,
    /// When the key was created.
    pub created_at: String,
    /// When the key expires; null if never.
    pub expires_at: Option<String>,
    /// When the key was last used, to within an hour; null if never.
    pub last_used_at: Option<String>,
    /// When the key was revoked; null if it was not.
    pub revoked_at: Option<String>,
    /// Until when the previous secret stays valid; null if only the current one is.
    pub rotating_until: Option<String>,
    /// Stored bytes that the key wrote and that were not removed since.
    pub stored_bytes: u64,
}

/// A key with its secret, which is shown only once.
#[derive(Clone, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct NewApiKey {
    /// The key.
    pub key: ApiKey,
    /// The secret, sent as `Authorization: Bearer <secret>`. It cannot be shown again.
    #[schema(pattern = "^palpate_[0-9a-f]{32}_[0-9a-f]{64}$")]
    pub secret: String,
}

impl std::fmt::Debug for NewApiKey {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // A secret must not appear in a log.
        formatter.debug_struct("NewApiKey").field("key", &self.key).finish_non_exhaustive()
    }
}

/// A page of keys.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct ApiKeyPage {
    /// The keys, oldest first, including revoked ones.
    pub items: Vec<ApiKey>,
    /// Cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// The caller, as the server identifies it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Whoami {
    /// Whether the server requires keys. If not, every caller on the same machine may do
    /// everything.
    pub keys_required: bool,
    /// Role of the caller; `admin` if the server requires no keys.
    pub role: Role,
    /// The caller's key; null if the server requires no keys.
    pub key: Option<ApiKey>,
    /// Quota of stored bytes per key; null if there is none.
    pub quota_bytes: Option<u64>,
}

/// The key that wrote something.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Writer {
    /// The key's id.
    #[schema(value_type = String, format = Uuid)]
    pub key_id: Uuid,
    /// Name of the key; null if the key has been forgotten.
    pub key_name: Option<String>,
}

/// A robot name and the key that holds it. Only that key may post readings under the name.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Robot {
    /// The robot name, as readings give it.
    pub name: String,
    /// The key that holds the name.
    pub holder: Writer,
    /// Since when the key has held the name.
    #[schema(format = DateTime)]
    pub since: String,
}

/// The key to assign a robot name to.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BindRobot {
    /// Id or name of the key.
    pub key: String,
}

/// A page of robot names.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct RobotPage {
    /// The robot names that a key holds, in byte order.
    pub items: Vec<Robot>,
    /// Cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// Filter for the audit log.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct AuditQuery {
    /// Earliest time (RFC 3339), inclusive, such as `2026-05-01T00:00:00Z`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<String>,
    /// Latest time (RFC 3339), exclusive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<String>,
    /// Only entries of this key: its id, or a name that it had.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// Only entries of this operation, by operation id, such as `delete_object`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub operation: Option<String>,
    /// Only entries of this ring.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(inline)]
    pub ring: Option<AuditRing>,
    /// Maximum number of entries, 1 to 1000. Default: 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 1000)]
    pub limit: Option<u32>,
    /// The `next_cursor` of the previous page, passed back unchanged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cursor: Option<String>,
}

/// A part of the audit log with its own capacity. Entries of one ring never displace those of
/// another.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum AuditRing {
    /// Requests that changed something, or may have.
    Changes,
    /// Requests of a key holder that were refused or failed.
    Refused,
    /// Requests without a valid key that were refused or failed.
    Strangers,
}

/// An entry of the audit log: a request and its outcome.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct AuditEntry {
    /// Number of the entry; increases with time.
    pub seq: u64,
    /// When the request arrived.
    pub at: String,
    /// The caller's key; null if there was none or the server does not know it.
    #[schema(value_type = Option<String>, format = Uuid)]
    pub key_id: Option<Uuid>,
    /// Name of the caller's key.
    pub key_name: Option<String>,
    /// Role of the caller.
    pub role: Option<Role>,
    /// Address the request came from, as the server saw it; behind a proxy, the proxy's address.
    pub address: String,
    /// Operation id of the request.
    pub operation: String,
    /// Path of the resource concerned; for a new resource, its own path.
    pub resource: String,
    /// Status of the answer; null if unknown, in which case the change may or may not have been
    /// made.
    #[schema(minimum = 100, maximum = 599)]
    pub status: Option<u16>,
    /// Request id, as in `x-request-id` and the server's log.
    pub request_id: String,
    /// Number of refused requests before this one that were dropped from the log because there were
    /// too many.
    pub n_left_out: u32,
    /// The ring that holds the entry.
    pub ring: AuditRing,
    /// Number of identical requests with this outcome within an hour. `resource`, `address` and
    /// `request_id` are those of the first.
    #[schema(minimum = 1)]
    pub n: u32,
    /// When the last of these requests arrived.
    pub last_at: String,
}

/// A page of the audit log.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct AuditPage {
    /// The entries, newest first. A filtered page may hold fewer than `limit` entries, or none,
    /// although more pages follow.
    pub items: Vec<AuditEntry>,
    /// Cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}
