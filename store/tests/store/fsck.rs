//! Tests of `fsck`: it reports damage and leftovers, and nothing else.

use std::sync::Arc;

use palpate_store::database::Database;
use palpate_store::engine::{Commit, Engine};
use palpate_store::fsck::{CollectError, Report, Severity, check, collect};
use palpate_store::journal::{Event, NewEntry};
use palpate_store::key::{self, Space};
use palpate_store::memory::MemoryEngine;
use uuid::Uuid;

use crate::samples;

fn filled() -> Arc<dyn Engine> {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    samples::fill(&Database::with_engine(Arc::clone(&engine)).unwrap());
    engine
}

fn damages(report: &Report) -> Vec<String> {
    let damaged = report.findings.iter().filter(|found| found.severity == Severity::Damage);
    damaged.map(|found| format!("{} {}: {}", found.space, found.key, found.fault)).collect()
}

fn write(engine: &dyn Engine, key: &[u8], value: Option<Vec<u8>>) {
    let commit = match value {
        Some(value) => Commit::new().put(key.to_vec(), value),
        None => Commit::new().remove(key.to_vec()),
    };
    engine.commit(commit).wait().unwrap();
}

#[test]
fn an_undamaged_database_has_no_findings() {
    let report = check(&*filled()).unwrap();
    assert_eq!((report.n_damaged, report.n_leftovers), (0, 0), "{report:?}");
    assert_eq!(report.layout, Some(palpate_store::database::LAYOUT));
    assert_eq!((report.records["journal entry"], report.records["block"]), (2, 2));
}

#[test]
fn flipped_bytes_and_missing_values_are_reported() {
    let engine = filled();
    for (key, value) in engine.scan(b"", None, 1000).unwrap() {
        let mut flipped = value.clone();
        flipped[value.len() / 2] ^= 4;
        for damaged in [Some(flipped), Some(value[..value.len() - 1].to_vec()), None] {
            let is_missing = damaged.is_none();
            write(&*engine, &key, damaged);
            let report = check(&*engine).unwrap();
            // A missing robot's number leaves no trace except in the sum of all records, nor
            // does an unnamed job or calibration.
            let leaves_trace = !matches!(key[0], b'w' | b'u' | b'j' | b'k');
            let found = report.n_damaged + report.n_leftovers;
            assert!(found > 0 || (is_missing && !leaves_trace) || key == b"!", "{key:02x?}");
        }
        write(&*engine, &key, Some(value));
    }
}

#[test]
fn a_missing_piece_damages_its_block_and_version() {
    let engine = filled();
    let pieces = engine.scan(b"b", None, 100).unwrap();
    let (piece, _) = pieces.iter().find(|(key, _)| key.len() == 37).unwrap();
    write(&*engine, piece, None);
    let report = check(&*engine).unwrap();
    let words = damages(&report).join("\n");
    assert!(words.contains("piece 1 is missing"), "{words}");
    assert!(words.contains("version"), "{words}");
    let [(catalogue, 1, reason)] = &report.damaged_versions[..] else { panic!("{report:?}") };
    assert_eq!(*catalogue, Uuid::from_u128(70));
    assert!(reason.contains("damaged") || reason.contains("missing"), "{reason}");
    let refused = samples::wait(collect(&*engine, &report));
    assert!(matches!(refused, Err(CollectError::Damaged { .. })));
}

#[test]
fn a_journal_without_its_last_entry_is_reported() {
    let engine = filled();
    let entries = engine.scan(b"r", None, 100).unwrap();
    write(&*engine, &entries.last().unwrap().0, None);
    let words = damages(&check(&*engine).unwrap());
    let owner = Uuid::from_u128(50);
    assert_eq!(words, [format!("journal entry {owner} entry 1: it is missing, of 2")]);
}

#[test]
fn a_retraction_without_its_record_is_reported() {
    let engine = filled();
    let journal = Database::with_engine(Arc::clone(&engine)).unwrap().journal();
    let owner = Uuid::from_u128(50);
    let event = Event::Retraction { seq: 0 };
    let entry = NewEntry { reading_id: None, received_at_ms: 1, event, written_by: None };
    samples::wait(journal.append(owner, 2, &[entry])).unwrap();
    assert_eq!(damages(&check(&*engine).unwrap()), [""; 0]);
    write(&*engine, &key::numbered(Space::JournalRetraction, owner, 0), None);
    let named = damages(&check(&*engine).unwrap());
    assert!(named.len() == 1 && named[0].contains("retraction"), "{named:?}");
}

