//! Tests of compaction: it frees space and changes no content.
//!
//! This holds during its run, when it is interrupted at any step, on a full disk, and in a
//! folder of an older version.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use palpate_core::rng::{Purpose, Stream};
use palpate_store::database::Database;
use palpate_store::engine::{Commit, Engine, EngineError, Pair};
use palpate_store::sled::{FreeSpace, Halt, SledEngine, SledOptions};
use tempfile::TempDir;

use crate::samples::{self, copy};

type Model = BTreeMap<Vec<u8>, Vec<u8>>;

/// Compaction on command only.
fn by_hand() -> SledOptions {
    SledOptions { slack_bytes: u64::MAX, ..SledOptions::default() }
}

fn open(folder: &Path, options: &SledOptions) -> SledEngine {
    SledEngine::open(folder, options).unwrap()
}

fn all(engine: &SledEngine) -> Vec<Pair> {
    engine.scan(b"", None, usize::MAX).unwrap()
}

/// Bytes of all keys and values.
fn bytes(pairs: &[Pair]) -> u64 {
    pairs.iter().map(|(key, value)| (key.len() + value.len()) as u64).sum()
}

fn pairs(model: &Model) -> Vec<Pair> {
    model.iter().map(|(key, value)| (key.clone(), value.clone())).collect()
}

/// A commit of a few writes and removals among 300 keys, also applied to the model.
fn random_commit(stream: &mut Stream, model: &mut Model) -> Commit {
    let mut commit = Commit::new();
    for _ in 0..1 + stream.index(6) {
        let key = format!("key {}", stream.index(300)).into_bytes();
        if stream.index(3) == 0 {
            model.remove(&key);
            commit = commit.remove(key);
        } else {
            let value = vec![stream.index(256) as u8; stream.index(1500)];
            model.insert(key.clone(), value.clone());
            commit = commit.put(key, value);
        }
    }
    commit
}

/// The sled folders, bases and the file `current`.
fn files(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.retain(|name| !["lock", "mark", "reserve"].contains(&name.as_str()));
    names.sort();
    names
}

#[test]
fn compaction_and_restart_keep_all_records() {
    let folder = TempDir::new().unwrap();
    {
        let engine = Arc::new(open(folder.path(), &by_hand()));
        let database = Database::with_engine(Arc::clone(&engine) as Arc<dyn Engine>).unwrap();
        samples::fill(&database);
        let before = all(&engine);
        for round in 0..3 {
            let done = engine.compact().unwrap();
            assert_eq!(all(&engine), before, "round {round}");
            let live = bytes(&before);
            assert_eq!((done.live_bytes, engine.stats().unwrap().live_bytes), (live, live));
            assert_eq!(samples::read_all(&database), Ok(()));
        }
        assert_eq!(engine.stats().unwrap().compactions, 3);
    }
    assert_eq!(files(folder.path()).len(), 3, "{:?}", files(folder.path()));
    let engine = SledEngine::open(folder.path(), &by_hand()).unwrap();
    let database = Database::with_engine(Arc::new(engine)).unwrap();
    assert_eq!(samples::read_all(&database), Ok(()));
}

#[test]
fn reads_writes_and_cuts_continue_during_compactions() {
    let folder = TempDir::new().unwrap();
    let engine = open(folder.path(), &by_hand());
    let mut stream = Stream::new(7, Purpose::ReadingChoice, 0);
    let mut model = Model::new();
    let is_done = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        let compacting = scope.spawn(|| {
            (0..8).for_each(|_| {
                engine.compact().unwrap();
            });
            is_done.store(true, Ordering::Relaxed);
        });
        let mut step = 0_u32;
        while !is_done.load(Ordering::Relaxed) || step < 300 {
            let cut = (step.is_multiple_of(25)).then(|| (engine.cut().unwrap(), pairs(&model)));
            for _ in 0..5 {
                engine.commit(random_commit(&mut stream, &mut model)).wait().unwrap();
            }
            assert_eq!(all(&engine), pairs(&model), "step {step}");
            if let Some((mut cut, expected)) = cut {
                let mut found = Vec::new();
                loop {
                    engine.commit(random_commit(&mut stream, &mut model)).wait().unwrap();
                    let page = cut.next(20).unwrap();
                    if page.is_empty() {
                        break;
                    }
                    found.extend(page);
                }
                assert_eq!(found, expected, "step {step}");
            }
            let key = format!("key {}", stream.index(300)).into_bytes();
            assert_eq!(engine.get(&key).unwrap().as_ref(), model.get(&key), "step {step}");
            step += 1;
        }
        compacting.join().unwrap();
    });
    let stats = engine.stats().unwrap();
    assert_eq!(stats.compactions, 8);
    let live = stats.live_bytes;
    drop(engine);
    let engine = open(folder.path(), &by_hand());
    assert_eq!(all(&engine), pairs(&model));
    assert_eq!(engine.stats().unwrap().live_bytes, live, "counted and kept are the same");
}

