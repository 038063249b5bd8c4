//! Tests of large content on a cluster: in objects of a bucket, fetched when read, then removed.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use async_nats::jetstream::Context;
use async_nats::jetstream::object_store::ObjectStore;
use async_nats::jetstream::stream::Stream;
use futures::TryStreamExt;
use palpate_store::catalogue::Manifest;
use palpate_store::database::Database;
use palpate_store::engine::content::FailedFetches;
use palpate_store::engine::{
    Account, Commit, CommitError, Cut, Engine, EngineError, Expected, Found,
};
use palpate_store::fsck::{Checker, check};
use palpate_store::key::{self, Space};
use palpate_store::nats::NatsEngine;
use uuid::Uuid;

use crate::cluster::{Cluster, Store, store};
use crate::engines::{large, law_of_large_content};
use crate::samples::{self, wait};

const OBJECT: Uuid = Uuid::from_u128(21);
/// Time after which a test hangs; usually it takes a tenth.
const HANGS: Duration = Duration::from_secs(300);

fn database(engine: &Arc<NatsEngine>) -> Database {
    Database::with_engine(Arc::<NatsEngine>::clone(engine)).unwrap()
}

/// Makes a file the mesh of an object.
fn put_mesh(database: &Database, upload: u128, bytes: usize) -> Vec<u8> {
    let file = samples::mesh_file(bytes);
    let info = samples::mesh_info(upload, &file);
    wait(database.meshes().put(OBJECT, &info, &file)).unwrap();
    file
}

fn mesh(database: &Database) -> Vec<u8> {
    database.meshes().get(OBJECT).unwrap().unwrap().1
}

/// Publishes a version with a block of this length, and a small one.
fn publish(database: &Database, bytes: usize) -> Manifest {
    let catalogue = samples::catalogue(70);
    wait(database.catalogues().create(&catalogue)).unwrap();
    let draft = samples::draft(&[("surface/20", bytes), ("symmetry/20", 64)]);
    wait(database.catalogues().publish(catalogue.id, draft)).unwrap()
}

/// A store as any client of NATS sees it.
struct Outside {
    context: Context,
    bucket: ObjectStore,
    content: Stream,
    stream: Stream,
}

fn outside<T>(store: &Store, look: impl AsyncFnOnce(Outside) -> T) -> T {
    tokio::runtime::Runtime::new().unwrap().block_on(async {
        let servers: Vec<async_nats::ServerAddr> =
            store.options.servers.iter().map(|server| server.parse().unwrap()).collect();
        let client = async_nats::connect(servers).await.unwrap();
        let context = async_nats::jetstream::new(client);
        let bucket = format!("{}-content", store.options.stream);
        let content = context.get_stream(format!("OBJ_{bucket}")).await.unwrap();
        let stream = context.get_stream(&store.options.stream).await.unwrap();
        let bucket = context.get_object_store(bucket).await.unwrap();
        look(Outside { context, bucket, content, stream }).await
    })
}

/// The names of all objects.
fn names(store: &Store) -> Vec<String> {
    outside(store, async |Outside { bucket, .. }| {
        let listed: Vec<_> = bucket.list().await.unwrap().try_collect().await.unwrap();
        listed.into_iter().map(|object| object.name).collect()
    })
}

/// Bytes of the messages in the stream and in the bucket.
fn stored_bytes(store: &Store) -> (u64, u64) {
    outside(store, async |Outside { mut content, mut stream, .. }| {
        let in_stream = stream.info().await.unwrap().state.bytes;
        (in_stream, content.info().await.unwrap().state.bytes)
    })
}

#[track_caller]
fn expect_failure(outcome: Result<Option<Vec<u8>>, EngineError>, parts: &[&str]) {
    let error = outcome.unwrap_err().to_string();
    assert!(parts.iter().all(|part| error.contains(part)), "{error}");
}

