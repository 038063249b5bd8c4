//! Tests of API keys and the audit log: their frozen bytes, and the log's guarantees on both
//! engines.
//!
//! This test's `written` wrote `golden/access_v1.txt` when entries of the audit log had
//! schema 1, and writes `golden/access_v2.txt` today. These files never change.

use std::sync::Arc;

use palpate_store::access::{AccessKey, PreviousSecret, Role};
use palpate_store::audit::{AuditEntry, AuditLog, Ring, RingSizes};
use palpate_store::database::Database;
use palpate_store::engine::Engine;
use palpate_store::memory::MemoryEngine;
use tempfile::TempDir;
use uuid::Uuid;

use crate::bytes::{lines, thawed};
use crate::samples::wait;

/// Entries of the audit log of schema 1.
const GOLDEN_V1: &str = include_str!("golden/access_v1.txt");
/// Entries of the audit log of schema 2.
const GOLDEN: &str = include_str!("golden/access_v2.txt");

const SIZES: RingSizes = RingSizes { changes: 10, refused: 10, strangers: 10 };

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
        n: 1,
        last_at_ms: at_ms,
    }
}

fn written() -> String {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    wait(async {
        database.keys().create(&key(80)).await.unwrap();
        let log = database.audit(SIZES, |_| false).unwrap();
        log.begin(asked(1_700_000_000_025)).await.unwrap();
        log.add(refused(1_700_000_000_026)).await.unwrap();
        log.add(AuditEntry { key: None, role: None, ..refused(1_700_000_000_027) }).await.unwrap();
    });
    lines(&*engine)
}

fn refused(at_ms: u64) -> AuditEntry {
    AuditEntry { status: Some(403), n: 4, last_at_ms: at_ms + 5, ..asked(at_ms) }
}

/// A change that was made.
fn change(log: &AuditLog, at_ms: u64) -> AuditEntry {
    let entry = wait(log.begin(asked(at_ms))).unwrap();
    let entry = AuditEntry { status: Some(204), ..entry };
    wait(log.settle(&entry)).unwrap();
    entry
}

fn numbers(log: &AuditLog) -> Vec<u64> {
    log.before(None, 1000).unwrap().iter().map(|entry| entry.seq).collect()
}

fn of(changes: u64) -> RingSizes {
    RingSizes { changes, ..SIZES }
}

#[test]
fn written_bytes_equal_the_frozen_bytes() {
    assert_eq!(written(), GOLDEN);
}

#[test]
fn frozen_bytes_are_read() {
    let database = thawed(GOLDEN);
    assert_eq!(database.keys().all().unwrap(), [key(80)]);
    let found = database.audit(SIZES, |_| false).unwrap().before(None, 10).unwrap();
    let stranger = AuditEntry { key: None, role: None, ..refused(1_700_000_000_027) };
    let expected = [stranger, refused(1_700_000_000_026), asked(1_700_000_000_025)];
    let seqs = (1..=3).rev();
    let expected = expected.into_iter().zip(seqs).map(|(entry, seq)| AuditEntry { seq, ..entry });
    assert_eq!(found, expected.collect::<Vec<_>>());
}

#[test]
fn frozen_bytes_of_schema_1_are_read() {
    let database = thawed(GOLDEN_V1);
    assert_eq!(database.keys().all().unwrap(), [key(80)]);
    let log = database.audit(SIZES, |_| false).unwrap();
    let entry = AuditEntry { seq: 1, ..asked(1_700_000_000_025) };
    assert_eq!(log.before(None, 10).unwrap(), [entry]);
    assert_eq!(change(&log, 0).seq, 2);
}

#[test]
fn the_log_keeps_the_newest_and_continues_when_reopened() {
    let law = |database: &Database| {
        let log = database.audit(of(3), |_| false).unwrap();
        assert_eq!(numbers(&log), Vec::<u64>::new());
        for at_ms in 1..=5 {
            change(&log, at_ms);
        }
        assert_eq!(numbers(&log), [5, 4, 3]);
        let pages = |seq| log.before(seq, 2).unwrap().iter().map(|e| e.seq).collect::<Vec<_>>();
        assert_eq!(pages(None), [5, 4]);
        assert_eq!(pages(Some(4)), [3]);
        assert_eq!(pages(Some(3)), Vec::<u64>::new());

        // Opened again with smaller rings: numbers continue, times do not decrease.
        let log = database.audit(of(2), |_| false).unwrap();
        let entry = change(&log, 0);
        assert_eq!((entry.seq, entry.at_ms), (6, 5));
        assert_eq!(numbers(&log), [6, 5]);
    };
    law(&Database::in_memory());
    let folder = TempDir::new().unwrap();
    law(&Database::with_engine(Arc::new(crate::engines::open(&folder))).unwrap());
}

#[test]
fn refusals_and_failures_displace_no_change() {
    let database = Database::in_memory();
    let sizes = RingSizes { changes: 2, refused: 2, strangers: 1 };
    let log = database.audit(sizes, |_| false).unwrap();
    let changes = [change(&log, 1), change(&log, 2)];
    for at_ms in 3..=9 {
        let entry = wait(log.begin(asked(at_ms))).unwrap();
        wait(log.settle(&AuditEntry { status: Some(404), ..entry })).unwrap();
        let entry = wait(log.begin(asked(at_ms))).unwrap();
        wait(log.discard(&entry)).unwrap();
        wait(log.add(AuditEntry { key: None, ..refused(at_ms) })).unwrap();
    }
    let law = |log: &AuditLog| {
        let rings: Vec<Ring> = log.before(None, 9).unwrap().iter().map(AuditEntry::ring).collect();
        let (refused, stranger) = (Ring::Refused, Ring::Strangers);
        assert_eq!(rings, [stranger, refused, refused, Ring::Changes, Ring::Changes]);
        assert_eq!(log.before(None, 9).unwrap()[4], changes[0]);
    };
    law(&log);
    law(&database.audit(sizes, |_| false).unwrap());
}

#[test]
fn an_unsettled_entry_displaces_nothing() {
    let log = Database::in_memory().audit(of(2), |_| false).unwrap();
    let first = wait(log.begin(asked(1))).unwrap();
    for at_ms in 2..=4 {
        change(&log, at_ms);
    }
    assert_eq!(numbers(&log), [4, 3, 1]);
    wait(log.settle(&AuditEntry { status: Some(204), ..first })).unwrap();
    assert_eq!(numbers(&log), [4, 3]);
}

#[test]
fn an_entry_is_updated_unless_it_has_left_the_log() {
    let database = Database::in_memory();
    let sizes = RingSizes { refused: 1, ..SIZES };
    let log = database.audit(sizes, |_| false).unwrap();
    let first = wait(log.add(refused(1))).unwrap();
    wait(log.update(&AuditEntry { n: 9, last_at_ms: 70, ..first.clone() })).unwrap();
    let found = log.before(None, 1).unwrap();
    assert_eq!((found[0].n, found[0].last_at_ms), (9, 70));
    wait(log.add(refused(2))).unwrap();
    wait(log.update(&AuditEntry { n: 10, ..first })).unwrap();
    assert_eq!(numbers(&log), [2]);
    assert_eq!(numbers(&database.audit(sizes, |_| false).unwrap()), [2]);
}

#[test]
fn a_log_of_several_windows_is_read_completely() {
    let log = Database::in_memory().audit(of(1000), |_| false).unwrap();
    for at_ms in 0..600 {
        change(&log, at_ms);
    }
    assert_eq!(numbers(&log), (1..=600).rev().collect::<Vec<_>>());
}
