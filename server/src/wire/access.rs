//! Conversion of keys, roles and audit entries.

use palpate_schemas as wire;
use palpate_store::access::{AccessKey, Role};
use palpate_store::audit::{AuditEntry, Ring};

use super::time;
use crate::wire::Invalid;

/// A key as the wire has it, which holds `stored_bytes`.
pub(crate) fn key(key: &AccessKey, now_ms: u64, stored_bytes: u64) -> wire::ApiKey {
    let rotating = key.previous.map(|previous| previous.until_ms).filter(|until| *until > now_ms);
    wire::ApiKey {
        id: key.id,
        name: key.name.clone(),
        role: role(key.role),
        active: key.is_active(now_ms),
        created_at: time(key.created_at_ms),
        expires_at: key.expires_at_ms.map(time),
        last_used_at: key.last_used_at_ms.map(time),
        revoked_at: key.revoked_at_ms.map(time),
        rotating_until: rotating.map(time),
        stored_bytes,
    }
}

/// An entry of the audit log in its wire form.
pub(crate) fn audit_entry(entry: AuditEntry) -> wire::AuditEntry {
    let ring = ring(&entry);
    let (key_id, key_name) = entry.key.unzip();
    wire::AuditEntry {
        seq: entry.seq,
        at: time(entry.at_ms),
        key_id,
        key_name,
        role: entry.role.map(role),
        address: entry.address,
        operation: entry.operation,
        resource: entry.resource,
        status: entry.status,
        request_id: entry.request_id,
        n_left_out: entry.n_left_out,
        ring,
        n: entry.n,
        last_at: time(entry.last_at_ms),
    }
}

/// The ring of an entry in its wire form.
pub(crate) fn ring(entry: &AuditEntry) -> wire::AuditRing {
    match entry.ring() {
        Ring::Changes => wire::AuditRing::Changes,
        Ring::Refused => wire::AuditRing::Refused,
        Ring::Strangers => wire::AuditRing::Strangers,
    }
}

/// A time of the wire in milliseconds since 1970.
pub(crate) fn milliseconds(pointer: &str, text: &str) -> Result<u64, Invalid> {
    super::moment(text).map(|ms| u64::try_from(ms).unwrap_or(0)).ok_or_else(|| {
        let expected = "expected a time like 2026-05-01T00:00:00Z";
        Invalid::field(pointer, format!("came {text:?}, {expected}"))
    })
}

pub(crate) fn role(role: Role) -> wire::Role {
    match role {
        Role::Robot => wire::Role::Robot,
        Role::Trainer => wire::Role::Trainer,
        Role::Viewer => wire::Role::Viewer,
        Role::Admin => wire::Role::Admin,
    }
}

pub(crate) fn stored_role(role: wire::Role) -> Role {
    match role {
        wire::Role::Robot => Role::Robot,
        wire::Role::Trainer => Role::Trainer,
        wire::Role::Viewer => Role::Viewer,
        wire::Role::Admin => Role::Admin,
    }
}
