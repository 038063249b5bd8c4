//! Tests of the engines' laws, the same for every engine, and of properties of sled alone.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use palpate_store::database::{Database, DatabaseError};
use palpate_store::engine::opening::OpenError;
use palpate_store::engine::{
    Commit, CommitError, Engine, EngineError, Expected, Pair, VALUE_BYTES_MAX,
};
use palpate_store::key::{self, Space};
use palpate_store::memory::MemoryEngine;
use palpate_store::sled::{SledEngine, SledOptions};
use tempfile::TempDir;

use crate::{cluster, samples};

pub(crate) fn open(folder: &TempDir) -> SledEngine {
    SledEngine::open(folder.path(), &SledOptions::default()).unwrap()
}

/// Runs a law on every engine; on a cluster where `tests/nats` provides one.
fn check(law: impl Fn(&dyn Engine)) {
    law(&MemoryEngine::new());
    let folder = TempDir::new().unwrap();
    law(&open(&folder));
    if let Some(store) = cluster::store() {
        law(&store.open());
    }
}

/// The key of a block of `n_pieces` full pieces, and the commit that writes all of them. The first
/// piece is the value of that key.
pub(crate) fn large(number: u64, n_pieces: u32) -> (Vec<u8>, Commit) {
    let mut hash = [7; 32];
    hash[..8].copy_from_slice(&number.to_be_bytes());
    let head = key::hash(Space::Block, &hash);
    let value = |piece: u32| vec![(number + u64::from(piece)) as u8; VALUE_BYTES_MAX];
    let commit = Commit::new().put(head.clone(), value(0));
    let commit = (1..n_pieces)
        .fold(commit, |commit, piece| commit.put(key::piece(&head, piece), value(piece)));
    (head, commit)
}

/// Large content is written, read, expected, replaced and removed as everything else.
pub(crate) fn law_of_large_content(engine: &dyn Engine) {
    let (head, commit) = large(1, 40);
    let expected: Vec<Pair> =
        commit.writes.iter().map(|(key, value)| (key.clone(), value.clone().unwrap())).collect();
    engine.commit(commit.put(b"n/x".to_vec(), vec![1])).wait().unwrap();
    assert!(engine.scan(&head, None, 99).unwrap() == expected, "other content");
    assert_eq!(engine.keys(&head, Some(&head), 3).unwrap().len(), 3);
    assert_eq!(engine.get(&expected[7].0).unwrap().as_ref(), Some(&expected[7].1));
    let mut cut = engine.cut().unwrap();
    let live_bytes = engine.stats().unwrap().live_bytes;
    let sizes = expected.iter().map(|(key, value)| (key.len() + value.len()) as u64);
    assert_eq!(live_bytes, sizes.sum::<u64>() + 4);

    let (third, fifth) = (expected[3].clone(), expected[5].0.clone());
    let wrong =
        Commit::new().expect(third.0.clone(), Expected::Value(vec![1])).remove(head.clone());
    assert_eq!(engine.commit(wrong).wait(), Err(CommitError::Conflict { expectation: 0 }));
    let right = Commit::new().expect(third.0.clone(), Expected::Value(third.1));
    let again = large(1, 20).1.writes.into_iter().skip(8);
    let again = again.map(|(key, _)| (key, Some(vec![9; VALUE_BYTES_MAX])));
    let mut change = right.remove(third.0.clone()).put(fifth.clone(), vec![5]);
    change.writes.extend(again);
    engine.commit(change).wait().unwrap();
    let after = engine.scan(&head, None, 99).unwrap();
    assert_eq!(after.len(), 39);
    assert_eq!(engine.get(&third.0).unwrap(), None);
    assert_eq!(engine.get(&fifth).unwrap(), Some(vec![5]));
    assert!(after[8..18].iter().all(|(_, value)| value == &vec![9; VALUE_BYTES_MAX]));
    assert!(after[30] == expected[31], "what was not replaced stays");
    let all = cut.next(99).unwrap();
    assert!(all[..40] == expected, "a cut has the state before");
    engine.compact().unwrap();
    assert!(engine.scan(&head, None, 99).unwrap() == after, "another state after a compaction");

    let remove = after.iter().fold(Commit::new(), |commit, (key, _)| commit.remove(key.clone()));
    engine.commit(remove).wait().unwrap();
    engine.commit(large(1, 40).1).wait().unwrap();
    assert!(engine.scan(&head, None, 99).unwrap() == expected, "content stored again");
    let remove = expected.iter().fold(Commit::new(), |commit, (key, _)| commit.remove(key.clone()));
    engine.commit(remove).wait().unwrap();
    assert_eq!(engine.stats().unwrap().live_bytes, 4);
}

#[test]
fn large_content_is_content_as_any() {
    check(law_of_large_content);
}

fn put(key: &str, value: &str) -> Commit {
    Commit::new().put(key.into(), value.into())
}

