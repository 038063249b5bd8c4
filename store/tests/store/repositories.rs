//! Tests of the repositories' guarantees, on both engines.

use std::sync::Arc;

use palpate_store::catalogue::Switch;
use palpate_store::database::Database;
use palpate_store::entity::{Object, ReadingId, StoredReading};
use palpate_store::error::StoreError;
use palpate_store::journal::{AppendError, Event, NewEntry};
use tempfile::TempDir;
use uuid::Uuid;

use crate::samples::{self, catalogue, draft, entry, mesh_file, mesh_info, object, wait};

fn check(law: impl Fn(&Database)) {
    law(&Database::in_memory());
    let folder = TempDir::new().unwrap();
    law(&Database::with_engine(Arc::new(crate::engines::open(&folder))).unwrap());
}

#[test]
fn one_item_of_every_kind_reads_back() {
    check(|database| {
        samples::fill(database);
        assert_eq!(samples::read_all(database), Ok(()));
    });
}

#[test]
fn names_are_unique_and_follow_renaming() {
    check(|database| {
        let objects = database.objects();
        wait(objects.create(&object(1))).unwrap();
        assert!(matches!(wait(objects.create(&object(1))), Err(StoreError::Exists { .. })));
        let twin = Object { id: Uuid::from_u128(2), ..object(1) };
        assert!(matches!(wait(objects.create(&twin)), Err(StoreError::NameTaken { .. })));
        assert_eq!(objects.find(twin.id).unwrap(), None);

        let rename = |object: &mut Object| {
            object.name = "renamed".to_owned();
            Ok::<(), ()>(())
        };
        wait(objects.update(Uuid::from_u128(1), rename)).unwrap().unwrap();
        assert_eq!(objects.find_by_name("object-1").unwrap(), None);
        assert_eq!(objects.find_by_name("renamed").unwrap().unwrap().id, Uuid::from_u128(1));
        wait(objects.create(&twin)).unwrap();
        let error = wait(objects.update(twin.id, rename)).unwrap_err();
        assert!(matches!(error, StoreError::NameTaken { .. }));

        assert!(wait(objects.remove(twin.id)).unwrap());
        assert!(!wait(objects.remove(twin.id)).unwrap());
        assert_eq!(objects.find_by_name("object-1").unwrap(), None);
        assert_eq!(objects.find_by_name(&"x".repeat(9000)).unwrap(), None);
    });
}

#[test]
fn a_sensor_and_an_object_may_share_a_name() {
    check(|database| {
        let mut sensor = samples::sensor(1);
        sensor.name = "object-1".to_owned();
        wait(database.sensors().create(&sensor)).unwrap();
        wait(database.objects().create(&object(1))).unwrap();
    });
}

#[test]
fn concurrent_updates_lose_nothing() {
    check(|database| {
        let objects = database.objects();
        wait(objects.create(&object(1))).unwrap();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..25 {
                        let count = |object: &mut Object| {
                            object.revision += 1;
                            Ok::<(), ()>(())
                        };
                        wait(objects.update(Uuid::from_u128(1), count)).unwrap().unwrap();
                    }
                });
            }
        });
        assert_eq!(objects.get(Uuid::from_u128(1)).unwrap().revision, 3 + 100);
    });
}

#[test]
fn a_refused_update_changes_nothing() {
    check(|database| {
        let jobs = database.jobs();
        wait(jobs.create(&samples::job(1))).unwrap();
        let refused = wait(jobs.update(Uuid::from_u128(1), |job| {
            job.done = 1000;
            Err("finished already")
        }));
        assert_eq!(refused, Ok(Err("finished already")));
        assert_eq!(jobs.get(Uuid::from_u128(1)).unwrap(), samples::job(1));
    });
}

