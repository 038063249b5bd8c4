//! API keys as they are stored.

use bincode::{Decode, Encode};
use uuid::Uuid;

use super::{AccessKey, PreviousSecret, Role};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, code, coded, read, write};

/// Roles in the order of their stored codes.
pub(crate) const ROLES: [Role; 4] = [Role::Robot, Role::Trainer, Role::Viewer, Role::Admin];

#[derive(Encode, Decode)]
struct AccessKeyRecordV1 {
    id: IdV1,
    name: String,
    role: u8,
    hash: [u8; 32],
    /// The hash before the last rotation, and from when on it is refused.
    previous: Option<([u8; 32], u64)>,
    created_at_ms: u64,
    expires_at_ms: Option<u64>,
    last_used_at_ms: Option<u64>,
    revoked_at_ms: Option<u64>,
}

impl Record for AccessKey {
    const KIND: Kind = Kind::AccessKey;

    fn to_payload(&self) -> Vec<u8> {
        write(&AccessKeyRecordV1 {
            id: self.id.into_bytes(),
            name: self.name.clone(),
            role: code(&ROLES, &self.role),
            hash: self.hash,
            previous: self.previous.map(|previous| (previous.hash, previous.until_ms)),
            created_at_ms: self.created_at_ms,
            expires_at_ms: self.expires_at_ms,
            last_used_at_ms: self.last_used_at_ms,
            revoked_at_ms: self.revoked_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: AccessKeyRecordV1 = read(payload)?;
        let previous = stored.previous.map(|(hash, until_ms)| PreviousSecret { hash, until_ms });
        Ok(Self {
            id: Uuid::from_bytes(stored.id),
            name: stored.name,
            role: coded(&ROLES, "role", stored.role)?,
            hash: stored.hash,
            previous,
            created_at_ms: stored.created_at_ms,
            expires_at_ms: stored.expires_at_ms,
            last_used_at_ms: stored.last_used_at_ms,
            revoked_at_ms: stored.revoked_at_ms,
        })
    }
}
