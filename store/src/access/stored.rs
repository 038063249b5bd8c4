//! API keys as they are stored.

use uuid::Uuid;

use super::{AccessKey, PreviousSecret, Role};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{Record, code, coded, read, write};

/// Roles in the order of their stored codes.
pub(crate) const ROLES: [Role; 4] = [Role::Robot, Role::Trainer, Role::Viewer, Role::Admin];

impl Record for AccessKey {
    const KIND: Kind = Kind::AccessKey;

    fn to_payload(&self) -> Vec<u8> {
        // The hash before the last rotation, and when it expires.
        let previous = self.previous.map(|previous| (previous.hash, previous.until_ms));
        let (id, role) = (self.id.as_bytes(), code(&ROLES, &self.role));
        let times =
            (self.created_at_ms, self.expires_at_ms, self.last_used_at_ms, self.revoked_at_ms);
        write(&(id, &self.name, role, self.hash, previous, times))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (id, name, role, hash, previous, times) = read(payload)?;
        let previous: Option<([u8; 32], u64)> = previous;
        let (created_at_ms, expires_at_ms, last_used_at_ms, revoked_at_ms) = times;
        Ok(Self {
            id: Uuid::from_bytes(id),
            name,
            role: coded(&ROLES, "role", role)?,
            hash,
            previous: previous.map(|(hash, until_ms)| PreviousSecret { hash, until_ms }),
            created_at_ms,
            expires_at_ms,
            last_used_at_ms,
            revoked_at_ms,
        })
    }
}