#[test]
fn a_record_may_grow_to_many_pieces_and_shrink() {
    check(|database| {
        let objects = database.objects();
        for id in 1..=3 {
            wait(objects.create(&object(id))).unwrap();
        }
        for length in [10, 30_000, 4_000, 9_000, 0] {
            let describe = |object: &mut Object| {
                object.description = "é".repeat(length);
                Ok::<(), ()>(())
            };
            wait(objects.update(Uuid::from_u128(2), describe)).unwrap().unwrap();
            let all = objects.all().unwrap();
            assert_eq!(all.len(), 3);
            assert_eq!(all[1].description, "é".repeat(length));
        }
        assert!(wait(objects.remove(Uuid::from_u128(2))).unwrap());
        assert_eq!(objects.all().unwrap(), [object(1), object(3)]);
    });
}

#[test]
fn pages_follow_each_other_without_gaps() {
    check(|database| {
        let objects = database.objects();
        for id in 1..=50 {
            let mut object = object(id);
            object.description = "x".repeat(if id % 7 == 0 { 9_000 } else { 10 });
            wait(objects.create(&object)).unwrap();
        }
        let (mut after, mut seen) = (None, Vec::new());
        loop {
            let page = objects.list(after, 7).unwrap();
            assert!(page.items.len() <= 7);
            seen.extend(page.items.iter().map(|object| object.id.as_u128()));
            after = page.next;
            if after.is_none() {
                break;
            }
        }
        assert_eq!(seen, (1..=50).collect::<Vec<_>>());
        assert_eq!(objects.list(None, 50).unwrap().next, None);
    });
}

#[test]
fn a_journal_accepts_the_expected_append_and_refuses_others() {
    check(|database| {
        let (journal, owner) = (database.journal(), Uuid::from_u128(1));
        wait(journal.append(owner, 0, &[entry("a", 1), entry("a", 2)])).unwrap();
        let late = wait(journal.append(owner, 0, &[entry("b", 1)]));
        assert_eq!(late, Err(AppendError::Sequence { expected: 0, found: 2 }));
        let early = wait(journal.append(owner, 3, &[entry("b", 1)]));
        assert_eq!(early, Err(AppendError::Sequence { expected: 3, found: 2 }));
        assert_eq!(wait(journal.append(owner, 2, &[entry("b", 1)])), Ok(()));
        let robots: Vec<_> = journal
            .entries(owner, 1, 10)
            .unwrap()
            .into_iter()
            .map(|e| (e.seq, e.reading_id))
            .collect();
        let id = |robot: &str, seq| Some(ReadingId { robot: robot.to_owned(), seq });
        assert_eq!(robots, [(1, id("a", 2)), (2, id("b", 1))]);
        assert_eq!(journal.len(owner), Ok(3));
        assert_eq!(journal.len(Uuid::from_u128(2)), Ok(0));
        assert_eq!(journal.entries(owner, 9, 10).unwrap(), []);
    });
}

#[test]
fn a_repeated_reading_is_found_and_stored_once() {
    check(|database| {
        let (journal, owner) = (database.journal(), Uuid::from_u128(1));
        wait(journal.append(owner, 0, &[entry("a", 7)])).unwrap();
        let again = wait(journal.append(owner, 1, &[entry("b", 1), entry("a", 7)]));
        let repeated = AppendError::Repeated { robot: "a".to_owned(), seq: 7, at: 0 };
        assert_eq!(again, Err(repeated));
        let twice = wait(journal.append(owner, 1, &[entry("c", 1), entry("c", 1)]));
        assert!(matches!(twice, Err(AppendError::Repeated { at: 1, .. })), "{twice:?}");
        assert_eq!(journal.len(owner), Ok(1));
        let find =
            |robot: &str, seq| journal.find(owner, &ReadingId { robot: robot.into(), seq }, None);
        assert_eq!(find("a", 7), Ok(Some(0)));
        assert_eq!(find("b", 1), Ok(None));
        let long = wait(journal.append(owner, 1, &[entry(&"r".repeat(65), 1)]));
        assert_eq!(long, Err(AppendError::RobotLength { found: 65 }));
        let stored = journal.entry(owner, 0).unwrap().unwrap();
        assert_eq!(stored.event, entry("a", 7).event);
    });
}

