//! Tests of block-wise mesh reading: complete and undamaged, or an error before the end.

use std::sync::Arc;

use palpate_store::database::Database;
use palpate_store::engine::{Commit, Engine};
use palpate_store::error::StoreError;
use palpate_store::memory::MemoryEngine;
use palpate_store::mesh::MeshReader;
use uuid::Uuid;

use crate::samples::{mesh_file, mesh_info, wait};

const OBJECT: Uuid = Uuid::from_u128(1);

fn filled(bytes: usize) -> (Arc<dyn Engine>, Database) {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    let file = mesh_file(bytes);
    wait(database.meshes().put(OBJECT, &mesh_info(1, &file), &file)).unwrap();
    (engine, database)
}

/// All remaining blocks, each of bounded length.
fn rest(reader: &mut MeshReader) -> Result<Vec<u8>, StoreError> {
    let mut file = Vec::new();
    while let Some(block) = reader.next_block()? {
        assert!(block.len() <= (256 + 4) << 10, "{}", block.len());
        file.extend_from_slice(&block);
    }
    Ok(file)
}

#[test]
fn the_blocks_of_a_mesh_are_its_file() {
    assert!(Database::in_memory().meshes().open(OBJECT).unwrap().is_none());
    // A header of 20 bytes and one piece of 4096; 64 pieces a block.
    for bytes in [0, 1, 4076, 4077, 4076 + (256 << 10), 4077 + (256 << 10), 2_000_000] {
        let (_, database) = filled(bytes);
        let mut reader = database.meshes().open(OBJECT).unwrap().unwrap();
        assert_eq!(reader.info().length, bytes as u64);
        assert_eq!(rest(&mut reader).unwrap(), mesh_file(bytes));
        assert!(reader.next_block().unwrap().is_none());
    }
}

#[test]
fn a_damaged_mesh_is_never_returned_completely() {
    let bytes = 600_000;
    let (engine, database) = filled(bytes);
    for (key, value) in engine.scan(b"", None, 1000).unwrap() {
        // Every piece of the file.
        if value.len() < 1000 {
            continue;
        }
        let mut damaged = value.clone();
        damaged[900] ^= 1;
        engine.commit(Commit::new().put(key.clone(), damaged)).wait().unwrap();
        let read = database.meshes().open(OBJECT).and_then(|reader| rest(&mut reader.unwrap()));
        assert!(matches!(read, Err(StoreError::Damaged { .. })), "{key:?}");
        engine.commit(Commit::new().put(key, value)).wait().unwrap();
    }
    assert_eq!(rest(&mut database.meshes().open(OBJECT).unwrap().unwrap()).unwrap().len(), bytes);
}

#[test]
fn reading_a_replaced_mesh_gives_an_error() {
    let (_, database) = filled(2_000_000);
    let mut reader = database.meshes().open(OBJECT).unwrap().unwrap();
    reader.next_block().unwrap().unwrap();
    let file = mesh_file(10);
    wait(database.meshes().put(OBJECT, &mesh_info(2, &file), &file)).unwrap();
    assert!(rest(&mut reader).is_err());
    assert_eq!(rest(&mut database.meshes().open(OBJECT).unwrap().unwrap()).unwrap(), file);
}
