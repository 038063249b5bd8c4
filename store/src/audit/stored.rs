//! Entries of the audit log as they are stored.

use bincode::{Decode, Encode};
use uuid::Uuid;

use super::AuditEntry;
use crate::access::ROLES;
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, code, coded, read, write};

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