#[test]
fn a_commit_is_visible_as_a_whole() {
    check(|engine| {
        engine.commit(put("a", "1").put(b"b".to_vec(), b"2".to_vec())).wait().unwrap();
        assert_eq!(engine.get(b"a").unwrap().as_deref(), Some(&b"1"[..]));
        assert_eq!(engine.get(b"b").unwrap().as_deref(), Some(&b"2"[..]));
        engine.commit(put("a", "3").remove(b"b".to_vec()).remove(b"c".to_vec())).wait().unwrap();
        assert_eq!(engine.get(b"a").unwrap().as_deref(), Some(&b"3"[..]));
        assert_eq!(engine.get(b"b").unwrap(), None);
    });
}

#[test]
fn a_commit_with_a_failed_expectation_writes_nothing() {
    check(|engine| {
        engine.commit(put("a", "1")).wait().unwrap();
        let commit = put("b", "2")
            .expect(b"a".to_vec(), Expected::Value(b"1".to_vec()))
            .expect(b"a".to_vec(), Expected::Absent);
        assert_eq!(engine.commit(commit).wait(), Err(CommitError::Conflict { expectation: 1 }));
        let commit = put("b", "2").expect(b"z".to_vec(), Expected::Value(Vec::new()));
        assert_eq!(engine.commit(commit).wait(), Err(CommitError::Conflict { expectation: 0 }));
        assert_eq!(engine.get(b"b").unwrap(), None);
    });
}

#[test]
fn expectations_see_all_earlier_commits_of_the_same_thread() {
    check(|engine| {
        let first = engine.commit(put("a", "1").expect(b"a".to_vec(), Expected::Absent));
        let second = engine.commit(put("a", "2").expect(b"a".to_vec(), Expected::Absent));
        assert_eq!(second.wait(), Err(CommitError::Conflict { expectation: 0 }));
        assert_eq!(first.wait(), Ok(()));
        assert_eq!(engine.get(b"a").unwrap().as_deref(), Some(&b"1"[..]));
    });
}

#[test]
fn commits_sent_together_are_checked_one_after_the_other() {
    check(|engine| {
        let count = |n: u32| n.to_string().into_bytes();
        engine.commit(put("count", "0")).wait().unwrap();
        // Each expects the value of the one before; every tenth one is late and changes nothing.
        let commits: Vec<_> = (0..200_u32)
            .flat_map(|n| {
                let counted = Commit::new().put(b"count".to_vec(), count(n + 1));
                let next = counted.clone().expect(b"count".to_vec(), Expected::Value(count(n)));
                let late = put("late", "yes").expect(b"count".to_vec(), Expected::Value(count(n)));
                let late = n.is_multiple_of(10).then_some((late, false));
                [Some((next, true)), late].into_iter().flatten()
            })
            .map(|(commit, holds)| (engine.commit(commit), holds))
            .collect();
        for (pending, holds) in commits {
            let conflict = Err(CommitError::Conflict { expectation: 0 });
            assert_eq!(pending.wait(), if holds { Ok(()) } else { conflict });
        }
        assert_eq!(engine.get(b"count").unwrap(), Some(count(200)));
        assert_eq!(engine.get(b"late").unwrap(), None);
        let stats = engine.stats().unwrap();
        assert_eq!((stats.commits, stats.live_bytes), (201, ("count".len() + 3) as u64));
    });
}

#[test]
fn a_group_larger_than_a_commit_is_written_in_parts() {
    let folder = TempDir::new().unwrap();
    let engine = open(&folder);
    let of = |part: u8| {
        let keys = (0..9_000_u16).map(|n| [&[part][..], &n.to_be_bytes()].concat());
        keys.fold(Commit::new(), |commit, key| commit.put(key, vec![part]))
    };
    let commits = [1, 2, 3].map(|part| engine.commit(of(part)));
    for pending in commits {
        assert_eq!(pending.wait(), Ok(()));
    }
    for part in [1, 2, 3] {
        assert_eq!(engine.scan(&[part], None, 20_000).unwrap().len(), 9_000);
    }
}

#[test]
fn scans_are_ordered_within_prefix_and_after_start() {
    check(|engine| {
        let commit = ["a/3", "b/1", "a/1", "a", "a/2", "A"]
            .iter()
            .fold(Commit::new(), |commit, key| commit.put((*key).into(), Vec::new()));
        engine.commit(commit).wait().unwrap();
        let scan = |after: Option<&[u8]>, limit| -> Vec<String> {
            let pairs = engine.scan(b"a/", after, limit).unwrap();
            pairs.into_iter().map(|(key, _)| String::from_utf8(key).unwrap()).collect()
        };
        assert_eq!(scan(None, 10), ["a/1", "a/2", "a/3"]);
        assert_eq!(scan(None, 2), ["a/1", "a/2"]);
        assert_eq!(scan(Some(b"a/1"), 10), ["a/2", "a/3"]);
        assert_eq!(scan(Some(b"a/1zzz"), 10), ["a/2", "a/3"]);
        assert_eq!(scan(Some(b"A"), 1), ["a/1"]);
        assert_eq!(scan(Some(b"b"), 10), Vec::<String>::new());
        assert_eq!(engine.scan(b"", None, 99).unwrap().len(), 6);
    });
}

