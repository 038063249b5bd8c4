//! Tests of sensors' days: laws on both engines, a bounded ring, frozen bytes, and removal.

use std::sync::Arc;

use palpate_core::health::day::Day;
use palpate_core::health::presses::{PressSums, TaxelSums};
use palpate_core::health::shifts::ShiftSums;
use palpate_store::database::Database;
use palpate_store::engine::{Commit, Engine};
use palpate_store::fsck;
use palpate_store::memory::MemoryEngine;
use palpate_store::sensor_day::{DAYS_MAX, SESSIONS_MAX, SensorDay};
use tempfile::TempDir;
use uuid::Uuid;

use crate::bytes::{lines, thawed};
use crate::samples::{sensor, wait};

/// The bytes of [`day`] for sensor 10, with session 50.
const GOLDEN: &str = include_str!("golden/sensor_days_v1.txt");

fn id(id: u128) -> Uuid {
    Uuid::from_u128(id)
}

/// The sums of one session, each field different from every other. Numbers are exact in f32.
fn day(day: u32, calibration: u32) -> Day {
    let taxel = TaxelSums {
        n_quiet: 4,
        mean: -12.5,
        latest: -13.5,
        n_steps: 1,
        steps: 640.0,
        n_asked: 3,
        n_answered: 2,
        own: 5000.0,
        around: 7500.0,
        low: -20.0,
        high: 9000.5,
    };
    let taxels = vec![taxel, TaxelSums::default()];
    let shifts = ShiftSums {
        n_sessions: 1,
        n_touches: 8,
        weights: [1e6, 2e6, 3e6],
        sums: [-1e3, 0.1, 6e3],
        squares: [1.5, 2.5, 12.0],
    };
    let presses = PressSums { n_presses: 7, n_quiet: 4, taxels };
    Day { day, calibration, presses, shifts }
}

/// A law of databases with the sensors 10 and 11.
fn check(law: impl Fn(&Database)) {
    let folder = TempDir::new().unwrap();
    let mut engines: Vec<Arc<dyn Engine>> =
        vec![Arc::new(MemoryEngine::new()), Arc::new(crate::engines::open(&folder))];
    let cluster = crate::cluster::store();
    engines.extend(cluster.iter().map(|store| Arc::new(store.open()) as Arc<dyn Engine>));
    for engine in engines {
        let database = Database::with_engine(engine).unwrap();
        for id in [10, 11] {
            wait(database.sensors().create(&sensor(id))).unwrap();
        }
        law(&database);
    }
}

fn add(database: &Database, sensor: u128, session: u128, sums: &Day) -> bool {
    wait(database.sensor_days().add(id(sensor), id(session), sums)).unwrap()
}

fn numbers(database: &Database, sensor: u128) -> Vec<u32> {
    database.sensor_days().all(id(sensor)).unwrap().iter().map(|it| it.day.day).collect()
}

#[test]
fn a_session_counts_once_on_its_day() {
    check(|database| {
        assert_eq!(database.sensor_days().all(id(10)).unwrap(), []);
        assert!(add(database, 10, 50, &day(20_000, 0)));
        assert!(!add(database, 10, 50, &day(20_000, 0)), "again");
        assert!(add(database, 10, 40, &day(20_000, 0)));
        assert!(add(database, 11, 50, &day(20_000, 0)), "another sensor of the session");
        let mut twice = day(20_000, 0);
        twice.merge(&day(20_000, 0));
        let whole = SensorDay { sensor: id(10), sessions: vec![id(40), id(50)], day: twice };
        assert_eq!(database.sensor_days().all(id(10)).unwrap(), [whole]);
        let found = database.sensor_days().find(id(10), 20_000).unwrap().unwrap();
        assert!(!found.takes(id(50)) && found.takes(id(51)));
        assert_eq!(database.sensor_days().find(id(10), 20_001), Ok(None));
    });
}

#[test]
fn a_later_calibration_takes_the_day_over() {
    check(|database| {
        add(database, 10, 50, &day(20_000, 0));
        assert!(add(database, 10, 51, &day(20_000, 1)));
        assert!(add(database, 10, 52, &day(20_000, 0)), "it is noted");
        let found = database.sensor_days().all(id(10)).unwrap().remove(0);
        assert_eq!((found.sessions.len(), found.day), (3, day(20_000, 1)));
    });
}

