//! Tests of what servers that share a store rely on: leases, news, one audit log, and quotas of
//! stored bytes in total.
//!
//! `golden/audit_heads_v1.txt` has the record of an audit log's last number; it never changes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use futures::FutureExt;
use palpate_store::access::Role;
use palpate_store::audit::{AuditEntry, AuditLog, RingSizes};
use palpate_store::database::Database;
use palpate_store::engine::news::{Changed, Since};
use palpate_store::engine::{
    Account, Commit, CommitError, Compacted, Cut, Engine, EngineError, EngineStats, Pair, Pending,
};
use palpate_store::key::{self, Space};
use palpate_store::memory::MemoryEngine;
use palpate_store::nats::NatsEngine;
use uuid::Uuid;

use crate::bytes::unhex;
use crate::cluster::store;
use crate::samples::{self, wait};

const GOLDEN: &str = include_str!("golden/audit_heads_v1.txt");
const SIZES: RingSizes = RingSizes { changes: 1000, refused: 1000, strangers: 1000 };

/// An engine that several servers share, in memory.
struct Crowded(MemoryEngine);

impl Engine for Crowded {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, EngineError> {
        self.0.get(key)
    }

    fn scan(
        &self,
        prefix: &[u8],
        after: Option<&[u8]>,
        n: usize,
    ) -> Result<Vec<Pair>, EngineError> {
        self.0.scan(prefix, after, n)
    }

    fn commit(&self, commit: Commit) -> Pending {
        self.0.commit(commit)
    }

    fn is_shared(&self) -> bool {
        true
    }

    fn held(&self) -> BTreeMap<Uuid, u64> {
        self.0.held()
    }

    fn cut(&self) -> Result<Box<dyn Cut>, EngineError> {
        self.0.cut()
    }

    fn compact(&self) -> Result<Compacted, EngineError> {
        self.0.compact()
    }

    fn stats(&self) -> Result<EngineStats, EngineError> {
        self.0.stats()
    }
}

/// Time after which a test hangs; a server on a cluster usually hears of everything within a second.
const FOLLOWED_WITHIN: Duration = Duration::from_secs(180);

fn entry(at_ms: u64, server: usize, status: Option<u16>) -> AuditEntry {
    AuditEntry {
        seq: 0,
        at_ms,
        key: Some((Uuid::from_u128(80), format!("key-{server}"))),
        role: Some(Role::Admin),
        address: "127.0.0.1".to_owned(),
        operation: "create_session".to_owned(),
        resource: "/v1/sessions".to_owned(),
        status,
        request_id: format!("{server}/{at_ms}"),
        n_left_out: 0,
        n: 1,
        last_at_ms: 0,
    }
}

fn log(engine: Arc<dyn Engine>) -> AuditLog {
    Database::with_engine(engine).unwrap().audit(SIZES, |_| false).unwrap()
}

/// Writes entries to two logs of one store from several threads: all of them must have numbers of
/// their own, in the order of their times.
fn write_together(logs: &[AuditLog; 2]) {
    let (each, writers) = (15, 3);
    let write = |server: usize, writer: usize| {
        for number in 0..each {
            let at_ms = (1000 * writer + number) as u64;
            if number % 3 == 0 {
                wait(logs[server].add(entry(at_ms, server, Some(403)))).unwrap();
                continue;
            }
            let begun = wait(logs[server].begin(entry(at_ms, server, None))).unwrap();
            let settled = AuditEntry { status: Some(201), ..begun };
            wait(logs[server].settle(&settled)).unwrap();
        }
    };
    std::thread::scope(|scope| {
        for (server, writer) in (0..2).flat_map(|server| (0..writers).map(move |it| (server, it))) {
            scope.spawn(move || write(server, writer));
        }
    });
    let n_entries = 2 * writers * each;
    let shown = || {
        logs.each_ref().map(|log| {
            log.heard_all().unwrap();
            log.before(None, 1000).unwrap()
        })
    };
    // A server on a cluster follows what the other one wrote.
    let (mut found, begun) = (shown(), Instant::now());
    while found[0] != found[1] && begun.elapsed() < FOLLOWED_WITHIN {
        std::thread::sleep(Duration::from_millis(10));
        found = shown();
    }
    assert_eq!(found[0], found[1], "the servers show other logs");
    let numbers: Vec<u64> = found[0].iter().rev().map(|entry| entry.seq).collect();
    assert_eq!(numbers, (1..=n_entries as u64).collect::<Vec<_>>(), "one number for each");
    let requests: BTreeSet<_> = found[0].iter().map(|entry| &entry.request_id).collect();
    assert_eq!(requests.len(), n_entries);
    assert!(found[0].windows(2).all(|pair| pair[0].at_ms >= pair[1].at_ms), "times decrease");
    assert!(found[0].iter().all(|entry| entry.status.is_some()), "an outcome is missing");
}