#[test]
fn commits_out_of_bounds_are_refused() {
    check(|engine| {
        let large = Commit::new().put(b"a".to_vec(), vec![0; VALUE_BYTES_MAX + 1]);
        let error = EngineError::ValueTooLarge { found: VALUE_BYTES_MAX + 1 };
        assert_eq!(engine.commit(large).wait(), Err(error.into()));
        let nameless = Commit::new().put(Vec::new(), Vec::new());
        let error = EngineError::KeyLength { found: 0 };
        assert_eq!(engine.commit(nameless).wait(), Err(error.into()));
        let largest = Commit::new().put(b"a".to_vec(), vec![0; VALUE_BYTES_MAX]);
        assert_eq!(engine.commit(largest).wait(), Ok(()));
    });
}

#[test]
fn one_of_many_concurrent_claims_of_a_key_succeeds() {
    check(|engine| {
        let winners = AtomicU64::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    let commit = put("a", "mine").expect(b"a".to_vec(), Expected::Absent);
                    if engine.commit(commit).wait().is_ok() {
                        winners.fetch_add(1, Ordering::Relaxed);
                    }
                });
            }
        });
        assert_eq!(winners.into_inner(), 1);
    });
}

#[test]
fn thirty_two_writers_share_flushes() {
    let folder = TempDir::new().unwrap();
    let engine = open(&folder);
    let (writers, each) = (32, 250);
    let begun = Instant::now();
    std::thread::scope(|scope| {
        for writer in 0..writers {
            let engine = &engine;
            scope.spawn(move || {
                for number in 0..each {
                    let key = format!("{writer}/{number}");
                    engine.commit(Commit::new().put(key.into(), vec![7; 400])).wait().unwrap();
                }
            });
        }
    });
    let per_second = f64::from(writers * each) / begun.elapsed().as_secs_f64();
    let stats = engine.stats().unwrap();
    println!("{per_second:.0} acknowledged writes a second, {} flushes", stats.flushes);
    assert_eq!(stats.commits, 8000);
    assert!(stats.flushes < stats.commits / 2, "{stats:?}");
    assert_eq!(engine.scan(b"", None, 9000).unwrap().len(), 8000);
}

#[test]
fn a_restart_keeps_all_values_and_they_stay_in_the_log() {
    let folder = TempDir::new().unwrap();
    {
        let database = Database::with_engine(Arc::new(open(&folder))).unwrap();
        samples::fill(&database);
        // A mesh of 3 MB and its replacement, the worst case for sled's blob files.
        for upload in [31, 32] {
            let file = samples::mesh_file(3_000_000 + upload as usize);
            let info = samples::mesh_info(upload, &file);
            let object = uuid::Uuid::from_u128(21);
            samples::wait(database.meshes().put(object, &info, &file)).unwrap();
        }
    }
    let database = Database::with_engine(Arc::new(open(&folder))).unwrap();
    assert_eq!(samples::read_all(&database), Ok(()));
    let blobs = std::fs::read_dir(folder.path().join("sled/blobs")).unwrap().count();
    assert_eq!(blobs, 0, "sled wrote values into files of their own");
}

#[test]
fn a_second_opener_is_refused_with_a_reason() {
    let folder = TempDir::new().unwrap();
    let engine = open(&folder);
    let error = SledEngine::open(folder.path(), &SledOptions::default()).unwrap_err();
    assert!(matches!(error, OpenError::InUse { .. }), "{error}");
    assert!(error.to_string().contains("in use by another process"), "{error}");
    drop(engine);
    open(&folder);
}

#[test]
fn a_folder_that_cannot_be_created_is_named() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let error = SledEngine::open(&file, &SledOptions::default()).unwrap_err();
    assert!(matches!(&error, OpenError::Io { path, .. } if *path == file), "{error}");
}

#[test]
fn newer_and_missing_layouts_are_refused() {
    let newer: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    Database::with_engine(Arc::clone(&newer)).unwrap();
    // The layout number is the first of the payload, after 20 bytes of envelope.
    let mut layout = newer.get(b"!").unwrap().unwrap();
    let payload = [&99u32.to_le_bytes()[..], &layout[24..]].concat();
    layout = palpate_store::envelope::seal(palpate_store::envelope::Kind::Layout, 1, &payload);
    newer.commit(Commit::new().put(b"!".to_vec(), layout)).wait().unwrap();
    let error = Database::with_engine(newer).err().unwrap();
    assert!(matches!(error, DatabaseError::TooNew { found: 99, .. }), "{error}");
    assert!(error.to_string().contains("use a newer version"), "{error}");

    let stranger: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    stranger.commit(put("x", "y")).wait().unwrap();
    assert!(matches!(Database::with_engine(stranger), Err(DatabaseError::NoLayout)));
}
