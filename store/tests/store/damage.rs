//! Tests of damaged bytes: they are detected and named, never returned and never a panic.

use std::sync::Arc;

use palpate_store::database::{Database, DatabaseError};
use palpate_store::engine::{Commit, Engine};
use palpate_store::memory::MemoryEngine;
use palpate_store::sled::{SledEngine, SledOptions};
use tempfile::TempDir;

use crate::samples;

/// Opens the database of `engine` and reads everything in it.
fn read(engine: &Arc<dyn Engine>) -> Result<(), String> {
    let database = Database::with_engine(Arc::clone(engine)).map_err(|error| error.to_string())?;
    samples::read_all(&database)
}

fn filled() -> Arc<dyn Engine> {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    samples::fill(&Database::with_engine(Arc::clone(&engine)).unwrap());
    engine
}

fn write(engine: &Arc<dyn Engine>, key: &[u8], value: Option<Vec<u8>>) {
    let commit = match value {
        Some(value) => Commit::new().put(key.to_vec(), value),
        None => Commit::new().remove(key.to_vec()),
    };
    engine.commit(commit).wait().unwrap();
}

#[test]
fn a_flipped_byte_in_any_value_is_detected() {
    let engine = filled();
    assert_eq!(read(&engine), Ok(()));
    let pairs = engine.scan(b"", None, 1000).unwrap();
    assert!(pairs.len() > 20, "{}", pairs.len());
    for (key, value) in &pairs {
        for place in (0..value.len()).step_by(1 + value.len() / 16).chain([value.len() - 1]) {
            let mut flipped = value.clone();
            flipped[place] ^= 0x10;
            write(&engine, key, Some(flipped));
            assert!(read(&engine).is_err(), "byte {place} of {key:02x?}");
        }
        write(&engine, key, Some(value.clone()));
    }
    assert_eq!(read(&engine), Ok(()));
}

#[test]
fn a_shortened_or_missing_value_is_detected() {
    let engine = filled();
    for (key, value) in engine.scan(b"", None, 1000).unwrap() {
        for shortened in [Some(value[..value.len() - 1].to_vec()), Some(Vec::new()), None] {
            write(&engine, &key, shortened);
            assert!(read(&engine).is_err(), "{key:02x?}");
        }
        write(&engine, &key, Some(value));
    }
}

#[test]
fn two_swapped_values_are_detected() {
    let engine = filled();
    let pairs = engine.scan(b"", None, 1000).unwrap();
    for (first, second) in pairs.iter().zip(&pairs[1..]).filter(|(a, b)| a.1 != b.1) {
        write(&engine, &first.0, Some(second.1.clone()));
        write(&engine, &second.0, Some(first.1.clone()));
        assert!(read(&engine).is_err(), "{:02x?} and {:02x?}", first.0, second.0);
        write(&engine, &first.0, Some(first.1.clone()));
        write(&engine, &second.0, Some(second.1.clone()));
    }
}

#[test]
fn a_damaged_data_file_never_panics_or_gives_wrong_data() {
    let folder = TempDir::new().unwrap();
    {
        let engine = SledEngine::open(folder.path(), &SledOptions::default()).unwrap();
        let database = Database::with_engine(Arc::new(engine)).unwrap();
        samples::fill(&database);
    }
    let path = folder.path().join("sled/db");
    let whole = std::fs::read(&path).unwrap();
    let used = whole.iter().rposition(|byte| *byte != 0).unwrap();
    let flips = (1..12).map(|twelfth| {
        let mut damaged = whole.clone();
        damaged[used * twelfth / 12] ^= 0x40;
        damaged
    });
    let cuts = [used / 2, used / 3, 100].map(|length| whole[..length].to_vec());
    let mut found = 0;
    for damaged in flips.chain(cuts) {
        let copy = TempDir::new().unwrap();
        std::fs::create_dir_all(copy.path().join("sled/blobs")).unwrap();
        for file in std::fs::read_dir(folder.path().join("sled")).unwrap() {
            let file = file.unwrap();
            if file.file_type().unwrap().is_file() {
                std::fs::copy(file.path(), copy.path().join("sled").join(file.file_name()))
                    .unwrap();
            }
        }
        std::fs::write(copy.path().join("sled/db"), damaged).unwrap();
        // A byte in free space changes nothing; everything else must be an error.
        let outcome = SledEngine::open(copy.path(), &SledOptions::default())
            .map_err(DatabaseError::from)
            .and_then(|engine| Database::with_engine(Arc::new(engine)))
            .map_err(|error| error.to_string())
            .and_then(|database| samples::read_all(&database));
        found += usize::from(outcome.is_err());
    }
    assert!(found >= 3, "only {found} of 14 were found");
}
