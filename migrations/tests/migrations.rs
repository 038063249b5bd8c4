//! Migrations from every earlier layout: forwards, resumed after each commit, repeated, refused.
//!
//! `golden/layout1.txt` holds a database of layout 1, one key and value a line in
//! hexadecimal, with journal entries of every schema of layout 1. `golden/layout2.txt` is the
//! expected result, written by the decoders of those schemas before there were migrations.
#![allow(clippy::unwrap_used, reason = "a test fails where it unwraps")]

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

use palpate_migrations::{MigrateError, Migrated, NEWEST, layout, migrate};
use palpate_store::engine::{
    Commit, Compacted, Cut, Engine, EngineError, EngineStats, Pair, Pending,
};
use palpate_store::envelope::{Kind, seal};
use palpate_store::fsck;
use palpate_store::memory::MemoryEngine;
use palpate_store::sled::{SledEngine, SledOptions};
use uuid::Uuid;

const LAYOUT_1: &str = include_str!("../golden/layout1.txt");
const LAYOUT_2: &str = include_str!("../golden/layout2.txt");

fn unhex(text: &str) -> Vec<u8> {
    let digits = |place| u8::from_str_radix(&text[place..place + 2], 16).unwrap();
    (0..text.len()).step_by(2).map(digits).collect()
}

fn pairs(golden: &str) -> Vec<Pair> {
    let pair = |line: &str| {
        let (key, value) = line.split_once(' ').unwrap();
        (unhex(key), unhex(value))
    };
    golden.lines().map(pair).collect()
}

fn fill(engine: &dyn Engine, golden: &str) {
    let put = |commit: Commit, (key, value): Pair| commit.put(key, value);
    engine.commit(pairs(golden).into_iter().fold(Commit::new(), put)).wait().unwrap();
}

fn all(engine: &dyn Engine) -> Vec<Pair> {
    engine.scan(&[], None, 10_000).unwrap()
}

/// An engine that accepts this many more commits and then fails, like a killed process.
struct Interrupted {
    inner: MemoryEngine,
    left: AtomicU64,
}

impl Engine for Interrupted {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        self.inner.get(key)
    }

    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        n: usize,
    ) -> Result<Vec<Pair>, EngineError> {
        self.inner.scan(prefix, after, n)
    }

    fn commit(&self, commit: Commit) -> Pending {
        let left =
            self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1));
        match left {
            Ok(_) => self.inner.commit(commit),
            Err(_) => Pending::ready(Err(EngineError::Stopped.into())),
        }
    }

    fn held(&self) -> BTreeMap<Uuid, u64> {
        self.inner.held()
    }

    fn cut(&self) -> Result<Box<dyn Cut>, EngineError> {
        self.inner.cut()
    }

    fn compact(&self) -> Result<Compacted, EngineError> {
        self.inner.compact()
    }

    fn stats(&self) -> Result<EngineStats, EngineError> {
        self.inner.stats()
    }
}

#[test]
fn layout_1_migrates_to_layout_2() {
    let engine = MemoryEngine::new();
    fill(&engine, LAYOUT_1);
    let migrated = migrate(&engine).unwrap();
    assert_eq!(migrated, Migrated { from: 1, to: NEWEST, n_records: 8 });
    assert_eq!(all(&engine), pairs(LAYOUT_2));
    let report = fsck::check(&engine).unwrap();
    assert_eq!(
        (report.layout, report.n_damaged, report.n_leftovers),
        (Some(2), 0, 0),
        "{report:?}"
    );
}

#[test]
fn a_migration_interrupted_at_any_commit_resumes() {
    let mut n_interrupted = 0;
    for n_commits in 0.. {
        let engine = Interrupted { inner: MemoryEngine::new(), left: AtomicU64::new(1) };
        fill(&engine, LAYOUT_1);
        engine.left.store(n_commits, Ordering::Relaxed);
        let first = migrate(&engine);
        engine.left.store(u64::MAX, Ordering::Relaxed);
        if first.is_ok() {
            break;
        }
        n_interrupted += 1;
        assert_eq!(layout(&engine).unwrap(), Some(1), "the number is written last");
        migrate(&engine).unwrap();
        assert_eq!(all(&engine), pairs(LAYOUT_2), "after {n_commits} commits");
    }
    // One commit for training, one for sessions, one for the number.
    assert_eq!(n_interrupted, 3);
}

#[test]
fn a_repeated_migration_changes_nothing_on_disk() {
    let folder = tempfile::tempdir().unwrap();
    {
        let engine = SledEngine::open(folder.path(), &SledOptions::default()).unwrap();
        fill(&engine, LAYOUT_1);
        migrate(&engine).unwrap();
    }
    let engine = SledEngine::open(folder.path(), &SledOptions::default()).unwrap();
    assert_eq!(all(&engine), pairs(LAYOUT_2));
    let again = migrate(&engine).unwrap();
    assert_eq!(again, Migrated { from: NEWEST, to: NEWEST, n_records: 0 });
    assert_eq!(engine.stats().unwrap().commits, 0, "nothing was written");
}

#[test]
fn newer_damaged_and_foreign_databases_are_refused() {
    let engine = MemoryEngine::new();
    assert_eq!(migrate(&engine).unwrap().n_records, 0, "nothing to do where nothing is");
    engine.commit(Commit::new().put(b"x".to_vec(), b"y".to_vec())).wait().unwrap();
    assert!(matches!(migrate(&engine), Err(MigrateError::NoLayout)));
    let newer = seal(Kind::Layout, 1, &[&99u32.to_le_bytes()[..], &[0; 8]].concat());
    engine.commit(Commit::new().put(b"!".to_vec(), newer)).wait().unwrap();
    let error = migrate(&engine).unwrap_err();
    assert!(matches!(error, MigrateError::TooNew { found: 99 }), "{error}");
    let damaged = MemoryEngine::new();
    fill(&damaged, LAYOUT_1);
    let (key, mut value) = pairs(LAYOUT_1).into_iter().find(|(key, _)| key[0] == b'r').unwrap();
    value[40] ^= 1;
    damaged.commit(Commit::new().put(key, value)).wait().unwrap();
    assert!(matches!(migrate(&damaged), Err(MigrateError::Damaged { .. })));
}
