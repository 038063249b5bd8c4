//! Tests of the stored bytes: frozen examples of each record, and round trips.
//!
//! `golden/records_v1.txt` was written by this test's `current` on layout 1 and never
//! changes: its content must stay readable for ever. A new schema adds a file:
//! `golden/records_v2.txt` has journal entries of schema 2 and calibrations,
//! `golden/records_v3.txt` journal entries of schema 3, `golden/records_v4.txt` of schema 4,
//! `golden/records_v5.txt` of schema 5, `golden/records_v6.txt` of schema 6 with a contact and with
//! shear, `golden/retractions_v1.txt` a retraction, `golden/heads_v2.txt` a journal head of schema 2.
//! Not here: sensors of later schemas (`sensors`), calibrations of schema 2, and what has labels
//! (`labels`).

use std::fmt::Write;
use std::sync::Arc;

use palpate_core::pose::Pose;
use palpate_core::reading::Looseness;
use palpate_core::reading::point_contact::ContactNumbers;
use palpate_store::calibration::{Addition, StoredCalibration};
use palpate_store::catalogue::{BlockEntry, Manifest, VersionObject};
use palpate_store::database::Database;
use palpate_store::engine::{Commit, Engine};
use palpate_store::entity::{Object, ReadingId, StoredReading};
use palpate_store::journal::{Entry, Event, Head, NewEntry};
use palpate_store::memory::MemoryEngine;
use palpate_store::record::{decode, encode};
use palpate_store::robot::RobotHolder;
use proptest::prelude::*;
use uuid::Uuid;

use crate::samples;

pub(crate) const GOLDEN: &str = include_str!("golden/records_v1.txt");
const GOLDEN_V2: &str = include_str!("golden/records_v2.txt");
const GOLDEN_V3: &str = include_str!("golden/records_v3.txt");
const GOLDEN_V4: &str = include_str!("golden/records_v4.txt");
/// Schema 5, and robots' names.
const GOLDEN_V5: &str = include_str!("golden/records_v5.txt");
const GOLDEN_V6: &str = include_str!("golden/records_v6.txt");
const GOLDEN_RETRACTIONS: &str = include_str!("golden/retractions_v1.txt");
/// The head of the journal of `retracted`, of schema 2.
const GOLDEN_HEADS: &str = include_str!("golden/heads_v2.txt");

/// Every key and value of a filled database, a line each in hexadecimal; values above 500
/// bytes (pieces of files) by their hash.
fn current() -> String {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    samples::fill(&Database::with_engine(Arc::clone(&engine)).unwrap());
    lines(&*engine)
}

/// The dump of a database with these journal entries and the additions of `and`.
pub(crate) fn current_of(entries: &[NewEntry], and: impl AsyncFnOnce(&Database)) -> String {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    samples::wait(async {
        database.journal().append(Uuid::from_u128(50), 0, entries).await.unwrap();
        and(&database).await;
    });
    lines(&*engine)
}

fn closed() -> NewEntry {
    NewEntry { event: Event::Closed, ..samples::entry("b", 1) }
}

/// A reading, and its withdrawal.
fn retracted() -> [NewEntry; 2] {
    let event = Event::Retraction { seq: 0 };
    let (received_at_ms, written_by) = (1_790_000_000_001, None);
    let retraction = NewEntry { reading_id: None, received_at_ms, event, written_by };
    [samples::moved_entry("a", 1), retraction]
}

