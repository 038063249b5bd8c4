//! A snapshot gives back every byte, and anything else than a whole one is refused.

use std::sync::Arc;

use palpate_store::database::{Database, LAYOUT};
use palpate_store::engine::Engine;
use palpate_store::memory::MemoryEngine;
use palpate_store::sled::{SledEngine, SledOptions};
use palpate_store::snapshot::{SnapshotError, SnapshotHeader, SnapshotWriter, restore, verify};
use proptest::prelude::*;
use tempfile::TempDir;

use crate::samples;

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
fn a_restored_database_has_every_byte_of_the_one_before() {
    let engine = filled();
    let bytes = snapshot(&*engine);
    let (manifest, report) = verify(&bytes[..]).unwrap();
    assert_eq!((manifest.header.layout, report.n_damaged), (LAYOUT, 0));
    let pairs = engine.scan(b"", None, 1000).unwrap();
    assert_eq!(manifest.pairs.values().sum::<u64>(), pairs.len() as u64);
    let folder = TempDir::new().unwrap();
    let restored = SledEngine::open(folder.path(), &SledOptions::default()).unwrap();
    restore(&bytes[..], &restored).unwrap();
    assert_eq!(restored.scan(b"", None, 1000).unwrap(), pairs);
    let again = restore(&bytes[..], &restored).unwrap_err();
    assert!(matches!(again, SnapshotError::NotEmpty), "{again}");
    let database = Database::with_engine(Arc::new(restored)).unwrap();
    assert_eq!(samples::read_all(&database), Ok(()));
}

#[test]
fn a_snapshot_that_was_cut_off_anywhere_is_refused_and_never_opens() {
    let bytes = snapshot(&*filled());
    for length in (0..bytes.len()).step_by(97).chain(bytes.len() - 40..bytes.len()) {
        let error = verify(&bytes[..length]).unwrap_err();
        assert!(matches!(error, SnapshotError::CutOff { .. }), "{length}: {error}");
        let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
        restore(&bytes[..length], &*engine).unwrap_err();
        let is_empty = engine.scan(b"", None, 1).unwrap().is_empty();
        assert!(is_empty || Database::with_engine(engine).is_err(), "{length}");
    }
    let longer = [&bytes[..], b"x"].concat();
    let error = verify(&longer[..]).unwrap_err();
    assert!(error.to_string().contains("something follows its end"), "{error}");
}

#[test]
fn any_changed_byte_is_found() {
    let bytes = snapshot(&*filled());
    for place in (0..bytes.len()).step_by(31) {
        let mut changed = bytes.clone();
        changed[place] ^= 0x10;
        assert!(verify(&changed[..]).is_err(), "byte {place}");
    }
}

#[test]
fn newer_forms_and_layouts_are_refused_by_name() {
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
