//! Keys and the audit log: their frozen bytes, and what the log promises on both engines.
//!
//! `golden/access_v1.txt` was written by this test's `written` and is never changed.

use std::sync::Arc;

use palpate_store::access::{AccessKey, PreviousSecret, Role};
use palpate_store::audit::{AuditEntry, AuditLog};
use palpate_store::database::Database;
use palpate_store::engine::Engine;
use palpate_store::memory::MemoryEngine;
use tempfile::TempDir;
use uuid::Uuid;

use crate::bytes::{lines, thawed};
use crate::samples::wait;

const GOLDEN: &str = include_str!("golden/access_v1.txt");

fn key(id: u128) -> AccessKey {
    AccessKey {
        id: Uuid::from_u128(id),
        name: "arm-3".to_owned(),
        role: Role::Trainer,
        hash: [7; 32],
        previous: Some(PreviousSecret { hash: [8; 32], until_ms: 1_700_000_000_021 }),
        created_at_ms: 1_700_000_000_022,
        expires_at_ms: Some(1_700_000_000_023),
        last_used_at_ms: Some(1_700_000_000_024),
        revoked_at_ms: None,
    }
}

fn asked(at_ms: u64) -> AuditEntry {
    AuditEntry {
        seq: 0,
        at_ms,
        key: Some((Uuid::from_u128(80), "arm-3".to_owned())),
        role: Some(Role::Admin),
        address: "127.0.0.1".to_owned(),
        operation: "delete_object".to_owned(),
        resource: "/v1/objects/mug".to_owned(),
        status: None,
        request_id: "r-1".to_owned(),
        n_left_out: 3,
    }
}

fn written() -> String {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    wait(async {
        database.keys().create(&key(80)).await.unwrap();
        let log = database.audit(10).unwrap();
        log.append(asked(1_700_000_000_025)).await.unwrap();
    });
    lines(&*engine)
}

fn append(log: &AuditLog, at_ms: u64) -> AuditEntry {
    wait(log.append(asked(at_ms))).unwrap()
}

fn numbers(log: &AuditLog) -> Vec<u64> {
    log.before(None, 1000).unwrap().iter().map(|entry| entry.seq).collect()
}

#[test]
fn todays_bytes_are_the_frozen_bytes() {
    assert_eq!(written(), GOLDEN);
}

#[test]
fn frozen_bytes_are_read() {
    let database = thawed(GOLDEN);
    assert_eq!(database.keys().all().unwrap(), [key(80)]);
    let entry = AuditEntry { seq: 1, ..asked(1_700_000_000_025) };
    assert_eq!(database.audit(10).unwrap().before(None, 10).unwrap(), [entry]);
}

#[test]
fn the_log_keeps_the_newest_and_goes_on_after_it_was_closed() {
    let law = |database: &Database| {
        let log = database.audit(3).unwrap();
        assert_eq!(numbers(&log), []);
        for at_ms in 1..=5 {
            append(&log, at_ms);
        }
        assert_eq!(numbers(&log), [5, 4, 3]);
        let pages = |seq| log.before(seq, 2).unwrap().iter().map(|e| e.seq).collect::<Vec<_>>();
        assert_eq!(pages(None), [5, 4]);
        assert_eq!(pages(Some(4)), [3]);
        assert_eq!(pages(Some(3)), []);

        // Opened anew, for fewer: numbers go on, times do not go back.
        let log = database.audit(2).unwrap();
        let entry = append(&log, 0);
        assert_eq!((entry.seq, entry.at_ms), (6, 5));
        assert_eq!(numbers(&log), [6, 5]);
    };
    law(&Database::in_memory());
    let folder = TempDir::new().unwrap();
    law(&Database::with_engine(Arc::new(crate::engines::open(&folder))).unwrap());
}

#[test]
fn a_status_is_added_unless_the_entry_has_left_the_log() {
    let database = Database::in_memory();
    let log = database.audit(2).unwrap();
    let first = append(&log, 1);
    wait(log.finish(&AuditEntry { status: Some(204), ..first.clone() })).unwrap();
    assert_eq!(log.before(None, 1).unwrap()[0].status, Some(204));
    append(&log, 2);
    append(&log, 3);
    wait(log.finish(&AuditEntry { status: Some(500), ..first })).unwrap();
    assert_eq!(numbers(&log), [3, 2]);
    assert_eq!(numbers(&database.audit(2).unwrap()), [3, 2]);
}

#[test]
fn a_log_of_more_than_one_window_is_read_whole() {
    let log = Database::in_memory().audit(1000).unwrap();
    for at_ms in 0..600 {
        append(&log, at_ms);
    }
    assert_eq!(numbers(&log), (1..=600).rev().collect::<Vec<_>>());
}
