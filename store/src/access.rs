//! API keys as they are kept: who holds one, what it is for, and hashes of its secret.
//!
//! A secret itself is never stored. Secrets are 256 random bits, so a fast hash of one tells
//! nothing that could be searched for; a slow one (argon2) is for what people think up.
//! Names are not unique here: a revoked key keeps its name for the audit log.

mod stored;

use uuid::Uuid;

use crate::key::Space;
use crate::table::Entity;
pub(crate) use stored::ROLES;

/// What the holder of a key is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Touches things in sessions.
    Robot,
    /// Teaches: objects, sensors, trainings.
    Trainer,
    /// Looks on.
    Viewer,
    /// May do everything.
    Admin,
}

/// A key, without its secret.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AccessKey {
    /// Its id, which the key as it is sent begins with.
    pub id: Uuid,
    /// What people call its holder.
    pub name: String,
    /// What its holder is.
    pub role: Role,
    /// The BLAKE3 hash of its secret.
    pub hash: [u8; 32],
    /// The secret before the last rotation, while it is still let in.
    pub previous: Option<PreviousSecret>,
    /// When it was made.
    pub created_at_ms: u64,
    /// From when on it is refused.
    pub expires_at_ms: Option<u64>,
    /// When it was last used, to within an hour.
    pub last_used_at_ms: Option<u64>,
    /// When it was revoked.
    pub revoked_at_ms: Option<u64>,
}

impl AccessKey {
    /// Whether the key is accepted at `now_ms`: it was not revoked and has not expired.
    #[must_use]
    pub fn is_active(&self, now_ms: u64) -> bool {
        self.revoked_at_ms.is_none() && self.expires_at_ms.is_none_or(|at| at > now_ms)
    }
}

/// A secret that another has replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PreviousSecret {
    /// Its BLAKE3 hash.
    pub hash: [u8; 32],
    /// From when on it is refused.
    pub until_ms: u64,
}

impl Entity for AccessKey {
    const SPACE: Space = Space::AccessKey;
    const WHAT: &'static str = "key";

    fn id(&self) -> Uuid {
        self.id
    }

    fn name(&self) -> Option<&str> {
        None
    }
}