pub(crate) fn lines(engine: &dyn Engine) -> String {
    let mut text = String::new();
    // The layout record, the first, also contains the version of its creator.
    for (key, value) in engine.scan(b"", Some(b"!"), 1000).unwrap() {
        let value = match value.len() {
            0..=500 => hex(&value),
            long => format!("{long} bytes, blake3 {}", blake3::hash(&value).to_hex()),
        };
        writeln!(text, "{} {value}", hex(&key)).unwrap();
    }
    text
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

pub(crate) fn unhex(text: &str) -> Vec<u8> {
    let digits = |place| u8::from_str_radix(&text[place..place + 2], 16).unwrap();
    (0..text.len()).step_by(2).map(digits).collect()
}

/// Journal entries (`r`, `t`) are written with schema 6 today.
fn is_entry(line: &str) -> bool {
    line.starts_with("72") || line.starts_with("74")
}

/// Journal heads (`R`, `T`) are written with schema 2 today.
fn is_head(line: &str) -> bool {
    line.starts_with("52") || line.starts_with("54")
}

/// Objects (`o`), jobs (`j`) and catalogues (`c`) are written with schema 2 today.
pub(crate) fn is_labelled(line: &str) -> bool {
    ["6f", "6a", "63"].iter().any(|space| line.starts_with(space))
}

/// Sensors (`s`) are written with schema 5 today.
pub(crate) fn is_sensor(line: &str) -> bool {
    line.starts_with("73")
}

/// Calibrations (`k`) are written with schema 2 today.
pub(crate) fn is_calibration(line: &str) -> bool {
    line.starts_with("6b")
}

/// Compares written bytes with frozen ones, except records of earlier schemas.
#[track_caller]
fn check_frozen(current: &str, golden: &str) {
    for (now, frozen) in current.lines().zip(golden.lines()) {
        let is_newer = is_entry(now)
            || is_head(now)
            || is_sensor(now)
            || is_calibration(now)
            || is_labelled(now);
        assert!(now == frozen || is_newer, "{now}");
    }
    assert_eq!(current.lines().count(), golden.lines().count(), "\n{current}");
}

#[test]
fn written_bytes_equal_the_frozen_bytes() {
    check_frozen(&current(), GOLDEN);
    let entries = [samples::calibrated_entry("a", 1, 7), closed()];
    let calibrated = current_of(&entries, async |database| {
        let lines = Addition::Lines(samples::taxel_lines());
        database.calibrations().add(Uuid::from_u128(10), &lines).await.unwrap();
    });
    check_frozen(&calibrated, GOLDEN_V2);
    let coded = [samples::coded_entry("a", 1), samples::calibrated_entry("a", 2, 7), closed()];
    let moved = [samples::moved_entry("a", 1), closed()];
    for (entries, golden) in
        [(&coded[..], GOLDEN_V3), (&moved, GOLDEN_V4), (&retracted(), GOLDEN_RETRACTIONS)]
    {
        check_frozen(&current_of(entries, async |_| ()), golden);
    }
}

#[test]
fn written_bytes_of_schema_6_equal_the_frozen_bytes() {
    let entries = [samples::contact_entry("a", 1), samples::sheared_entry("a", 2), closed()];
    let current = current_of(&entries, async |_| ());
    assert_eq!(current, GOLDEN_V6);
}

#[test]
fn frozen_bytes_of_schema_6_are_read() {
    let entries = thawed(GOLDEN_V6).journal().entries(Uuid::from_u128(50), 0, 10).unwrap();
    let events: Vec<Event> = entries.into_iter().map(|entry| entry.event).collect();
    let [contact, sheared] = [samples::contact_entry("a", 1), samples::sheared_entry("a", 2)];
    assert_eq!(events, [contact.event, sheared.event, Event::Closed]);
}

#[test]
fn written_bytes_of_schema_5_equal_the_frozen_bytes() {
    let key = Uuid::from_u128(80);
    let entry = NewEntry { written_by: Some(key), ..samples::moved_entry("a", 1) };
    let holder = RobotHolder { robot: "arm-3".to_owned(), key, since_ms: 7 };
    let current = current_of(&[entry, closed()], async |database| {
        database.robots().put(&[holder]).await.unwrap();
    });
    check_frozen(&current, GOLDEN_V5);
}

#[test]
fn frozen_bytes_of_schema_5_are_read() {
    let database = thawed(GOLDEN_V5);
    let entries = database.journal().entries(Uuid::from_u128(50), 0, 10).unwrap();
    let events: Vec<_> = entries.iter().map(|entry| (&entry.event, entry.written_by)).collect();
    let (key, reading) = (Some(Uuid::from_u128(80)), samples::moved_entry("a", 1).event);
    assert_eq!(events, [(&reading, key), (&Event::Closed, None)]);
    let holder = RobotHolder { robot: "arm-3".to_owned(), key: Uuid::from_u128(80), since_ms: 7 };
    assert_eq!(database.robots().all().unwrap(), [holder]);
}

#[test]
fn frozen_bytes_of_retractions_are_read() {
    let (journal, owner) = (thawed(GOLDEN_RETRACTIONS).journal(), Uuid::from_u128(50));
    assert_eq!(journal.retraction(owner, 0), Ok(Some(1)));
    assert_eq!(journal.entry(owner, 1).unwrap().unwrap().event, Event::Retraction { seq: 0 });
}

#[test]
fn written_bytes_of_heads_equal_the_frozen_bytes() {
    let current = current_of(&retracted(), async |_| ());
    let heads: Vec<&str> = current.lines().filter(|line| is_head(line)).collect();
    assert_eq!(heads, GOLDEN_HEADS.lines().collect::<Vec<_>>());
}

#[test]
fn heads_of_schema_1_are_counted_and_the_next_append_says_all() {
    let journal = thawed(GOLDEN_RETRACTIONS).journal();
    let (owner, last_at_ms) = (Uuid::from_u128(50), Some(1_790_000_000_001));
    let head = Head { length: 2, n_retracted: 1, last_at_ms, is_closed: false };
    assert_eq!(journal.head(owner), Ok(head));
    let closed = closed();
    samples::wait(async { journal.append(owner, 2, std::slice::from_ref(&closed)).await.unwrap() });
    let last_at_ms = Some(closed.received_at_ms);
    let after = Head { length: 3, n_retracted: 1, last_at_ms, is_closed: true };
    assert_eq!(journal.head(owner), Ok(after));
}

#[test]
fn a_head_counts_withdrawn_entries_without_looking_for_them() {
    let journal = thawed(GOLDEN_HEADS).journal();
    let last_at_ms = Some(1_790_000_000_001);
    let head = Head { length: 2, n_retracted: 1, last_at_ms, is_closed: false };
    assert_eq!(journal.head(Uuid::from_u128(50)), Ok(head), "there are no records of entries");
}

#[test]
fn frozen_bytes_of_schema_4_are_read() {
    let entries = thawed(GOLDEN_V4).journal().entries(Uuid::from_u128(50), 0, 10).unwrap();
    assert!(entries.iter().all(|entry| entry.written_by.is_none()), "not recorded");
    let events: Vec<Event> = entries.into_iter().map(|entry| entry.event).collect();
    assert_eq!(events, [samples::moved_entry("a", 1).event, Event::Closed]);
}

/// A database of the lines of a golden file.
pub(crate) fn thawed(golden: &str) -> Database {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    Database::with_engine(Arc::clone(&engine)).unwrap();
    for line in golden.lines() {
        let (key, value) = line.split_once(' ').unwrap();
        // Pieces of files are frozen by their hashes only.
        if !value.contains("bytes") {
            engine.commit(Commit::new().put(unhex(key), unhex(value))).wait().unwrap();
        }
    }
    Database::with_engine(engine).unwrap()
}

#[test]
fn frozen_bytes_are_read() {
    let database = thawed(GOLDEN);
    assert_eq!(database.sensors().all().unwrap(), [samples::sheet(samples::sensor(10))]);
    assert_eq!(database.objects().all().unwrap(), [samples::object(20)]);
    assert_eq!(database.jobs().all().unwrap(), [samples::job(40)]);
    assert_eq!(database.sessions().all().unwrap(), [samples::session(50)]);
    // Only `migrations` reads journal entries of schemas before 4.
    let error = database.journal().entries(Uuid::from_u128(50), 0, 10).unwrap_err();
    assert!(error.to_string().contains("schema 1"), "{error}");
    let calibrated = thawed(GOLDEN_V2);
    let sensor = Uuid::from_u128(10);
    let lines = Some(samples::taxel_lines());
    let expected = StoredCalibration { sensor, number: 1, lines, passport: None };
    assert_eq!(calibrated.calibrations().latest(sensor).unwrap(), Some(expected));
    assert_eq!(database.catalogues().get(Uuid::from_u128(70)).unwrap().current, Some(1));
    assert_eq!(database.catalogues().manifest(Uuid::from_u128(70), 1).unwrap().blocks.len(), 2);
}

fn reading() -> impl Strategy<Value = StoredReading> {
    let pressures = prop::collection::vec(prop::option::of(-1e8..1e8_f64), 0..60);
    let pose = prop::option::of((0.0..6.0_f64, -1.0..1.0_f64).prop_map(|(angle, x)| {
        Pose::new([x, -x, 2.0 * x], [0.0, angle.sin(), 0.0, angle.cos()]).unwrap()
    }));
    let feature = prop::option::of(prop::collection::vec(-1e9..1e9_f64, 0..40));
    let numbers = (any::<Option<i64>>(), any::<u32>());
    let shear = prop::option::of(prop::collection::vec(
        prop::option::of([-1e8..1e8_f64, -1e8..1e8_f64]),
        0..20,
    ));
    let way = (0.0..10.0_f64, prop::option::of((1e-4..0.1_f64, 1e-4..1.0_f64)));
    let without = (prop::option::of(contact()), shear);
    (any::<u128>(), pressures, pose, numbers, feature, way, without).prop_map(
        |(sensor, pressures, session_from_sensor, numbers, feature, way, (contact, shear))| {
            let (stamp_ns, calibration) = numbers;
            StoredReading {
                sensor: Uuid::from_u128(sensor),
                session_from_sensor,
                pressures,
                stamp_ns,
                calibration,
                feature,
                approach: way.0,
                object_moved: way.1.map(|(position, angle)| Looseness { position, angle }),
                contact,
                shear,
            }
        },
    )
}

fn contact() -> impl Strategy<Value = ContactNumbers> {
    let normal = prop::option::of(([-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64], 1e-3..1.0_f64));
    let place = ([-9.0..9.0_f64, -9.0..9.0_f64, -9.0..9.0_f64], 1e-4..0.1_f64);
    (any::<bool>(), place, normal, prop::option::of(0.0..50.0_f64)).prop_map(
        |(touched, (position, position_deviation), normal, force)| ContactNumbers {
            touched,
            position,
            position_deviation,
            normal: normal.map(|(normal, _)| normal),
            normal_deviation: normal.map(|(_, deviation)| deviation),
            force,
        },
    )
}

fn entry() -> impl Strategy<Value = Entry> {
    let event = prop_oneof![
        reading().prop_map(Event::Reading),
        any::<u64>().prop_map(|seq| Event::Retraction { seq }),
        Just(Event::Closed),
    ];
    (prop::option::of(("\\PC{0,16}", any::<u64>())), any::<u64>(), event).prop_map(
        |(id, received_at_ms, event)| Entry {
            seq: received_at_ms / 2,
            reading_id: id.map(|(robot, seq)| ReadingId { robot, seq }),
            received_at_ms,
            event,
            written_by: received_at_ms.is_multiple_of(3).then(|| Uuid::from_u128(80)),
        },
    )
}

fn manifest() -> impl Strategy<Value = Manifest> {
    let objects = prop::collection::vec((any::<u128>(), "\\PC{0,20}"), 0..5);
    let blocks = prop::collection::vec(("[a-z.]{1,20}", any::<[u8; 32]>(), any::<u64>()), 0..5);
    (any::<u128>(), any::<u32>(), any::<Option<u128>>(), objects, blocks, any::<u64>()).prop_map(
        |(catalogue, version, job, objects, blocks, created_at_ms)| Manifest {
            catalogue: Uuid::from_u128(catalogue),
            version,
            job: job.map(Uuid::from_u128),
            parameters: String::new(),
            objects: objects
                .into_iter()
                .map(|(id, name)| VersionObject { id: Uuid::from_u128(id), name })
                .collect(),
            blocks: blocks
                .into_iter()
                .map(|(name, hash, length)| BlockEntry { name, hash, length })
                .collect(),
            created_at_ms,
        },
    )
}

proptest! {
    #[test]
    fn entries_are_restored_bit_by_bit(entry in entry()) {
        prop_assert_eq!(decode::<Entry>(&encode(&entry)).unwrap(), entry);
    }

    #[test]
    fn manifests_are_restored(manifest in manifest()) {
        prop_assert_eq!(decode::<Manifest>(&encode(&manifest)).unwrap(), manifest);
    }

    #[test]
    fn objects_are_restored(name in "\\PC{0,40}", description in "\\PC{0,400}", at in any::<u64>()) {
        let object = Object { name, description, created_at_ms: at, ..samples::object(9) };
        prop_assert_eq!(decode::<Object>(&encode(&object)).unwrap(), object);
    }

    #[test]
    fn random_bytes_are_refused_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(decode::<Object>(&bytes).is_err());
        let sealed = palpate_store::envelope::seal(
            palpate_store::envelope::Kind::JournalEntry, 1, &bytes);
        let _ = decode::<Entry>(&sealed);
    }
}
