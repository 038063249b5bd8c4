//! Tests of the engine on a cluster alone: several openers, compaction, lost servers.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use palpate_store::database::Database;
use palpate_store::engine::{Commit, CommitError, Engine, Expected, Pair};
use palpate_store::key::{self, Space};
use palpate_store::nats::NatsEngine;
use palpate_store::nats::snapshots::Snapshots;
use uuid::Uuid;

use crate::cluster::{Cluster, Store, store};
use crate::engines::large;
use crate::samples;

fn all(engine: &dyn Engine) -> Vec<Pair> {
    engine.scan(b"", None, usize::MAX).unwrap()
}

/// Waits until an engine has followed to what another one has.
#[track_caller]
fn same(first: &NatsEngine, second: &NatsEngine) {
    let begun = Instant::now();
    while all(first) != all(second) {
        assert!(begun.elapsed() < Duration::from_secs(180), "one engine does not follow");
        std::thread::yield_now();
    }
}

#[test]
fn content_may_stay_in_the_stream() {
    let Some(mut store) = store() else { return };
    let objects = store.options.content_bytes_min;
    store.options.content_bytes_min = usize::MAX;
    let engine = store.open();
    let (head, commit) = large(1, 100);
    engine.commit(commit).wait().unwrap();
    assert_eq!((engine.content().n_objects, engine.content().n_put), (0, 0));
    // One that puts content in objects reads what is in the stream, and adds to it.
    store.options.content_bytes_min = objects;
    let other = store.open();
    assert!(other.stats().unwrap().received_bytes > 400_000, "the content came with the stream");
    assert_eq!(other.scan(&head, None, 200).unwrap(), engine.scan(&head, None, 200).unwrap());
    other.commit(large(2, 100).1).wait().unwrap();
    assert!(other.content().n_put > 0 && other.content().n_fetched == 0);
    same(&engine, &other);
}

#[test]
fn a_database_on_a_cluster_reads_back_after_a_restart() {
    let Some(store) = store() else { return };
    let before = {
        let engine = Arc::new(store.open());
        let database = Database::with_engine(Arc::<NatsEngine>::clone(&engine)).unwrap();
        samples::fill(&database);
        let file = samples::mesh_file(3_000_000);
        let put = |upload| {
            let info = samples::mesh_info(upload, &file);
            samples::wait(database.meshes().put(Uuid::from_u128(21), &info, &file)).unwrap();
        };
        put(31);
        put(32);
        all(&*engine)
    };
    let engine = Arc::new(store.open());
    assert!(all(&*engine) == before, "other records after a restart");
    let database = Database::with_engine(engine).unwrap();
    assert_eq!(samples::read_all(&database), Ok(()));
}

#[test]
fn two_servers_count_to_the_same_number_together() {
    let Some(store) = store() else { return };
    let engines = [store.open(), store.open()];
    let each = 40;
    let conflicts = AtomicU64::new(0);
    let count = |engine: &NatsEngine| {
        let mut counted = 0;
        while counted < each {
            let before = engine.get(b"count").unwrap();
            let number: u64 = before
                .as_ref()
                .map_or(0, |bytes| String::from_utf8(bytes.clone()).unwrap().parse().unwrap());
            let commit = Commit::new()
                .expect(b"count".to_vec(), before.map_or(Expected::Absent, Expected::Value))
                .put(b"count".to_vec(), (number + 1).to_string().into_bytes())
                .put(format!("log/{number}").into_bytes(), Vec::new());
            match engine.commit(commit).wait() {
                Ok(()) => counted += 1,
                Err(CommitError::Conflict { .. }) => {
                    conflicts.fetch_add(1, Ordering::Relaxed);
                }
                Err(error) => panic!("{error}"),
            }
        }
    };
    std::thread::scope(|scope| {
        for engine in &engines {
            scope.spawn(|| count(engine));
        }
    });
    println!("{} conflicts", conflicts.into_inner());
    same(&engines[0], &engines[1]);
    for engine in &engines {
        assert_eq!(engine.get(b"count").unwrap().as_deref(), Some(&b"80"[..]));
        assert_eq!(engine.scan(b"log/", None, 1000).unwrap().len(), 80);
    }
}

#[test]
fn a_reader_elsewhere_sees_commits_as_a_whole() {
    let Some(store) = store() else { return };
    let (writer, reader) = (store.open(), store.open());
    let is_done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for number in 0..150 {
                let value = vec![number; 300];
                let commit = ["a", "b", "c"]
                    .iter()
                    .fold(Commit::new(), |commit, key| commit.put((*key).into(), value.clone()));
                writer.commit(commit).wait().unwrap();
            }
            is_done.store(true, Ordering::Release);
        });
        while !is_done.load(Ordering::Acquire) {
            let values: Vec<_> = all(&reader).into_iter().map(|(_, value)| value).collect();
            assert!(values.is_empty() || values.len() == 3, "{} of 3 keys", values.len());
            assert!(values.windows(2).all(|pair| pair[0] == pair[1]), "values of two commits");
        }
    });
    same(&writer, &reader);
}

