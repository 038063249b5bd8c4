//! Stored forms of API keys, the names of robots that they own, and entries of the audit log.

use bincode::{Decode, Encode};
use uuid::Uuid;

use super::{IdV1, Record, code, coded, read, write};
use crate::access::{AccessKey, PreviousSecret, Role};
use crate::audit::AuditEntry;
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::robot::RobotHolder;

const ROLES: [Role; 4] = [Role::Robot, Role::Trainer, Role::Viewer, Role::Admin];

#[derive(Encode, Decode)]
struct AccessKeyRecordV1 {
    id: IdV1,
    name: String,
    role: u8,
    hash: [u8; 32],
    /// The hash before the last rotation, and the time from which it is refused.
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

#[derive(Encode, Decode)]
struct RobotHolderRecordV1 {
    robot: String,
    key: IdV1,
    since_ms: u64,
}

impl Record for RobotHolder {
    const KIND: Kind = Kind::RobotHolder;

    fn to_payload(&self) -> Vec<u8> {
        write(&RobotHolderRecordV1 {
            robot: self.robot.clone(),
            key: self.key.into_bytes(),
            since_ms: self.since_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let RobotHolderRecordV1 { robot, key, since_ms } = read(payload)?;
        Ok(Self { robot, key: Uuid::from_bytes(key), since_ms })
    }
}

#[derive(Encode, Decode)]
struct AuditRecordV1 {
    seq: u64,
    at_ms: u64,
    key: Option<(IdV1, String)>,
    role: Option<u8>,
    address: String,
    operation: String,
    resource: String,
    status: Option<u16>,
    request_id: String,
    n_left_out: u32,
}

/// Schema 1 with the number of requests and the time of the last.
#[derive(Encode, Decode)]
struct AuditRecordV2 {
    first: AuditRecordV1,
    n: u32,
    last_at_ms: u64,
}

impl Record for AuditEntry {
    const KIND: Kind = Kind::Audit;
    const SCHEMA: u16 = 2;

    fn to_payload(&self) -> Vec<u8> {
        let first = AuditRecordV1 {
            seq: self.seq,
            at_ms: self.at_ms,
            key: self.key.as_ref().map(|(id, name)| (id.into_bytes(), name.clone())),
            role: self.role.map(|role| code(&ROLES, &role)),
            address: self.address.clone(),
            operation: self.operation.clone(),
            resource: self.resource.clone(),
            status: self.status,
            request_id: self.request_id.clone(),
            n_left_out: self.n_left_out,
        };
        write(&AuditRecordV2 { first, n: self.n, last_at_ms: self.last_at_ms })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let AuditRecordV2 { first, n, last_at_ms } = read(payload)?;
        Ok(Self { n, last_at_ms, ..once(first)? })
    }

    fn from_older(_schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        once(read(payload)?)
    }
}

/// An entry of schema 1: one request.
fn once(stored: AuditRecordV1) -> Result<AuditEntry, RecordError> {
    let role = stored.role.map(|role| coded(&ROLES, "role", role)).transpose()?;
    Ok(AuditEntry {
        seq: stored.seq,
        at_ms: stored.at_ms,
        key: stored.key.map(|(id, name)| (Uuid::from_bytes(id), name)),
        role,
        address: stored.address,
        operation: stored.operation,
        resource: stored.resource,
        status: stored.status,
        request_id: stored.request_id,
        n_left_out: stored.n_left_out,
        n: 1,
        last_at_ms: stored.at_ms,
    })
}
