//! API keys as stored: holder, role and hashes of the secret.
//!
//! A secret itself is never stored. Secrets are 256 random bits, so a fast hash is safe; a
//! slow one (argon2) is for passwords that people choose. Names are not unique here: a
//! revoked key keeps its name for the audit log.

mod stored;

use uuid::Uuid;

use crate::key::Space;
use crate::table::Entity;
pub(crate) use stored::ROLES;

/// Role of a key's holder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Sends readings to sessions.
    Robot,
    /// Manages objects and sensors, and trains.
    Trainer,
    /// Reads only.
    Viewer,
    /// Full access.
    Admin,
}

/// A key, without its secret.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AccessKey {
    /// Id, the first part of a key as it is sent.
    pub id: Uuid,
    /// Name of the holder.
    pub name: String,
    /// Role of the holder.
    pub role: Role,
    /// BLAKE3 hash of the secret.
    pub hash: [u8; 32],
    /// The secret before the last rotation, while it is still accepted.
    pub previous: Option<PreviousSecret>,
    /// Time of creation.
    pub created_at_ms: u64,
    /// Time of expiry.
    pub expires_at_ms: Option<u64>,
    /// Time of the last use, to within an hour.
    pub last_used_at_ms: Option<u64>,
    /// Time of revocation.
    pub revoked_at_ms: Option<u64>,
}

impl AccessKey {
    /// Whether the key is accepted at `now_ms`: it was not revoked and has not expired.
    #[must_use]
    pub fn is_active(&self, now_ms: u64) -> bool {
        self.revoked_at_ms.is_none() && self.expires_at_ms.is_none_or(|at| at > now_ms)
    }
}

/// A secret that a rotation replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PreviousSecret {
    /// BLAKE3 hash of it.
    pub hash: [u8; 32],
    /// Time from which it is refused.
    pub until_ms: u64,
}

impl Entity for AccessKey {
    const SPACE: Space = Space::AccessKey;
    const WHAT: &'static str = "key";

    fn id(&self) -> Uuid {
        self.id
    }
}