#[test]
fn removed_sessions_leave_one_message_and_garbage_goes() {
    let Some(store) = store() else { return };
    let engine = store.open();
    let session = Uuid::from_u128(5);
    let head = key::id(Space::JournalHead, session);
    for number in 0..60u64 {
        let entry = key::numbered(Space::Journal, session, number);
        let commit = Commit::new().put(head.clone(), vec![1; 40]).put(entry, vec![2; 1500]);
        engine.commit(commit).wait().unwrap();
    }
    let full = engine.stats().unwrap();
    assert!(full.bytes < full.live_bytes * 5 / 4, "{full:?}");
    let pairs = all(&engine);
    // A third goes, then a compaction writes the rest anew.
    for (key, _) in pairs.iter().filter(|(key, _)| key[0] == b'r').take(50) {
        engine.commit(Commit::new().remove(key.clone())).wait().unwrap();
    }
    let left = all(&engine);
    let compacted = engine.compact().unwrap();
    assert!(compacted.after_bytes < compacted.live_bytes * 2, "{compacted:?}");
    assert!(all(&engine) == left && store.open().scan(b"", None, 999).unwrap() == left);
    let remove = |commit: Commit, (key, _): Pair| commit.remove(key);
    engine.commit(left.into_iter().fold(Commit::new(), remove)).wait().unwrap();
    let empty = engine.stats().unwrap();
    assert_eq!(empty.live_bytes, 0);
    assert!(empty.bytes < 1000, "{empty:?}");
    engine.commit(Commit::new().put(head.clone(), vec![3])).wait().unwrap();
    assert_eq!(all(&store.open()), [(head, vec![3])]);
}

#[test]
fn a_large_commit_is_one_batch_and_a_wide_one_is_refused() {
    let Some(store) = store() else { return };
    let engine = store.open();
    let session = Uuid::from_u128(6);
    let commit = (0..2000).fold(Commit::new(), |commit, number| {
        commit.put(key::numbered(Space::Journal, session, number), vec![7; 4096])
    });
    engine.commit(commit).wait().unwrap();
    assert_eq!(engine.scan(b"r", None, 9999).unwrap().len(), 2000);
    let wide = (0..1001u32).fold(Commit::new(), |commit, number| {
        commit.put(format!("n/{number}").into_bytes(), Vec::new())
    });
    let error = engine.commit(wide).wait().unwrap_err();
    assert!(error.to_string().contains("1001 groups"), "{error}");
    assert_eq!(engine.scan(b"n", None, 9999).unwrap(), []);
}

#[test]
fn killed_leaders_lose_nothing_acknowledged() {
    let Some(mut cluster) = Cluster::start(3) else { return };
    let store = Store::on(&cluster.address);
    let engine = store.open();
    let is_done = AtomicBool::new(false);
    let (longest, killed) = std::thread::scope(|scope| {
        let write = |writer: u8| {
            let (mut acknowledged, mut longest) = (0u64, Duration::ZERO);
            let session = Uuid::from_u128(u128::from(writer));
            let head = key::id(Space::JournalHead, session);
            while !is_done.load(Ordering::Acquire) {
                let begun = Instant::now();
                let before = engine.get(&head).unwrap();
                let entry = key::numbered(Space::Journal, session, acknowledged);
                let commit = Commit::new()
                    .expect(head.clone(), before.map_or(Expected::Absent, Expected::Value))
                    .expect(entry.clone(), Expected::Absent)
                    .put(head.clone(), (acknowledged + 1).to_be_bytes().to_vec())
                    .put(entry, vec![writer; 500])
                    .put(format!("n/{writer}/{acknowledged}").into_bytes(), vec![writer]);
                engine.commit(commit).wait().unwrap();
                acknowledged += 1;
                longest = longest.max(begun.elapsed());
            }
            (acknowledged, longest)
        };
        let writers: Vec<_> = (0..8).map(|writer| scope.spawn(move || write(writer))).collect();
        let runtime = tokio::runtime::Runtime::new().unwrap();
        let mut killed = 0;
        for _ in 0..3 {
            std::thread::sleep(Duration::from_secs(2));
            let leader = runtime.block_on(leader(&cluster.address, &store.options.stream));
            let Some(leader) = leader else { continue };
            cluster.order("kill", leader);
            killed += 1;
            std::thread::sleep(Duration::from_secs(4));
            cluster.order("start", leader);
        }
        std::thread::sleep(Duration::from_secs(2));
        is_done.store(true, Ordering::Release);
        let written: BTreeMap<usize, _> =
            writers.into_iter().map(|writer| writer.join().unwrap()).enumerate().collect();
        let again = store.open();
        for (writer, (acknowledged, _)) in &written {
            let session = Uuid::from_u128(*writer as u128);
            let entries = again.scan(&key::id(Space::Journal, session), None, usize::MAX).unwrap();
            assert_eq!(entries.len() as u64, *acknowledged, "writer {writer}");
            let names = again.scan(format!("n/{writer}/").as_bytes(), None, usize::MAX).unwrap();
            assert_eq!(names.len() as u64, *acknowledged, "names of writer {writer}");
        }
        same(&engine, &again);
        let total: u64 = written.values().map(|(acknowledged, _)| acknowledged).sum();
        println!("{total} commits acknowledged, {killed} leaders killed");
        (written.values().map(|(_, longest)| *longest).max(), killed)
    });
    println!("longest pause {longest:?}");
    assert!(killed > 0, "no leader was found");
}

