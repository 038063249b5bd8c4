//! Tests of durability: lost commits are detected, a full disk refuses early, and cuts are
//! consistent.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use palpate_store::engine::opening::OpenError;
use palpate_store::engine::{Commit, CommitError, Cut, Engine, EngineError, Pair};
use palpate_store::memory::MemoryEngine;
use palpate_store::sled::{CUTS_MAX, FreeSpace, OnDamage, SledEngine, SledOptions};
use tempfile::TempDir;

use crate::samples::copy;

fn open(folder: &Path, on_damage: OnDamage) -> Result<SledEngine, OpenError> {
    SledEngine::open(folder, &SledOptions { on_damage, ..SledOptions::default() })
}

fn put(engine: &dyn Engine, number: u32) {
    let key = format!("k{number:06}").into_bytes();
    engine.commit(Commit::new().put(key, vec![number as u8; 100])).wait().unwrap();
}

fn written(folder: &Path, numbers: std::ops::Range<u32>) {
    let engine = open(folder, OnDamage::Refuse).unwrap();
    numbers.for_each(|number| put(&engine, number));
}

#[test]
fn an_older_copy_of_the_log_is_refused_inspected_and_accepted() {
    let folder = TempDir::new().unwrap();
    written(folder.path(), 0..40);
    let older = TempDir::new().unwrap();
    copy(folder.path(), older.path());
    written(folder.path(), 40..50);
    // The log of ten commits ago, and the present mark.
    std::fs::copy(folder.path().join("mark"), older.path().join("mark")).unwrap();
    let error = open(older.path(), OnDamage::Refuse).unwrap_err();
    let OpenError::LostCommits { acknowledged: 50, found: 40, .. } = error else {
        panic!("{error}");
    };
    assert!(error.to_string().contains("palpate fsck --accept"), "{error}");
    {
        let engine = open(older.path(), OnDamage::Inspect).unwrap();
        assert!(engine.damage().is_some());
        assert_eq!(engine.scan(b"k", None, 100).unwrap().len(), 40);
        let refused = engine.commit(Commit::new().put(vec![1], vec![1])).wait();
        assert_eq!(refused, Err(CommitError::Engine(EngineError::Poisoned)));
    }
    drop(open(older.path(), OnDamage::Accept).unwrap());
    let engine = open(older.path(), OnDamage::Refuse).unwrap();
    put(&engine, 99);
    assert_eq!(engine.scan(b"k", None, 100).unwrap().len(), 41);
}

#[test]
fn a_missing_or_damaged_mark_is_reported() {
    let folder = TempDir::new().unwrap();
    written(folder.path(), 0..3);
    let path = folder.path().join("mark");
    std::fs::write(&path, [7; 600]).unwrap();
    let error = open(folder.path(), OnDamage::Refuse).unwrap_err();
    assert!(matches!(&error, OpenError::Mark { fault: "is damaged", .. }), "{error}");
    std::fs::remove_file(&path).unwrap();
    let error = open(folder.path(), OnDamage::Refuse).unwrap_err();
    assert!(matches!(&error, OpenError::Mark { fault: "is missing", .. }), "{error}");
    drop(open(folder.path(), OnDamage::Accept).unwrap());
    assert!(open(folder.path(), OnDamage::Refuse).is_ok());
}

#[test]
fn a_key_dropped_by_sled_is_detected() {
    let folder = TempDir::new().unwrap();
    written(folder.path(), 0..20);
    {
        // Like a lost page: without a commit.
        let db = sled::open(folder.path().join("sled")).unwrap();
        db.remove("k000007").unwrap();
        db.flush().unwrap();
    }
    let error = open(folder.path(), OnDamage::Refuse).unwrap_err();
    assert!(matches!(error, OpenError::Altered { found: 19, .. }), "{error}");
}

#[test]
fn a_full_disk_refuses_writes_until_space_is_free() {
    let folder = TempDir::new().unwrap();
    let free = Arc::new(AtomicU64::new(u64::MAX));
    let seen = Arc::clone(&free);
    let engine = SledEngine::open(
        folder.path(),
        &SledOptions {
            reserve_bytes: 1 << 20,
            free_space: FreeSpace::from_probe(move |_| Ok(seen.load(Ordering::Relaxed))),
            ..SledOptions::default()
        },
    )
    .unwrap();
    put(&engine, 1);
    free.store(1 << 20, Ordering::Relaxed);
    let refused = engine.commit(Commit::new().put(b"k2".to_vec(), vec![0; 10])).wait();
    let full = EngineError::Full { free: 1 << 20, reserve: 1 << 20 };
    assert_eq!(refused, Err(CommitError::Engine(full)));
    assert_eq!(engine.get(b"k2").unwrap(), None);
    assert!(engine.get(b"k000001").unwrap().is_some(), "reading goes on");
    engine.commit(Commit::new().remove(b"k000001".to_vec())).wait().unwrap();
    free.store(u64::MAX, Ordering::Relaxed);
    put(&engine, 3);
    drop(engine);
    let engine = open(folder.path(), OnDamage::Refuse).unwrap();
    let keys: Vec<_> = engine.scan(b"k", None, 9).unwrap().into_iter().map(|pair| pair.0).collect();
    assert_eq!(keys, [b"k000003".to_vec()]);
}

