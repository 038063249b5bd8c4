//! Tests of holdings: the stored bytes of each API key, and the quota that limits them.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use palpate_store::calibration::Addition;
use palpate_store::database::Database;
use palpate_store::engine::Account;
use palpate_store::engine::{Engine, EngineError};
use palpate_store::error::StoreError;
use palpate_store::fsck;
use palpate_store::holding::{Holding, ThingKind, Who};
use palpate_store::journal::{AppendError, NewEntry};
use palpate_store::memory::MemoryEngine;
use palpate_store::robot::RobotHolder;
use palpate_store::sled::{SledEngine, SledOptions};
use tempfile::TempDir;
use uuid::Uuid;

use crate::samples::{
    self, catalogue, draft, entry, mesh_file, mesh_info, object, sensor, session, taxel_lines, wait,
};

const ARM: Uuid = Uuid::from_u128(1);
const TRAINER: Uuid = Uuid::from_u128(2);

/// A database whose commits count towards the account that [`Desk::writes`] names.
struct Desk {
    database: Database,
    account: Arc<Mutex<Option<Account>>>,
}

impl Desk {
    fn new(engine: Arc<dyn Engine>) -> Self {
        let account: Arc<Mutex<Option<Account>>> = Arc::default();
        let asked = Arc::clone(&account);
        let who: Who = Arc::new(move || *asked.lock().unwrap());
        Self { database: Database::with_engine(engine).unwrap().with_accounts(who), account }
    }

    fn writes(&self, key: Uuid, quota: Option<u64>) {
        *self.account.lock().unwrap() = Some(Account { key, quota });
    }

    fn held(&self, key: Uuid) -> u64 {
        self.database.held().get(&key).copied().unwrap_or(0)
    }

    fn by_kind(&self) -> BTreeMap<(ThingKind, Uuid), u64> {
        let mut found = BTreeMap::new();
        let add = |holding: Holding| {
            *found.entry((holding.kind, holding.key)).or_default() += holding.bytes;
        };
        self.database.holdings(add).unwrap();
        found
    }
}

fn check(law: impl Fn(&Desk)) {
    law(&Desk::new(Arc::new(MemoryEngine::new())));
    let folder = TempDir::new().unwrap();
    law(&Desk::new(Arc::new(crate::engines::open(&folder))));
    if let Some(store) = crate::cluster::store() {
        law(&Desk::new(Arc::new(store.open())));
    }
}

/// Bytes of everything but names and the holdings themselves.
fn live_bytes(desk: &Desk) -> u64 {
    let mut cut = desk.database.cut().unwrap();
    let pairs = std::iter::from_fn(|| Some(cut.next(64).unwrap()).filter(|page| !page.is_empty()));
    let counted = pairs.flatten().filter(|(key, _)| !b"nz".contains(&key[0]));
    counted.map(|(key, value)| (key.len() + value.len()) as u64).sum()
}

#[test]
fn every_stored_byte_counts_towards_its_writers_key() {
    check(|desk| {
        let before = live_bytes(desk);
        desk.writes(TRAINER, None);
        samples::fill(&desk.database);
        let lines = Addition::Lines(taxel_lines());
        wait(desk.database.calibrations().add(Uuid::from_u128(10), &lines)).unwrap();
        // Blocks of a version count with their contents, which lie under their own keys.
        let contents = 9_000 + 100;
        let blocks = 2 * (33 + 20) + 2 * (33 + 4);
        assert_eq!(desk.held(TRAINER), live_bytes(desk) - before - blocks);
        let kinds: Vec<_> = desk.by_kind().into_keys().map(|(kind, _)| kind).collect();
        use ThingKind::{Catalogue, Job, Object, Sensor, Session};
        assert_eq!(kinds, [Session, Object, Sensor, Catalogue, Job]);
        assert!(desk.by_kind()[&(Catalogue, TRAINER)] > contents);
        desk.writes(ARM, None);
        wait(desk.database.journal().append(Uuid::from_u128(50), 2, &[entry("c", 1)])).unwrap();
        assert!(desk.by_kind()[&(Session, ARM)] < 800, "the reading alone");
    });
}

#[test]
fn removed_bytes_count_towards_no_key() {
    check(|desk| {
        desk.writes(TRAINER, None);
        samples::fill(&desk.database);
        let holder = |robot: &str| RobotHolder { robot: robot.to_owned(), key: ARM, since_ms: 1 };
        desk.writes(ARM, None);
        wait(desk.database.robots().put(&[holder("arm"), holder("arm-2")])).unwrap();
        wait(desk.database.journal().append(Uuid::from_u128(50), 2, &[entry("c", 1)])).unwrap();
        let (file, mug) = (mesh_file(8_000), Uuid::from_u128(20));
        wait(desk.database.meshes().put(mug, &mesh_info(31, &file), &file)).unwrap();
        assert!(desk.held(ARM) > 8_000, "a mesh in the place of another's");
        assert!(desk.by_kind()[&(ThingKind::Object, TRAINER)] < 3_000, "which is gone");
        wait(desk.database.robots().remove("arm")).unwrap();
        assert!(desk.by_kind()[&(ThingKind::Robot, ARM)] > 0, "the other name is still there");
        wait(async {
            let database = &desk.database;
            database.robots().remove("arm-2").await?;
            database.remove_session(Uuid::from_u128(50)).await?;
            database.remove_object(mug).await?;
            database.remove_sensor(Uuid::from_u128(10)).await?;
            database.catalogues().remove(Uuid::from_u128(70)).await
        })
        .unwrap();
        assert_eq!(desk.held(ARM), 0);
        let left: Vec<_> = desk.by_kind().into_keys().collect();
        assert_eq!(left, [(ThingKind::Job, TRAINER)]);
    });
}

