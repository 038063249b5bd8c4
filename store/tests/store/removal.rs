//! Tests of removal: it frees space, and keeps shared blocks.

use std::sync::Arc;

use palpate_store::catalogue::Manifest;
use palpate_store::database::Database;
use palpate_store::engine::Engine;
use palpate_store::error::StoreError;
use palpate_store::memory::MemoryEngine;
use tempfile::TempDir;
use uuid::Uuid;

use crate::samples::{catalogue, draft, sensor, wait};

fn check(law: impl Fn(&Database)) {
    law(&Database::in_memory());
    let folder = TempDir::new().unwrap();
    law(&Database::with_engine(Arc::new(crate::engines::open(&folder))).unwrap());
}

#[test]
fn removing_a_version_frees_its_unshared_blocks() {
    check(|database| {
        let (catalogues, id) = (database.catalogues(), Uuid::from_u128(70));
        wait(catalogues.create(&catalogue(70))).unwrap();
        let first = wait(catalogues.publish(id, draft(&[("a", 5_000), ("b", 60_000)]))).unwrap();
        let second = wait(catalogues.publish(id, draft(&[("a", 5_000)]))).unwrap();
        wait(catalogues.remove_version(id, 1)).unwrap();
        assert_eq!(catalogues.block(&second.blocks[0]).unwrap().len(), 5_000, "it is shared");
        assert!(catalogues.block(&first.blocks[1]).is_err(), "nobody else names it");
        let gone = Err(StoreError::NoVersion { catalogue: id, version: 1 });
        assert_eq!(catalogues.manifest(id, 1), gone);
        assert_eq!(wait(catalogues.remove_version(id, 1)), gone.map(|_: Manifest| ()));
        assert_eq!(catalogues.manifests(id, 0, 1).unwrap(), [second]);
        let third = wait(catalogues.publish(id, draft(&[("b", 60_000)]))).unwrap();
        assert_eq!(third.version, 3, "no number is used again");
        assert_eq!(catalogues.block(&third.blocks[0]).unwrap().len(), 60_000);
    });
}

#[test]
fn removing_a_catalogue_or_sensor_leaves_nothing() {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    let empty = database.stats().unwrap().bytes;
    let (catalogues, id) = (database.catalogues(), Uuid::from_u128(70));
    wait(catalogues.create(&catalogue(70))).unwrap();
    for length in [5_000, 6_000] {
        wait(catalogues.publish(id, draft(&[("a", length)]))).unwrap();
    }
    wait(catalogues.switch(id, 2, None, 1)).unwrap();
    wait(catalogues.remove_version(id, 1)).unwrap();
    let report = palpate_store::fsck::check(&*engine).unwrap();
    assert_eq!((report.findings.len(), report.damaged_versions.len()), (0, 0));
    wait(catalogues.remove(id)).unwrap();
    assert_eq!(catalogues.find_by_name(&catalogue(70).name).unwrap(), None);
    assert_eq!(database.stats().unwrap().bytes, empty);
    wait(database.sensors().create(&sensor(10))).unwrap();
    assert!(wait(database.remove_sensor(Uuid::from_u128(10))).unwrap());
    assert_eq!(database.stats().unwrap().bytes, empty);
}