#[test]
fn content_is_in_objects_and_a_start_fetches_none() {
    let Some(store) = store() else { return };
    let engine = Arc::new(store.open());
    let first = database(&engine);
    let file = put_mesh(&first, 31, 3_000_000);
    let version = publish(&first, 900_000);
    let written = engine.content();
    assert!(written.bytes > 3_890_000 && written.n_objects >= 8, "{written:?}");
    let (in_stream, in_bucket) = stored_bytes(&store);
    assert!(in_stream < 60_000 && in_bucket > 3_900_000, "{in_stream} and {in_bucket} bytes");
    assert!(engine.stats().unwrap().bytes > 3_900_000);

    let again = Arc::new(store.open());
    let second = database(&again);
    // What a server checks at its start.
    let (mut checker, mut cut) = (Checker::default(), again.cut().unwrap());
    loop {
        let page = cut.next_here(100).unwrap();
        if page.is_empty() {
            break;
        }
        for (key, found) in page {
            match found {
                Found::Value(value) => checker.pair(&key, &value),
                Found::Elsewhere(length) => checker.elsewhere(&key, length),
            }
        }
    }
    let report = checker.finish();
    assert_eq!((report.n_damaged, report.records["block"]), (0, 2), "{report:?}");
    assert_eq!((again.content().n_fetched, again.content().cached_bytes), (0, 0));
    assert!(again.stats().unwrap().received_bytes < 200_000, "content came with the stream");
    assert_eq!((written.n_put, again.content().n_put), (written.n_objects, 0));
    assert_eq!(again.content().n_objects, written.n_objects);

    let block = &version.blocks[0];
    assert_eq!(second.catalogues().block(block).unwrap(), samples::mesh_file(900_000));
    let of_block = again.content().n_fetched;
    assert!((1..=3).contains(&of_block), "{of_block} objects of a block were fetched");
    assert!(mesh(&second) == file, "another mesh");
    let once = again.content();
    assert_eq!((once.n_fetched, once.fetched_bytes), (written.n_objects, written.bytes));
    assert!(again.stats().unwrap().received_bytes > written.bytes);
    assert!(mesh(&second) == file, "another mesh");
    assert_eq!(again.content().n_fetched, written.n_objects, "later reads are local");
    let n_values = 3_000_000 / 4096;
    assert!(again.content().n_cache_hits >= once.n_cache_hits + n_values, "{once:?}");
    assert_eq!(again.content().failed, FailedFetches::default());
    assert_eq!(check(&*again).unwrap().n_damaged, 0);
}

#[test]
fn concurrent_readers_fetch_an_object_once() {
    let Some(store) = store() else { return };
    let (writer, reader) = (Arc::new(store.open()), Arc::new(store.open()));
    let file = put_mesh(&database(&writer), 31, 1_500_000);
    wait(reader.catch_up()).unwrap();
    let database = database(&reader);
    // Threads of a runtime's tasks, threads apart, and others.
    let runtime = tokio::runtime::Runtime::new().unwrap();
    std::thread::scope(|scope| {
        for number in 0..12 {
            let (database, file, runtime) = (database.clone(), &file, &runtime);
            scope.spawn(move || {
                let read = move || mesh(&database);
                let found = match number % 3 {
                    0 => read(),
                    1 => runtime.block_on(runtime.spawn_blocking(read)).unwrap(),
                    _ => runtime.block_on(runtime.spawn(async move { read() })).unwrap(),
                };
                assert!(&found == file, "another mesh");
            });
        }
    });
    let content = reader.content();
    assert_eq!(content.n_fetched, content.n_objects);
}

#[test]
fn removed_content_leaves_the_bucket_after_a_while() {
    let Some(mut store) = store() else { return };
    store.options.removed_kept = Duration::from_secs(4);
    let engine = Arc::new(store.open());
    let database = database(&engine);
    let before = put_mesh(&database, 31, 600_000);
    let other = store.open();
    let mut early = other.cut().unwrap();
    let mut late = engine.cut().unwrap();
    let old = names(&store);
    let file = put_mesh(&database, 32, 700_000);
    assert_eq!(engine.content().n_objects, names(&store).len() as u64 - old.len() as u64);
    // A cut of another server that was taken before reads what was removed.
    let read = |cut: &mut Box<dyn Cut>| cut.next(usize::MAX).map(|pairs| pairs.len());
    let n_early = read(&mut early).unwrap();
    let found = names(&store);
    assert!(old.iter().all(|name| found.contains(name)), "removed at once");
    let begun = Instant::now();
    // This one's objects stay as long as it is there.
    while engine.compact().is_ok() && begun.elapsed() < Duration::from_secs(6) {}
    let n_late = read(&mut late).unwrap();
    assert!(n_late * 4096 > before.len() && n_late == n_early, "{n_late} pairs");
    drop(late);
    let begun = Instant::now();
    while names(&store).iter().any(|name| old.contains(name)) {
        assert!(begun.elapsed() < HANGS, "it is never removed");
        engine.compact().unwrap();
        std::thread::sleep(Duration::from_millis(200));
    }
    assert!(mesh(&database) == file, "another mesh");
    wait(database.remove_object(OBJECT)).unwrap();
    assert_eq!((engine.content().n_objects, engine.content().bytes), (0, 0));
    let begun = Instant::now();
    while !names(&store).is_empty() {
        assert!(begun.elapsed() < HANGS, "it is never removed");
        std::thread::sleep(Duration::from_millis(200));
    }
    let (_, in_bucket) = stored_bytes(&store);
    assert_eq!(in_bucket, 0, "nothing is left of a removed object");
    let all = engine.content();
    assert_eq!((all.n_removed, all.n_leftovers), (all.n_put, 0));
}