#[test]
fn a_compaction_killed_at_any_step_loses_nothing() {
    let mut stream = Stream::new(11, Purpose::ReadingChoice, 0);
    let halts = [Halt::Prepared, Halt::Frozen, Halt::Merging(50), Halt::Merged, Halt::Switched];
    for (place, halt) in halts.into_iter().enumerate() {
        let folder = TempDir::new().unwrap();
        let mut data = folder.path().join("0");
        let mut model = Model::new();
        // From today's layout, then from one with a base.
        for round in 1..3 {
            if round == 2 {
                open(&data, &by_hand()).compact().unwrap();
            }
            let engine = open(&data, &SledOptions { halt: Some(halt), ..by_hand() });
            for _ in 0..200 {
                engine.commit(random_commit(&mut stream, &mut model)).wait().unwrap();
            }
            assert_eq!(engine.compact().unwrap_err(), EngineError::Stopped);
            for _ in 0..20 {
                engine.commit(random_commit(&mut stream, &mut model)).wait().unwrap();
            }
            assert_eq!(all(&engine), pairs(&model), "{halt:?}, round {round}");
            let killed = folder.path().join(round.to_string());
            copy(&data, &killed);
            drop(engine);
            data = killed;
            let engine = open(&data, &by_hand());
            assert_eq!(all(&engine), pairs(&model), "{halt:?}, round {round}");
            let counted = engine.stats().unwrap().live_bytes;
            assert_eq!(counted, bytes(&pairs(&model)), "{halt:?}, round {round}");
            engine.compact().unwrap();
            assert_eq!(all(&engine), pairs(&model), "{halt:?}, round {round}");
            assert_eq!(files(&data).len(), 3, "step {place}: {:?}", files(&data));
        }
    }
}

#[test]
fn space_stays_bounded_with_few_kept_records() {
    const SLACK: u64 = 2 << 20;
    let folder = TempDir::new().unwrap();
    let engine = open(folder.path(), &SledOptions { slack_bytes: SLACK, ..by_hand() });
    let put = |key: String, bytes: usize| Commit::new().put(key.into(), vec![7; bytes]);
    // One in twenty is kept: without compaction each pins a segment of sled's.
    for number in 0..20_000_u32 {
        let pending = engine.commit(put(format!("s{number:08}"), 2000));
        if let Some(old) = number.checked_sub(200).filter(|old| old % 20 != 0) {
            let removal = Commit::new().remove(format!("s{old:08}").into());
            engine.commit(removal).wait().unwrap();
        }
        pending.wait().unwrap();
    }
    // The space of the last writes is freed too, without a command.
    let is_bounded = || {
        let stats = engine.stats().unwrap();
        stats.compactions > 0 && stats.bytes <= 2 * stats.live_bytes + SLACK
    };
    let tries = (0..600).take_while(|_| !is_bounded());
    tries.for_each(|_| std::thread::sleep(std::time::Duration::from_millis(50)));
    let stats = engine.stats().unwrap();
    assert!(is_bounded(), "{stats:?}");
    let live: usize = all(&engine).iter().map(|(key, value)| key.len() + value.len()).sum();
    assert_eq!(stats.live_bytes, live as u64);
}

#[test]
fn a_compaction_whose_copy_would_not_fit_does_not_start() {
    let folder = TempDir::new().unwrap();
    let free = Arc::new(AtomicU64::new(1 << 30));
    let told = Arc::clone(&free);
    let probe = FreeSpace::from_probe(move |_| Ok(told.load(Ordering::Relaxed)));
    let options = SledOptions { free_space: probe, reserve_bytes: 1 << 20, ..by_hand() };
    let engine = open(folder.path(), &options);
    for number in 0..500_u32 {
        let commit = Commit::new().put(format!("k{number}").into(), vec![1; 4000]);
        engine.commit(commit).wait().unwrap();
    }
    free.store(3 << 20, Ordering::Relaxed);
    let error = engine.compact().unwrap_err();
    assert!(matches!(error, EngineError::NoRoomToCompact { .. }), "{error}");
    assert!(error.to_string().starts_with("no room to compact: it needs 3.3"), "{error}");
    assert_eq!(files(folder.path()), ["sled"]);
    engine.commit(Commit::new().put(b"k".to_vec(), vec![1; 100])).wait().unwrap();
    free.store(1 << 30, Ordering::Relaxed);
    engine.compact().unwrap();
    assert_eq!(all(&engine).len(), 501);
}

#[test]
fn a_lost_or_damaged_file_is_reported_and_nothing_removed() {
    let folder = TempDir::new().unwrap();
    {
        let engine = open(folder.path(), &by_hand());
        let commit = Commit::new().put(b"a".to_vec(), vec![1; 100]);
        engine.commit(commit).wait().unwrap();
        engine.compact().unwrap();
    }
    let names = files(folder.path());
    assert_eq!(names, ["base-2", "current", "sled-1"]);
    for (name, said) in names.iter().zip(["base-2", "`current` is missing", "sled-1"]) {
        let broken = TempDir::new().unwrap();
        copy(folder.path(), broken.path());
        let path = broken.path().join(name);
        if path.is_dir() {
            std::fs::remove_dir_all(&path).unwrap();
        } else {
            std::fs::remove_file(&path).unwrap();
        }
        let error = SledEngine::open(broken.path(), &by_hand()).unwrap_err();
        assert!(error.to_string().contains(said), "{error}");
        let left = names.len() - 1;
        assert_eq!(files(broken.path()).len(), left, "{name}");
    }
    let base = folder.path().join("base-2");
    let mut bytes = std::fs::read(&base).unwrap();
    bytes[20] ^= 1;
    std::fs::write(&base, bytes).unwrap();
    let error = SledEngine::open(folder.path(), &by_hand()).unwrap_err();
    assert!(error.to_string().contains("base-2 has a damaged block at 0"), "{error}");
}
