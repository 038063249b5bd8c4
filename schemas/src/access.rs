//! Who may do what, and who did: API keys, roles, the audit log.
//!
//! A secret travels once, in the answer that creates or rotates its key.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

/// What the holder of a key is. `x-palpate-roles` of each operation lists who may call it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, PartialOrd, Ord, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Touches things: sessions, readings, next touches; reads sensors and catalogues.
    Robot,
    /// Teaches: objects, sensors, trainings, catalogues; reads everything else.
    Trainer,
    /// Looks on: reads everything but keys and the audit log.
    Viewer,
    /// May do everything, also give and take keys.
    Admin,
}

/// A new key.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateKey {
    /// What to call its holder: 1 to 64 letters, digits, `.`, `_`, `-`. No other key that is
    /// not revoked may have the name.
    #[schema(min_length = 1, max_length = 64, pattern = "^[A-Za-z0-9][A-Za-z0-9._-]*$")]
    pub name: String,
    /// What its holder is.
    pub role: Role,
    /// After how many seconds it is refused, 60 to 315,360,000 (ten years); never when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 60, maximum = 315_360_000)]
    pub expires_in_s: Option<u64>,
}

/// How a key gets a new secret.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RotateKey {
    /// For how many seconds the secret before is still let in, 0 to 2,592,000 (30 days); 0
    /// when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 2_592_000)]
    pub grace_s: Option<u64>,
}

/// A key, without its secret.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct ApiKey {
    /// Its id.
    #[schema(value_type = String, format = Uuid)]
    pub id: Uuid,
    /// What its holder is called.
    pub name: String,
    /// What its holder is.
    pub role: Role,
    /// Whether it is let in: not revoked, not expired.
    pub active: bool,
    /// When it was made.
    pub created_at: String,
    /// From when on it is refused; null: never.
    pub expires_at: Option<String>,
    /// When it was last used, to within an hour; null: never.
    pub last_used_at: Option<String>,
    /// When it was revoked; null: it was not.
    pub revoked_at: Option<String>,
    /// Until when the secret before the last rotation is let in as well; null: it is not.
    pub rotating_until: Option<String>,
    /// Bytes of stored data that it wrote and that were not removed since.
    pub stored_bytes: u64,
}

/// A key with its secret, which is shown this once.
#[derive(Clone, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct NewApiKey {
    /// The key.
    pub key: ApiKey,
    /// What its holder sends: `Authorization: Bearer` and this. It cannot be shown again.
    #[schema(pattern = "^palpate_[0-9a-f]{32}_[0-9a-f]{64}$")]
    pub secret: String,
}

impl std::fmt::Debug for NewApiKey {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // A secret has no business in a log.
        formatter.debug_struct("NewApiKey").field("key", &self.key).finish_non_exhaustive()
    }
}

/// A page of keys.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct ApiKeyPage {
    /// The keys, oldest first, revoked ones too.
    pub items: Vec<ApiKey>,
    /// Where the next page begins; null ends the list.
    pub next_cursor: Option<String>,
}

/// Whom the server takes the caller for.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Whoami {
    /// Whether the server asks for keys. If not, everybody on its machine may do everything.
    pub keys_required: bool,
    /// What the caller may do as; `admin` when nobody is asked for a key.
    pub role: Role,
    /// The caller's key; null when nobody is asked for one.
    pub key: Option<ApiKey>,
    /// Bytes of stored data that one key may hold; null: no bound.
    pub quota_bytes: Option<u64>,
}

/// A key that wrote something.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Writer {
    /// The key's id.
    #[schema(value_type = String, format = Uuid)]
    pub key_id: Uuid,
    /// What its holder is called; null when the key is forgotten.
    pub key_name: Option<String>,
}

/// A robot's name and the key that it belongs to. Only that key may post readings with it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Robot {
    /// The robot's name, as its readings have it.
    pub name: String,
    /// The key that it belongs to.
    pub holder: Writer,
    /// Since when.
    #[schema(format = DateTime)]
    pub since: String,
}

/// To whom a robot's name is given.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BindRobot {
    /// The key's id or name.
    pub key: String,
}

/// A page of robots' names.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct RobotPage {
    /// The names that belong to a key, in the order of their bytes.
    pub items: Vec<Robot>,
    /// Where the next page begins; null ends the list.
    pub next_cursor: Option<String>,
}

/// Which entries of the audit log.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct AuditQuery {
    /// Not before this time (RFC 3339, such as `2026-05-01T00:00:00Z`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<String>,
    /// Before this time (RFC 3339).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<String>,
    /// By this key: its id, or a name that it had.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// This operation, by its id in this description, such as `delete_object`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub operation: Option<String>,
    /// Only entries of this part of the log.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(inline)]
    pub ring: Option<AuditRing>,
    /// How many entries at most, 1 to 1000; 100 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 1, maximum = 1000)]
    pub limit: Option<u32>,
    /// The `next_cursor` of the page before; its content is the server's business.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cursor: Option<String>,
}

/// A part of the audit log with a size of its own: none pushes out what is in another.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AuditRing {
    /// What changed something, or may have.
    Changes,
    /// What was refused to the holder of a key, or failed.
    Refused,
    /// What was refused to a caller without a key, or failed.
    Strangers,
}

/// Who asked for what, and what came of it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct AuditEntry {
    /// Its number; numbers go up with time.
    pub seq: u64,
    /// When it was asked for.
    pub at: String,
    /// The key that asked; null: none, or none that the server knows.
    #[schema(value_type = Option<String>, format = Uuid)]
    pub key_id: Option<Uuid>,
    /// What the key's holder was called.
    pub key_name: Option<String>,
    /// What the asker was taken for.
    pub role: Option<Role>,
    /// The address that the request came from, as the server saw it: a proxy's, if there is one.
    pub address: String,
    /// The operation, by its id in this description.
    pub operation: String,
    /// What it was about: a path of the API; of something new, its own path.
    pub resource: String,
    /// The status of the answer; null: not known, the change may or may not have been made.
    #[schema(minimum = 100, maximum = 599)]
    pub status: Option<u16>,
    /// The request's id, as in `x-request-id` and in the server's log.
    pub request_id: String,
    /// How many refusals before this one were not written down, because there were too many.
    pub n_left_out: u32,
    /// The part of the log that it is in.
    pub ring: AuditRing,
    /// How often it was asked for with this outcome, within an hour. `resource`, `address` and
    /// `request_id` are of the first time.
    #[schema(minimum = 1)]
    pub n: u32,
    /// When it was asked for the last time.
    pub last_at: String,
}

/// A page of the audit log.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct AuditPage {
    /// The entries, newest first. With filters there may be fewer than `limit`, or none, though
    /// there are more pages.
    pub items: Vec<AuditEntry>,
    /// Where the next page begins; null ends the list.
    pub next_cursor: Option<String>,
}