#[test]
fn a_quota_refuses_only_writes_that_do_not_fit() {
    check(|desk| {
        desk.writes(ARM, Some(3_000));
        let id = Uuid::from_u128(50);
        wait(desk.database.sessions().create(&session(50))).unwrap();
        let journal = desk.database.journal();
        let refused =
            (1..20).find_map(|seq| wait(journal.append(id, seq - 1, &[entry("a", seq)])).err());
        let Some(AppendError::Store(StoreError::Engine(error))) = refused else { panic!() };
        let EngineError::OverQuota { held, more, quota: 3_000 } = error else { panic!("{error}") };
        assert!(held <= 3_000 && held + more > 3_000 && held == desk.held(ARM));
        let file = mesh_file(50_000);
        let mesh = wait(desk.database.meshes().put(id, &mesh_info(30, &file), &file));
        assert!(matches!(mesh, Err(StoreError::Engine(EngineError::OverQuota { .. }))));
        let before = desk.database.stats().unwrap().live_bytes;
        wait(desk.database.catalogues().create(&catalogue(70))).unwrap_err();
        assert_eq!(desk.database.stats().unwrap().live_bytes, before);
        assert_eq!(desk.held(ARM), held, "what was refused counts nothing");
        wait(desk.database.essential().sessions().update(id, |session| {
            session.closed_at_ms = None;
            session.options = "{\"more\":true}".to_owned();
            Ok::<(), ()>(())
        }))
        .unwrap()
        .expect("what must work goes beyond the quota");
        desk.writes(TRAINER, Some(3_000));
        let next = journal.len(id).unwrap();
        wait(journal.append(id, next, &[entry("b", 1)])).expect("another key has its own");
        desk.writes(ARM, Some(3_000));
        wait(desk.database.remove_session(id)).unwrap();
        wait(desk.database.sessions().create(&session(51))).expect("room again");
    });
}

#[test]
fn a_version_that_exceeds_the_quota_leaves_no_blocks() {
    check(|desk| {
        desk.writes(TRAINER, Some(20_000));
        let (catalogues, id) = (desk.database.catalogues(), Uuid::from_u128(70));
        wait(catalogues.create(&catalogue(70))).unwrap();
        wait(catalogues.publish(id, draft(&[("a", 9_000)]))).unwrap();
        let before = live_bytes(desk);
        let refused = wait(catalogues.publish(id, draft(&[("a", 9_000), ("b", 5_000)])));
        assert!(matches!(refused, Err(StoreError::Engine(EngineError::OverQuota { .. }))));
        assert_eq!(live_bytes(desk), before);
        wait(catalogues.remove_version(id, 1)).unwrap();
        wait(catalogues.publish(id, draft(&[("a", 9_000), ("b", 5_000)]))).expect("room again");
    });
}

#[test]
fn holdings_are_the_same_after_a_restart_and_a_compaction() {
    let folder = TempDir::new().unwrap();
    let open = || SledEngine::open(folder.path(), &SledOptions::default()).unwrap();
    let desk = Desk::new(Arc::new(open()));
    desk.writes(TRAINER, None);
    samples::fill(&desk.database);
    desk.writes(ARM, None);
    let entries: Vec<NewEntry> = (0..40).map(|seq| entry("c", seq)).collect();
    wait(desk.database.journal().append(Uuid::from_u128(50), 2, &entries)).unwrap();
    desk.database.compact().unwrap();
    wait(desk.database.journal().append(Uuid::from_u128(50), 42, &[entry("c", 41)])).unwrap();
    let (held, things) = (desk.database.held(), desk.by_kind());
    drop(desk);
    let desk = Desk::new(Arc::new(open()));
    assert_eq!((desk.database.held(), desk.by_kind()), (held, things));
}

#[test]
fn fsck_collects_holdings_of_removed_things() {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let desk = Desk::new(Arc::clone(&engine));
    desk.writes(TRAINER, None);
    wait(desk.database.sensors().create(&sensor(10))).unwrap();
    wait(desk.database.objects().create(&object(20))).unwrap();
    assert_eq!(fsck::check(&*engine).unwrap().findings, []);
    // As a crash in the middle of a removal leaves it.
    wait(desk.database.objects().remove(Uuid::from_u128(20))).unwrap();
    let report = fsck::check(&*engine).unwrap();
    assert_eq!((report.n_damaged, report.n_leftovers), (0, 1), "{:?}", report.findings);
    wait(fsck::collect(&*engine, &report)).unwrap();
    assert_eq!(fsck::check(&*engine).unwrap().findings, []);
    let left: Vec<_> = desk.by_kind().into_keys().collect();
    assert_eq!(left, [(ThingKind::Sensor, TRAINER)]);
}