#[test]
fn a_sensor_keeps_the_newest_days_and_the_first() {
    check(|database| {
        let last = 20_000 + DAYS_MAX as u32;
        // The first day is of an earlier calibration, the second the first of the newest.
        for day_number in 20_000..=last {
            let calibration = u32::from(day_number > 20_000);
            assert!(add(database, 10, 50, &day(day_number, calibration)));
        }
        let expected: Vec<u32> = (20_001..=last).collect();
        assert_eq!(numbers(database, 10), expected);
        assert!(add(database, 10, 50, &day(last + 1, 1)));
        let expected: Vec<u32> = [20_001].into_iter().chain(20_003..=last + 1).collect();
        assert_eq!(numbers(database, 10), expected, "the first stays");
        assert!(!add(database, 10, 50, &day(20_002, 1)), "older than the ring");
        assert_eq!(numbers(database, 10), expected);
        assert!(add(database, 10, 50, &day(last + 2, 2)), "a new calibration");
        assert_eq!(numbers(database, 10).len(), DAYS_MAX);
        assert_eq!(numbers(database, 10)[0], 20_003, "the first has become an old one");
        assert_eq!(numbers(database, 11), Vec::<u32>::new(), "another sensor");
    });
}

#[test]
fn the_sessions_of_a_day_are_bounded() {
    let database = Database::in_memory();
    wait(database.sensors().create(&sensor(10))).unwrap();
    for session in 0..SESSIONS_MAX as u128 {
        assert!(add(&database, 10, session, &day(20_000, 0)));
    }
    assert!(!add(&database, 10, 9_999, &day(20_000, 0)));
    let found = database.sensor_days().all(id(10)).unwrap().remove(0);
    assert!(!found.takes(id(9_999)));
    assert_eq!(found.day.presses.n_presses, 7 * SESSIONS_MAX as u32);
}

#[test]
fn a_removed_sensor_has_no_days() {
    check(|database| {
        let empty = database.stats().unwrap().live_bytes;
        assert!(add(database, 10, 50, &day(20_000, 0)));
        assert!(database.stats().unwrap().live_bytes > empty);
        assert!(wait(database.remove_sensor(id(10))).unwrap());
        assert_eq!(database.sensor_days().all(id(10)).unwrap(), []);
        assert!(!add(database, 10, 51, &day(20_000, 0)));
        assert_eq!(database.sensor_days().all(id(10)).unwrap(), []);
    });
}

#[test]
fn days_of_large_sensors_lie_in_pieces() {
    check(|database| {
        let mut large = day(20_000, 0);
        large.presses.taxels = vec![large.presses.taxels[0]; 128 * 128];
        assert!(add(database, 10, 50, &large));
        large.presses.taxels.truncate(36);
        assert!(add(database, 10, 51, &large), "the others stay");
        let found = database.sensor_days().all(id(10)).unwrap().remove(0);
        assert_eq!(found.day.presses.taxels.len(), 128 * 128);
    });
}

#[test]
fn written_bytes_of_days_equal_the_frozen_bytes_and_are_read() {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    wait(database.sensors().create(&sensor(10))).unwrap();
    add(&database, 10, 50, &day(20_000, 3));
    let current = lines(&*engine);
    let days: Vec<&str> = current.lines().filter(|line| line.starts_with("69")).collect();
    assert_eq!(days, GOLDEN.lines().collect::<Vec<_>>(), "{days:?}");
    let expected = SensorDay { sensor: id(10), sessions: vec![id(50)], day: day(20_000, 3) };
    assert_eq!(thawed(GOLDEN).sensor_days().all(id(10)).unwrap(), [expected]);
}

#[test]
fn fsck_knows_days_and_collects_those_of_removed_sensors() {
    let engine: Arc<dyn Engine> = Arc::new(MemoryEngine::new());
    let database = Database::with_engine(Arc::clone(&engine)).unwrap();
    wait(database.sensors().create(&sensor(10))).unwrap();
    add(&database, 10, 50, &day(20_000, 0));
    let report = fsck::check(&*engine).unwrap();
    assert_eq!((report.n_damaged, report.n_leftovers), (0, 0), "{report:?}");
    assert_eq!(report.records["sensor day"], 1);
    let (key, value) = engine.scan(b"i", None, 1).unwrap().remove(0);
    // Moved to the next day.
    let mut next = key.clone();
    next[24] += 1;
    engine.commit(Commit::new().put(next.clone(), value.clone())).wait().unwrap();
    let report = fsck::check(&*engine).unwrap();
    let named = report.findings[0].key.clone();
    assert_eq!((report.n_damaged, named), (1, format!("{} number 20001", id(10))));
    engine.commit(Commit::new().remove(next)).wait().unwrap();
    // A removal that was interrupted.
    wait(database.remove_sensor(id(10))).unwrap();
    engine.commit(Commit::new().put(key, value)).wait().unwrap();
    let report = fsck::check(&*engine).unwrap();
    assert_eq!((report.n_damaged, report.n_leftovers), (0, 1), "{report:?}");
    assert_eq!(wait(fsck::collect(&*engine, &report)).unwrap(), 1);
    assert_eq!(engine.scan(b"i", None, 1).unwrap(), []);
}