#[test]
fn only_leftovers_of_crashes_are_removed() {
    let engine = filled();
    let before = engine.scan(b"", None, 1000).unwrap();
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    samples::wait(async {
        // A training killed after its blocks; a removal after its record; an upload.
        let draft = samples::draft(&[("stray", 9000)]);
        let stray = samples::catalogue(71);
        database.catalogues().create(&stray).await.unwrap();
        database.catalogues().publish(stray.id, draft).await.unwrap();
        let entries = [samples::entry("b", 1), samples::entry("b", 2)];
        database.journal().append(Uuid::from_u128(51), 0, &entries).await.unwrap();
    });
    let stray = Uuid::from_u128(71);
    for (key, _) in engine.scan(b"", None, 1000).unwrap() {
        let is_its = key.len() >= 17 && key[1..17] == *stray.as_bytes();
        if is_its || key.starts_with(b"nccatalogue-71") {
            write(&*engine, &key, None);
        }
    }
    let piece = [b"f".as_slice(), &[5; 32], &[0, 0, 0, 1]].concat();
    write(&*engine, &piece, Some(vec![1; 100]));
    let report = check(&*engine).unwrap();
    assert_eq!(report.n_damaged, 0, "{:?}", damages(&report));
    assert!(report.n_leftovers >= 3, "{report:?}");
    samples::wait(collect(&*engine, &report)).unwrap();
    let mut left = engine.scan(b"", None, 1000).unwrap();
    // Robots' numbers of a removed session are not referenced.
    left.retain(|(key, _)| key[0] != b'w' || key[1..17] != *Uuid::from_u128(51).as_bytes());
    assert_eq!(left, before);
}

#[test]
fn a_list_continues_after_a_damaged_item() {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    let objects = database.objects();
    for id in [20, 21, 22] {
        samples::wait(objects.create(&samples::object(id))).unwrap();
    }
    let keys = engine.scan(b"o", None, 10).unwrap();
    write(&*engine, &keys[1].0, Some(vec![0; 40]));
    let ids = |items: &[palpate_store::entity::Object]| {
        items.iter().map(|object| object.id.as_u128()).collect::<Vec<_>>()
    };
    let page = objects.list_whole(None, 10).unwrap();
    assert_eq!((ids(&page.items), page.next), (vec![20, 22], None));
    let first = objects.list_whole(None, 2).unwrap();
    assert_eq!((ids(&first.items), first.next), (vec![20], Some(Uuid::from_u128(21))));
    let second = objects.list_whole(first.next, 2).unwrap();
    assert_eq!((ids(&second.items), second.next), (vec![22], None));
    assert!(objects.get(Uuid::from_u128(21)).is_err());
}

/// A check that reads no pieces of blocks and meshes.
fn check_without_content(engine: &dyn Engine) -> Report {
    let mut checker = palpate_store::fsck::Checker::default();
    for (key, value) in engine.scan(b"", None, usize::MAX).unwrap() {
        match key[0] {
            b'b' | b'f' => checker.elsewhere(&key, value.len()),
            _ => checker.pair(&key, &value),
        }
    }
    checker.finish()
}

#[test]
fn content_that_is_not_read_must_be_there() {
    let engine = filled();
    let whole = check_without_content(&*engine);
    assert_eq!((whole.n_damaged, whole.n_leftovers), (0, 0), "{whole:?}");
    assert_eq!(whole.records, check(&*engine).unwrap().records);
    let content = engine.scan(b"", None, usize::MAX).unwrap().into_iter();
    for (key, value) in content.filter(|(key, _)| matches!(key[0], b'b' | b'f')) {
        for damaged in [Some(value[1..].to_vec()), None] {
            write(&*engine, &key, damaged);
            let report = check_without_content(&*engine);
            assert!(report.n_damaged > 0, "{key:02x?}");
        }
        write(&*engine, &key, Some(value));
    }
}