#[test]
fn what_a_crash_leaves_is_swept() {
    let Some(mut store) = store() else { return };
    store.options.removed_kept = Duration::from_secs(2);
    let engine = Arc::new(store.open());
    let database = database(&engine);
    let file = put_mesh(&database, 31, 100_000);
    let stray = format!("b.{}.{}.0", "ab".repeat(32), Uuid::now_v7().simple());
    // An object without a message, another's object, and content without a name.
    let put = async |Outside { context, bucket, content, .. }: Outside| {
        for name in [&stray[..], "report.pdf"] {
            bucket.put(name, &mut &[7; 30_000][..]).await.unwrap();
        }
        let subject = content.cached_info().config.subjects[0].replace('>', "interrupted");
        let publish = context.publish(subject.clone(), vec![7; 999].into());
        publish.await.unwrap().await.unwrap();
        subject
    };
    let nameless = outside(&store, put);
    engine.compact().unwrap();
    assert!(names(&store).contains(&stray), "it may belong to a commit under way");
    std::thread::sleep(Duration::from_millis(2200));
    engine.compact().unwrap();
    let left = names(&store);
    assert!(!left.contains(&stray) && left.contains(&"report.pdf".to_owned()), "{left:?}");
    let chunks = outside(&store, async |Outside { content, .. }| {
        content.get_last_raw_message_by_subject(&nameless).await.is_ok()
    });
    assert!(!chunks, "content without a name is left");
    assert_eq!((engine.content().n_leftovers, engine.content().n_removed), (2, 0));
    assert!(mesh(&database) == file, "another mesh");
    assert_eq!(engine.content().n_missing, 0);
}

#[test]
fn missing_and_damaged_objects_are_named() {
    let Some(store) = store() else { return };
    let engine = Arc::new(store.open());
    let version = publish(&database(&engine), 100_000);
    let name = names(&store).remove(0);
    let head = key::hash(Space::Block, &version.blocks[0].hash);
    outside(&store, async |Outside { bucket, .. }| {
        bucket.put(&name[..], &mut &[7; 30_000][..]).await.unwrap();
    });
    let reader = store.open();
    expect_failure(reader.get(&head), &[&name, "is damaged", "30000 bytes"]);
    outside(&store, async |Outside { bucket, .. }| bucket.delete(&name).await.unwrap());
    expect_failure(reader.get(&head), &[&name, "is missing in", &store.options.stream]);
    assert_eq!(reader.content().n_missing, 0, "nobody has compared");
    reader.compact().unwrap();
    assert_eq!(reader.content().n_missing, 1);
    let failed = FailedFetches { missing: 1, damaged: 1, ..FailedFetches::default() };
    assert_eq!((reader.content().failed, reader.content().n_fetched), (failed, 0));
    // The same content published again is another object.
    let database = database(&engine);
    let draft = samples::draft(&[("surface/20", 100_000)]);
    let catalogue = Uuid::from_u128(70);
    let again = wait(database.catalogues().publish(catalogue, draft)).unwrap();
    assert_eq!(again.blocks[0].hash, version.blocks[0].hash);
    wait(reader.catch_up()).unwrap();
    assert!(reader.get(&head).unwrap().is_some());
}

#[test]
fn rewritten_units_keep_their_objects() {
    let Some(store) = store() else { return };
    let engine = store.open();
    let (head, first) = large(5, 40);
    engine.commit(first).wait().unwrap();
    let before = names(&store);
    // Small pieces stay in the stream, and the unit is written as a whole meanwhile.
    for number in 100..140 {
        let piece = key::piece(&head, number);
        engine.commit(Commit::new().put(piece, vec![number as u8; 3000])).wait().unwrap();
    }
    for number in 100..140 {
        engine.commit(Commit::new().remove(key::piece(&head, number))).wait().unwrap();
    }
    engine.compact().unwrap();
    assert_eq!(names(&store), before, "content was put again");
    let (in_stream, _) = stored_bytes(&store);
    assert!(in_stream < 25_000, "{in_stream} bytes in the stream");
    assert_eq!(engine.content().n_fetched, 0, "a compaction reads no content");
    let again = store.open();
    assert_eq!(again.scan(&head, None, 99).unwrap().len(), 40);
    assert_eq!(again.stats().unwrap().live_bytes, engine.stats().unwrap().live_bytes);
}

