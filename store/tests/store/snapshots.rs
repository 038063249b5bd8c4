//! Tests of snapshots: they restore every byte, and incomplete ones are refused.

use std::sync::Arc;

use palpate_store::access::{AccessKey, Role};
use palpate_store::database::{Database, LAYOUT};
use palpate_store::engine::Engine;
use palpate_store::memory::MemoryEngine;
use palpate_store::robot::RobotHolder;
use palpate_store::sled::{SledEngine, SledOptions};
use palpate_store::snapshot::{
    KeysFrom, SnapshotError, SnapshotHeader, SnapshotWriter, keys, restore, verify,
};
use proptest::prelude::*;
use tempfile::TempDir;
use uuid::Uuid;

use crate::{samples, webhooks};

fn filled() -> Arc<dyn Engine> {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    samples::fill(&Database::with_engine(Arc::clone(&engine)).unwrap());
    engine
}

fn snapshot(engine: &dyn Engine) -> Vec<u8> {
    let header = SnapshotHeader { layout: LAYOUT, created_at_ms: 9, made_by: "test".to_owned() };
    let mut writer = SnapshotWriter::new(engine.cut().unwrap(), &header);
    let mut bytes = Vec::new();
    while let Some(chunk) = writer.next_chunk().unwrap() {
        bytes.extend(chunk);
    }
    bytes
}

#[test]
fn a_restored_database_has_every_byte() {
    let engine = filled();
    let bytes = snapshot(&*engine);
    let (manifest, report) = verify(&bytes[..]).unwrap();
    assert_eq!((manifest.header.layout, report.n_damaged), (LAYOUT, 0));
    let pairs = engine.scan(b"", None, 1000).unwrap();
    assert_eq!(manifest.pairs.values().sum::<u64>(), pairs.len() as u64);
    let folder = TempDir::new().unwrap();
    let restored = SledEngine::open(folder.path(), &SledOptions::default()).unwrap();
    restore(&bytes[..], &restored, KeysFrom::Snapshot).unwrap();
    assert_eq!(restored.scan(b"", None, 1000).unwrap(), pairs);
    let again = restore(&bytes[..], &restored, KeysFrom::Snapshot).unwrap_err();
    assert!(matches!(again, SnapshotError::NotEmpty), "{again}");
    let database = Database::with_engine(Arc::new(restored)).unwrap();
    assert_eq!(samples::read_all(&database), Ok(()));
}

#[test]
fn keys_of_a_snapshot_are_kept_dropped_or_replaced() {
    let named = |id, name: &str, revoked_at_ms| AccessKey {
        id: Uuid::from_u128(id),
        name: name.to_owned(),
        role: Role::Robot,
        hash: [1; 32],
        previous: None,
        created_at_ms: 1,
        expires_at_ms: None,
        last_used_at_ms: None,
        revoked_at_ms,
    };
    let holder =
        |key| RobotHolder { robot: "arm".to_owned(), key: Uuid::from_u128(key), since_ms: 1 };
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    samples::wait(async {
        database.keys().create(&named(1, "revoked-since", None)).await.unwrap();
        database.keys().create(&named(2, "forgotten-since", None)).await.unwrap();
        database.robots().put(&[holder(1)]).await.unwrap();
        database.store_clock(5, 0).await.unwrap();
    });
    let bytes = snapshot(&*engine);
    assert_eq!(keys(&bytes[..]).unwrap().len(), 2);
    let current: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let now = Database::with_engine(Arc::clone(&current)).unwrap();
    samples::wait(async {
        now.keys().create(&named(1, "revoked-since", Some(7))).await.unwrap();
        now.keys().create(&named(3, "made-since", None)).await.unwrap();
        now.robots().put(&[holder(3)]).await.unwrap();
        now.store_clock(9, 0).await.unwrap();
    });
    let restored = |from: KeysFrom<'_>| {
        let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
        restore(&bytes[..], &*engine, from).unwrap();
        let database = Database::with_engine(engine).unwrap();
        let keys = database.keys().all().unwrap();
        let keys: Vec<_> = keys.into_iter().map(|key| (key.name, key.revoked_at_ms)).collect();
        (keys, database.robots().all().unwrap(), database.latest_time().unwrap())
    };
    let key = |name: &str, revoked| (name.to_owned(), revoked);
    let kept = vec![key("revoked-since", None), key("forgotten-since", None)];
    assert_eq!(restored(KeysFrom::Snapshot), (kept, vec![holder(1)], 5));
    assert_eq!(restored(KeysFrom::Nowhere), (vec![], vec![], 5));
    let newer = vec![key("revoked-since", Some(7)), key("made-since", None)];
    assert_eq!(restored(KeysFrom::Engine(&*current)), (newer, vec![holder(3)], 9));
}