#[test]
fn readings_of_large_sensors_and_other_events_are_kept() {
    check(|database| {
        let (journal, owner) = (database.journal(), Uuid::from_u128(1));
        let large = Event::Reading(samples::reading(128 * 128));
        let events = [large, Event::Retraction { seq: 0 }, Event::Closed];
        let entries = events.clone().map(|event| NewEntry {
            reading_id: None,
            received_at_ms: 1,
            event,
            written_by: None,
        });
        wait(journal.append(owner, 0, &entries)).unwrap();
        let found = journal.entries(owner, 0, 10).unwrap();
        assert_eq!(found.into_iter().map(|entry| entry.event).collect::<Vec<_>>(), events);
        wait(journal.remove(owner)).unwrap();
        assert_eq!(journal.len(owner), Ok(0));
    });
}

#[test]
fn an_entry_is_withdrawn_once() {
    check(|database| {
        let (journal, owner) = (database.journal(), Uuid::from_u128(1));
        let retraction = |seq| NewEntry {
            reading_id: None,
            written_by: None,
            received_at_ms: 1,
            event: Event::Retraction { seq },
        };
        wait(journal.append(owner, 0, &[entry("a", 1), entry("a", 2), entry("b", 1)])).unwrap();
        assert_eq!(journal.retraction(owner, 1), Ok(None));
        wait(journal.append(owner, 3, &[retraction(1)])).unwrap();
        let again = wait(journal.append(owner, 4, &[retraction(0), retraction(1)]));
        assert_eq!(again, Err(AppendError::Retracted { seq: 1, at: 3 }));
        let twice = wait(journal.append(owner, 4, &[retraction(2), retraction(2)]));
        assert_eq!(twice, Err(AppendError::Retracted { seq: 2, at: 4 }));
        assert_eq!(journal.len(owner), Ok(4), "all or none");
        wait(journal.append(owner, 4, &[entry("c", 1), retraction(0)])).unwrap();
        assert_eq!(journal.retraction(owner, 0), Ok(Some(5)));
        let all: Vec<_> = journal.retractions(owner).unwrap().into_iter().collect();
        assert_eq!(all, [(0, 5), (1, 3)]);
        wait(journal.remove(owner)).unwrap();
        assert_eq!(journal.retractions(owner).unwrap().len(), 0);
    });
}

#[test]
fn concurrent_writers_of_a_journal_leave_no_gap() {
    check(|database| {
        let (journal, owner) = (database.training(), Uuid::from_u128(1));
        std::thread::scope(|scope| {
            for robot in ["a", "b", "c", "d"] {
                let journal = &journal;
                scope.spawn(move || {
                    for seq in 0..20 {
                        let entries = [entry(robot, seq)];
                        let next = || journal.append(owner, journal.len(owner).unwrap(), &entries);
                        while matches!(wait(next()), Err(AppendError::Sequence { .. })) {}
                    }
                });
            }
        });
        assert_eq!(journal.entries(owner, 0, 100).unwrap().len(), 80);
    });
}

#[test]
fn a_mesh_is_replaced_as_a_whole() {
    check(|database| {
        let (meshes, object) = (database.meshes(), Uuid::from_u128(1));
        assert_eq!(meshes.get(object).unwrap(), None);
        for (upload, length) in [(1, 2_000_000), (2, 0), (3, 4076), (4, 4077)] {
            let file = mesh_file(length);
            let info = mesh_info(upload, &file);
            wait(meshes.put(object, &info, &file)).unwrap();
            assert_eq!(meshes.get(object).unwrap(), Some((info, file)));
        }
        wait(meshes.remove(object)).unwrap();
        assert_eq!(meshes.get(object).unwrap(), None);
    });
}