#[test]
fn two_servers_write_one_audit_log() {
    let engine: Arc<dyn Engine> = Arc::new(Crowded(MemoryEngine::new()));
    write_together(&[log(Arc::clone(&engine)), log(Arc::clone(&engine))]);
    // The next server goes on where they ended.
    let next = log(engine);
    assert_eq!(wait(next.begin(entry(0, 3, None))).unwrap().seq, 91);
}

#[test]
fn two_servers_on_a_cluster_write_one_audit_log() {
    let Some(store) = store() else { return };
    let engines = [store.open(), store.open()].map(Arc::new);
    let logs = engines.each_ref().map(|engine| log(Arc::<NatsEngine>::clone(engine)));
    write_together(&logs);
}

#[test]
fn the_last_number_of_the_audit_log_is_frozen() {
    let engine: Arc<dyn Engine> = Arc::new(Crowded(MemoryEngine::new()));
    let log = log(Arc::clone(&engine));
    wait(log.add(entry(1_700_000_000_001, 1, Some(403)))).unwrap();
    let (name, bytes) = GOLDEN.trim_end().split_once(' ').unwrap();
    assert_eq!(unhex(name), key::space(Space::AuditHead));
    assert_eq!(engine.get(&unhex(name)).unwrap(), Some(unhex(bytes)));
}

#[test]
fn one_server_at_a_time_has_a_lease() {
    let Some(store) = store() else { return };
    let engines = [store.open(), store.open()];
    let first = wait(engines[0].lease("keys")).unwrap().unwrap();
    assert!(!first.is_lost());
    assert!(wait(engines[1].lease("keys")).unwrap().is_none());
    let other = wait(engines[1].lease("webhooks")).unwrap();
    assert!(other.is_some(), "another right is free");
    drop(first);
    let begun = Instant::now();
    while wait(engines[1].lease("keys")).unwrap().is_none() {
        assert!(begun.elapsed() < FOLLOWED_WITHIN, "it was not given back");
        std::thread::yield_now();
    }
}

#[test]
fn a_lease_is_renewed_while_it_is_held() {
    let Some(store) = store() else { return };
    let engines = [store.open(), store.open()];
    let lease = wait(engines[0].lease("training")).unwrap().unwrap();
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(24) {
        assert!(wait(engines[1].lease("training")).unwrap().is_none());
        assert!(!lease.is_lost());
        std::thread::sleep(Duration::from_millis(500));
    }
    // A process that ends without a word keeps others waiting for twenty seconds.
    std::mem::forget(lease);
    let [first, second] = engines;
    drop(first);
    let begun = Instant::now();
    while wait(second.lease("training")).unwrap().is_none() {
        assert!(begun.elapsed() < FOLLOWED_WITHIN, "it does not expire");
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn a_server_hears_what_another_one_changed() {
    let Some(store) = store() else { return };
    let [here, there] = [store.open(), store.open()].map(Arc::new);
    let [mine, theirs] = [&here, &there]
        .map(|engine| Database::with_engine(Arc::<NatsEngine>::clone(engine)).unwrap());
    let news = mine.news();
    wait(theirs.jobs().create(&samples::job(7))).unwrap();
    wait(theirs.jobs().remove(Uuid::from_u128(7))).unwrap();
    wait(mine.sensors().create(&samples::sensor(8))).unwrap();
    wait(mine.catch_up()).unwrap();
    let told = wait(news.next());
    assert_eq!(told, Since::These([Changed::Id(b'j', Uuid::from_u128(7))].into()));
    assert_eq!(news.next().now_or_never(), None, "its own changes are none");
}

#[test]
fn a_quota_holds_over_all_servers() {
    let Some(store) = store() else { return };
    let engines = [store.open(), store.open()];
    let (key, quota) = (Uuid::from_u128(9), 1_000_000);
    let write = |server: usize, writer: u128| {
        for number in 0.. {
            let session = Uuid::from_u128(1000 * server as u128 + writer);
            let head = key::numbered(Space::Journal, session, number);
            let commit = Commit::new().put(head, vec![1; 4000]);
            let account = Some(Account { key, quota: Some(quota) });
            match engines[server].commit(Commit { account, ..commit }).wait() {
                Ok(()) => {}
                Err(CommitError::Engine(EngineError::OverQuota { .. })) => return,
                Err(error) => panic!("{error}"),
            }
        }
    };
    std::thread::scope(|scope| {
        for (server, writer) in (0..2).flat_map(|server| (0..4).map(move |it| (server, it))) {
            scope.spawn(move || write(server, writer));
        }
    });
    for engine in &engines {
        wait(engine.catch_up()).unwrap();
        let held = engine.held()[&key];
        assert!(held <= quota, "{held} bytes are more than {quota}");
        assert!(held > quota - 5000, "{held} bytes: another record would have fitted");
    }
}