/// The number of the server that leads a stream.
async fn leader(address: &str, stream: &str) -> Option<usize> {
    let hosts = address.trim_start_matches("nats://").split(',');
    let servers: Vec<async_nats::ServerAddr> =
        hosts.map(|host| format!("nats://{host}").parse().unwrap()).collect();
    let client = async_nats::connect(servers).await.ok()?;
    let mut stream = async_nats::jetstream::new(client).get_stream(stream).await.ok()?;
    let leader = stream.info().await.ok()?.cluster.as_ref()?.leader.clone()?;
    leader.strip_prefix('n')?.parse().ok()
}

#[test]
fn a_store_that_is_not_shared_has_one_user() {
    let Some(mut store) = store() else { return };
    store.options.is_shared = false;
    let engine = store.open();
    engine.commit(Commit::new().put(b"a".to_vec(), vec![1])).wait().unwrap();
    std::thread::scope(|scope| {
        let second = scope.spawn(|| NatsEngine::open(&store.options).unwrap_err().to_string());
        let error = second.join().unwrap();
        assert!(error.contains("another server uses it"), "{error}");
    });
    engine.commit(Commit::new().put(b"b".to_vec(), vec![1])).wait().unwrap();
    drop(engine);
    assert_eq!(all(&store.open()).len(), 2);
}

#[test]
fn one_server_without_a_cluster_serves_and_a_lost_one_is_named() {
    let Some(mut cluster) = Cluster::start(1) else { return };
    let store = Store::on(&cluster.address);
    let engine = store.open();
    engine.commit(Commit::new().put(b"a".to_vec(), vec![1])).wait().unwrap();
    drop(engine);
    cluster.order("kill", 0);
    let error = NatsEngine::open(&store.options).unwrap_err().to_string();
    assert!(error.contains(&store.options.servers[0]), "{error}");
    cluster.order("start", 0);
    assert_eq!(all(&store.open()), [(b"a".to_vec(), vec![1])]);
}

#[test]
fn snapshots_are_kept_in_an_object_store() {
    let Some(store) = store() else { return };
    let snapshots = Snapshots::open(&store.options).unwrap();
    assert_eq!(snapshots.list().unwrap(), []);
    let folder = tempfile::tempdir().unwrap();
    let (file, copy) = (folder.path().join("file"), folder.path().join("copy"));
    for (name, bytes) in [("b.snapshot", 700_000), ("a.snapshot", 5)] {
        std::fs::write(&file, samples::mesh_file(bytes)).unwrap();
        snapshots.put(name, &file).unwrap();
    }
    let listed = Snapshots::open(&store.options).unwrap().list().unwrap();
    let listed: Vec<_> = listed.iter().map(|one| (one.name.as_str(), one.bytes)).collect();
    assert_eq!(listed, [("a.snapshot", 5), ("b.snapshot", 700_000)]);
    snapshots.get("b.snapshot", std::fs::File::create(&copy).unwrap()).unwrap();
    assert!(std::fs::read(&copy).unwrap() == samples::mesh_file(700_000), "another file");
    snapshots.remove_interrupted("b.snapshot").unwrap();
    // A copy of the bucket that is behind says at first that there is no such object.
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| snapshots.get("late", std::fs::File::create(&copy).unwrap()));
        std::thread::sleep(Duration::from_millis(600));
        snapshots.put("late", &file).unwrap();
        reading.join().unwrap().unwrap();
    });
    assert!(std::fs::read(&copy).unwrap() == samples::mesh_file(5), "another file");
    snapshots.remove("late").unwrap();
    snapshots.remove("b.snapshot").unwrap();
    snapshots.remove("b.snapshot").unwrap();
    let gone = snapshots.get("b.snapshot", std::fs::File::create(&copy).unwrap()).unwrap_err();
    assert!(gone.contains("b.snapshot") && gone.contains(snapshots.bucket()), "{gone}");
    assert_eq!(snapshots.list().unwrap().len(), 1);
}