#[test]
fn versions_are_numbered_share_blocks_and_switch_with_history() {
    check(|database| {
        let (catalogues, id) = (database.catalogues(), Uuid::from_u128(70));
        wait(catalogues.create(&catalogue(70))).unwrap();
        let first = wait(catalogues.publish(id, draft(&[("a", 5_000), ("b", 10)]))).unwrap();
        let bytes = database.stats().unwrap().bytes;
        let second = wait(catalogues.publish(id, draft(&[("a", 5_000)]))).unwrap();
        assert_eq!((first.version, second.version), (1, 2));
        assert_eq!(first.blocks[0], second.blocks[0]);
        if database.stats().unwrap().engine == "memory" {
            assert!(database.stats().unwrap().bytes < bytes + 2_000, "the block is shared");
        }
        assert_eq!(catalogues.manifests(id, 0, 10).unwrap(), [first.clone(), second]);
        assert_eq!(catalogues.manifests(id, 1, 10).unwrap().len(), 1);

        let before = catalogues.get(id).unwrap();
        assert_eq!((before.current, before.latest, before.revision), (None, 2, 0));
        wait(catalogues.switch(id, 2, Some(0), 100)).unwrap();
        let stale = wait(catalogues.switch(id, 1, Some(0), 101));
        assert!(matches!(stale, Err(StoreError::Changed { .. })));
        let back = wait(catalogues.switch(id, 1, Some(1), 102)).unwrap();
        assert_eq!((back.current, back.revision), (Some(1), 2));
        let history = [Switch { version: 2, at_ms: 100 }, Switch { version: 1, at_ms: 102 }];
        assert_eq!(back.history, history);
        let unknown = wait(catalogues.switch(id, 3, None, 103));
        assert_eq!(unknown, Err(StoreError::NoVersion { catalogue: id, version: 3 }));
    });
}

#[test]
fn concurrent_publishers_get_different_versions() {
    check(|database| {
        let (catalogues, id) = (database.catalogues(), Uuid::from_u128(70));
        wait(catalogues.create(&catalogue(70))).unwrap();
        std::thread::scope(|scope| {
            for _ in 0..12 {
                scope.spawn(|| wait(catalogues.publish(id, draft(&[("a", 9_000)]))).unwrap());
            }
        });
        let versions: Vec<_> =
            catalogues.manifests(id, 0, 20).unwrap().iter().map(|m| m.version).collect();
        assert_eq!(versions, (1..=12).collect::<Vec<_>>());
        assert_eq!(catalogues.get(id).unwrap().latest, 12);
    });
}

#[test]
fn removing_an_object_leaves_nothing() {
    let database = Database::in_memory();
    let empty = database.stats().unwrap().bytes;
    let id = Uuid::from_u128(20);
    let file = mesh_file(50_000);
    wait(database.objects().create(&object(20))).unwrap();
    wait(database.meshes().put(id, &mesh_info(1, &file), &file)).unwrap();
    wait(database.training().append(id, 0, &[entry("a", 1)])).unwrap();
    assert!(wait(database.remove_object(id)).unwrap());
    assert_eq!(database.stats().unwrap().bytes, empty);
}

#[test]
fn a_repeated_reading_is_the_same_under_another_calibration() {
    let first = samples::reading(36);
    let again = StoredReading { calibration: 3, ..first.clone() };
    assert!(first.is_repeated_by(&again));
    assert!(!first.is_repeated_by(&StoredReading { stamp_ns: None, ..again }));
}

#[test]
fn robots_numbers_are_unique_per_key() {
    let (journal, owner) = (Database::in_memory().journal(), Uuid::from_u128(50));
    let id = |seq| ReadingId { robot: "a".to_owned(), seq };
    let [one, other] = [1, 2].map(|key| Some(Uuid::from_u128(key)));
    let entry = |written_by, seq| NewEntry { written_by, ..samples::entry("a", seq) };
    let entries = [entry(one, 7), entry(other, 7), entry(None, 9)];
    samples::wait(journal.append(owner, 0, &entries)).unwrap();
    assert_eq!(journal.find(owner, &id(7), one), Ok(Some(0)));
    assert_eq!(journal.find(owner, &id(7), other), Ok(Some(1)));
    assert_eq!(journal.find(owner, &id(7), None), Ok(None));
    assert_eq!(journal.find(owner, &id(9), other), Ok(Some(2)), "its key was not recorded");
    let again = samples::wait(journal.append(owner, 3, &[entry(other, 7)])).unwrap_err();
    assert_eq!(again, AppendError::Repeated { robot: "a".to_owned(), seq: 7, at: 1 });
    samples::wait(journal.remove(owner)).unwrap();
    assert_eq!(journal.find(owner, &id(7), one), Ok(None));
}