#[test]
fn another_program_cannot_use_up_the_reserve() {
    const RESERVE: u64 = 64 << 20;
    const DISK: u64 = 4 * RESERVE;
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("reserve");
    let held = move || file.metadata().map_or(0, |file| file.len());
    let others = Arc::new(AtomicU64::new(0));
    let fill = || others.store(DISK - held(), Ordering::Relaxed);
    let (counted, held_now) = (Arc::clone(&others), held.clone());
    let probe =
        move |_: &Path| Ok(DISK.saturating_sub(counted.load(Ordering::Relaxed) + held_now()));
    let options = SledOptions {
        reserve_bytes: RESERVE,
        free_space: FreeSpace::from_probe(probe).holding_reserve(),
        ..SledOptions::default()
    };
    let engine = SledEngine::open(folder.path(), &options).unwrap();
    put(&engine, 1);
    assert_eq!(held(), RESERVE / 4 * 3);

    fill();
    let refused = engine.commit(Commit::new().put(b"k2".to_vec(), vec![0; 10])).wait();
    assert!(matches!(refused, Err(CommitError::Engine(EngineError::Full { .. }))), "{refused:?}");
    assert_eq!(held(), RESERVE / 4 * 3, "nothing was written, so nothing was freed");
    engine.commit(Commit::new().remove(b"k000001".to_vec())).wait().unwrap();
    assert!(held() < RESERVE / 4 * 3, "the removal has its space");
    fill();
    let commit = Commit::new().put(b"k3".to_vec(), vec![0; 10]);
    engine.commit(Commit { is_essential: true, ..commit }).wait().unwrap();
    drop(engine);
    fill();
    let engine = SledEngine::open(folder.path(), &options).unwrap();
    assert!(engine.get(b"k3").unwrap().is_some(), "a start has its space, too");

    others.store(0, Ordering::Relaxed);
    put(&engine, 4);
    assert_eq!(held(), RESERVE / 4 * 3);
}

fn read_all(cut: &mut dyn Cut, mut between: impl FnMut()) -> Vec<Pair> {
    let mut all = Vec::new();
    loop {
        let page = cut.next(7).unwrap();
        if page.is_empty() {
            return all;
        }
        all.extend(page);
        between();
    }
}

#[test]
fn a_cut_is_consistent_under_concurrent_writes() {
    let folder = TempDir::new().unwrap();
    let sled = open(folder.path(), OnDamage::Refuse).unwrap();
    let memory = MemoryEngine::new();
    for engine in [&sled as &dyn Engine, &memory] {
        (0..100).for_each(|number| put(engine, 2 * number));
        let before = engine.scan(&[], None, 1000).unwrap();
        let mut cut = engine.cut().unwrap();
        let mut round = 0;
        let read = read_all(&mut *cut, || {
            // Changes, removals and new keys, before and after the reader.
            round += 1;
            let key = |number: u32| format!("k{:06}", number % 200).into_bytes();
            let commit = Commit::new()
                .put(key(round * 37), vec![9; 50])
                .remove(key(round * 74))
                .put(key(2 * round + 1), vec![8; 5])
                .put(key(199 - 2 * round), vec![7; 5]);
            engine.commit(commit).wait().unwrap();
        });
        assert!(round > 10);
        assert_eq!(read, before);
        drop(cut);
        let now = engine.scan(&[], None, 1000).unwrap();
        assert_ne!(now, before);
        assert_eq!(read_all(&mut *engine.cut().unwrap(), || ()), now, "the next one is of now");
    }
}

#[test]
fn concurrent_cuts_each_show_their_own_moment() {
    let folder = TempDir::new().unwrap();
    let engine = open(folder.path(), OnDamage::Refuse).unwrap();
    let mut cuts = Vec::new();
    for n in 0..CUTS_MAX as u8 {
        // Each commit changes one key and adds another.
        let commit = Commit::new().put(b"same".to_vec(), vec![n]).put(vec![b't', n], vec![n]);
        engine.commit(commit).wait().unwrap();
        cuts.push(engine.cut().unwrap());
    }
    let too_many = engine.cut().err();
    assert_eq!(too_many, Some(EngineError::CutsUnderWay { max: CUTS_MAX }));
    engine.commit(Commit::new().remove(b"same".to_vec())).wait().unwrap();
    for (n, cut) in cuts.iter_mut().enumerate() {
        let mut found = Vec::new();
        loop {
            let page = cut.next(2).unwrap();
            if page.is_empty() {
                break;
            }
            found.extend(page);
        }
        assert_eq!(found[0], (b"same".to_vec(), vec![n as u8]));
        assert_eq!(found.len(), n + 2, "{found:?}");
    }
    cuts.pop();
    assert!(engine.cut().is_ok());
}

#[test]
fn a_damaged_file_that_can_be_rebuilt_is_rebuilt() {
    let folder = TempDir::new().unwrap();
    // Sled makes its snapshots when it opens a log with content.
    written(folder.path(), 0..19);
    written(folder.path(), 19..20);
    let sled_folder = folder.path().join("sled");
    let is_derived = |name: &std::ffi::OsStr| name.to_string_lossy().starts_with("snap.");
    let files = std::fs::read_dir(&sled_folder).unwrap().map(|entry| entry.unwrap().path());
    let derived: Vec<_> = files.filter(|path| is_derived(path.file_name().unwrap())).collect();
    assert!(!derived.is_empty());
    derived.iter().for_each(|path| std::fs::write(path, [3; 40]).unwrap());
    let engine = open(folder.path(), OnDamage::Refuse).unwrap();
    assert_eq!(engine.scan(b"k", None, 100).unwrap().len(), 20);
    assert!(folder.path().join("aside").is_dir(), "what was damaged is kept");
}