#[test]
fn content_counts_to_its_key_and_to_its_quota() {
    let Some(store) = store() else { return };
    let engine = store.open();
    let (key, upload) = (Uuid::from_u128(9), Uuid::from_u128(31));
    let head = key::nested(Space::MeshFile, OBJECT, upload);
    let account = Some(Account { key, quota: Some(100_000) });
    let commit = |pieces: std::ops::Range<u32>| {
        let commit = pieces.fold(Commit::new(), |commit, piece| {
            commit.put(key::piece(&head, piece), vec![7; 4096])
        });
        Commit { account, ..commit }
    };
    engine.commit(commit(0..20)).wait().unwrap();
    let each = (head.len() + 4 + 4096) as u64;
    assert_eq!(engine.held()[&key], 20 * each);
    engine.commit(commit(0..20)).wait().unwrap();
    assert_eq!(engine.held()[&key], 20 * each, "the same keys once more");
    let refused = engine.commit(commit(20..30)).wait().unwrap_err();
    let CommitError::Engine(EngineError::OverQuota { held, more, .. }) = refused else {
        panic!("{refused}")
    };
    assert_eq!((held, more), (20 * each, 10 * each));
    assert_eq!(engine.stats().unwrap().live_bytes, store.open().stats().unwrap().live_bytes);
    assert_eq!(engine.content().n_fetched, 0, "lengths are known without content");
}

#[test]
fn the_law_of_large_content_holds_on_a_new_reader() {
    let Some(store) = store() else { return };
    law_of_large_content(&store.open());
    let (writer, reader) = (store.open(), store.open());
    let (head, commit) = large(9, 20);
    writer.commit(commit).wait().unwrap();
    wait(reader.catch_up()).unwrap();
    // The expectation of a commit is content that this process has not read.
    let expected = writer.get(&key::piece(&head, 3)).unwrap().unwrap();
    let change = Commit::new().expect(key::piece(&head, 3), Expected::Value(expected));
    reader.commit(change.put(b"n/1".to_vec(), vec![1])).wait().unwrap();
    let wrong = Commit::new().expect(key::piece(&head, 4), Expected::Value(vec![0]));
    let wrong = reader.commit(wrong.put(b"n/2".to_vec(), vec![1])).wait();
    assert_eq!(wrong, Err(CommitError::Conflict { expectation: 0 }));
}

#[test]
fn killed_leaders_lose_no_content_and_a_lost_cluster_is_told() {
    let Some(mut cluster) = Cluster::start(3) else { return };
    let store = Store::on(&cluster.address);
    let engine = Arc::new(store.open());
    let is_done = AtomicBool::new(false);
    let written = std::thread::scope(|scope| {
        let write = |writer: u64| {
            let mut acknowledged = 0;
            while !is_done.load(Ordering::Acquire) {
                engine.commit(large(1000 * writer + acknowledged, 100).1).wait().unwrap();
                acknowledged += 1;
            }
            acknowledged
        };
        let writers: Vec<_> = (0..3).map(|writer| scope.spawn(move || write(writer))).collect();
        for server in [0, 1, 2] {
            std::thread::sleep(Duration::from_secs(2));
            cluster.order("kill", server);
            std::thread::sleep(Duration::from_secs(3));
            cluster.order("start", server);
        }
        std::thread::sleep(Duration::from_secs(1));
        is_done.store(true, Ordering::Release);
        writers.into_iter().map(|writer| writer.join().unwrap()).collect::<Vec<u64>>()
    });
    println!("{written:?} blocks of 400 KB acknowledged");
    let again = store.open();
    for (writer, acknowledged) in (0..).zip(&written) {
        for number in 0..*acknowledged {
            let (head, commit) = large(1000 * writer + number, 100);
            let found = again.scan(&head, None, 200).unwrap();
            let expected = commit.writes.into_iter().map(|(key, value)| (key, value.unwrap()));
            assert!(found == expected.collect::<Vec<_>>(), "block {number} of {writer}");
        }
    }
    assert!(written.iter().all(|acknowledged| *acknowledged > 0));
    let last = store.open();
    for server in [0, 1, 2] {
        cluster.order("kill", server);
    }
    let begun = Instant::now();
    expect_failure(last.get(&large(0, 1).0), &["reading large content", "-content"]);
    assert!(begun.elapsed() < HANGS, "{:?}", begun.elapsed());
    let read_before = again.get(&large(1000 * 2, 1).0);
    assert!(read_before.unwrap().is_some(), "what was fetched is there without the cluster");
}