#[test]
fn webhooks_of_a_snapshot_go_with_its_keys() {
    let fill = |engine: &Arc<dyn Engine>, id: u128| {
        let database = Database::with_engine(Arc::clone(engine)).unwrap();
        samples::wait(async {
            database.webhooks().create(&webhooks::webhook(id)).await.unwrap();
            let delivery = webhooks::delivery(id, 7);
            database.deliveries().add(&[delivery], &[], Some(&webhooks::notice(id))).await.unwrap();
        });
    };
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let current: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    fill(&engine, 90);
    fill(&current, 91);
    let bytes = snapshot(&*engine);
    let restored = |from: KeysFrom<'_>| {
        let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
        restore(&bytes[..], &*engine, from).unwrap();
        let database = Database::with_engine(engine).unwrap();
        let hooks = database.webhooks().all().unwrap().into_iter().map(|hook| hook.id.as_u128());
        let deliveries = database.deliveries();
        let (sent, notices) = (webhooks::all(&deliveries), deliveries.notices().unwrap());
        (hooks.collect::<Vec<_>>(), sent, notices)
    };
    let of = |id| (vec![id], vec![webhooks::delivery(id, 7)], vec![webhooks::notice(id)]);
    assert_eq!(restored(KeysFrom::Snapshot), of(90));
    assert_eq!(restored(KeysFrom::Nowhere), (vec![], vec![], vec![]));
    assert_eq!(restored(KeysFrom::Engine(&*current)), of(91));
}

#[test]
fn a_truncated_snapshot_is_refused_and_never_opens() {
    let bytes = snapshot(&*filled());
    for length in (0..bytes.len()).step_by(97).chain(bytes.len() - 40..bytes.len()) {
        let error = verify(&bytes[..length]).unwrap_err();
        assert!(matches!(error, SnapshotError::CutOff { .. }), "{length}: {error}");
        let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
        restore(&bytes[..length], &*engine, KeysFrom::Snapshot).unwrap_err();
        let is_empty = engine.scan(b"", None, 1).unwrap().is_empty();
        assert!(is_empty || Database::with_engine(engine).is_err(), "{length}");
    }
    let longer = [&bytes[..], b"x"].concat();
    let error = verify(&longer[..]).unwrap_err();
    assert!(error.to_string().contains("something follows its end"), "{error}");
}

#[test]
fn any_changed_byte_is_detected() {
    let bytes = snapshot(&*filled());
    for place in (0..bytes.len()).step_by(31) {
        let mut changed = bytes.clone();
        changed[place] ^= 0x10;
        assert!(verify(&changed[..]).is_err(), "byte {place}");
    }
}

#[test]
fn newer_forms_and_layouts_are_refused() {
    let bytes = snapshot(&*filled());
    let changed = |place: usize| {
        let mut changed = bytes.clone();
        changed[place] = 77;
        verify(&changed[..]).unwrap_err()
    };
    assert!(matches!(changed(0), SnapshotError::Magic));
    assert!(matches!(changed(8), SnapshotError::Form { found: 77 }));
    assert!(matches!(changed(12), SnapshotError::TooNew { found: 77, known: LAYOUT }));
}

proptest! {
    #[test]
    fn hostile_bytes_are_refused_without_panic(tail in prop::collection::vec(any::<u8>(), 0..300)) {
        let head = [&b"PLPTSNAP\x01\0\0\0"[..], &LAYOUT.to_le_bytes(), &[0; 10]].concat();
        prop_assert!(verify(&[head, tail].concat()[..]).is_err());
    }
}
