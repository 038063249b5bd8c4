//! Tests of stored calibrations: numbers, lines and passports beside each other, and frozen bytes.

use palpate_core::sensor::Calibration;
use palpate_store::calibration::{Addition, StoredCalibration};
use palpate_store::database::Database;
use palpate_store::journal::Limit;
use uuid::Uuid;

use crate::bytes::{current_of, is_calibration, thawed};
use crate::samples::{self, wait};

/// One sensor's lines, and another one's passport, of schema 2.
const GOLDEN_V2: &str = include_str!("golden/calibrations_v2.txt");
/// The same, and a third sensor's curves.
const GOLDEN: &str = include_str!("golden/calibrations_v3.txt");

#[test]
fn written_bytes_of_calibrations_equal_the_frozen_bytes() {
    let [lined, commissioned, bent] = [10, 11, 12].map(Uuid::from_u128);
    let current = current_of(&[], async |database| {
        let lines = Addition::Lines(samples::taxel_lines());
        database.calibrations().add(lined, &lines).await.unwrap();
        let passport = Addition::Passport(samples::passport());
        database.calibrations().add(commissioned, &passport).await.unwrap();
        let curves = Addition::Lines(samples::taxel_curves());
        database.calibrations().add(bent, &curves).await.unwrap();
    });
    let found: Vec<&str> = current.lines().filter(|line| is_calibration(line)).collect();
    assert_eq!(found, GOLDEN.lines().collect::<Vec<_>>(), "{found:#?}");
}

#[test]
fn frozen_bytes_of_calibrations_are_read() {
    let [lined, commissioned, bent] = [10, 11, 12].map(Uuid::from_u128);
    for (golden, has_curves) in [(GOLDEN_V2, false), (GOLDEN, true)] {
        let calibrations = thawed(golden).calibrations();
        let lines = Some(samples::taxel_lines());
        let first = StoredCalibration { sensor: lined, number: 1, lines, passport: None };
        assert_eq!(calibrations.latest(lined).unwrap(), Some(first));
        let passport = Some(samples::passport());
        let second = StoredCalibration { sensor: commissioned, number: 1, lines: None, passport };
        assert_eq!(calibrations.latest(commissioned).unwrap(), Some(second));
        let lines = Some(samples::taxel_curves());
        let third = StoredCalibration { sensor: bent, number: 1, lines, passport: None };
        assert_eq!(calibrations.latest(bent).unwrap(), has_curves.then_some(third));
    }
}

#[test]
fn calibrations_are_numbered_per_sensor_and_stay() {
    let database = Database::in_memory();
    let calibrations = database.calibrations();
    let (one, other) = (Uuid::from_u128(10), Uuid::from_u128(11));
    assert_eq!(calibrations.latest(one).unwrap(), None);
    // Many taxels: more than one piece.
    let mut wide = samples::taxel_lines();
    let taxels = wide.calibration.taxels().iter().copied().cycle().take(400).collect();
    wide.calibration = Calibration::new(wide.calibration.target(), taxels).unwrap();
    let add = |sensor, addition| wait(calibrations.add(sensor, &addition)).unwrap();
    let first = add(one, Addition::Lines(wide.clone()));
    let lines = Some(wide);
    assert_eq!(first, StoredCalibration { sensor: one, number: 1, lines, passport: None });
    let second = add(one, Addition::Lines(samples::taxel_lines()));
    assert_eq!((second.number, second.lines.as_ref().unwrap().since), (2, 2));
    assert_eq!(add(other, Addition::Lines(samples::taxel_lines())).number, 1);
    assert_eq!(calibrations.find(one, 1).unwrap(), Some(first.clone()));
    assert_eq!(calibrations.latest(one).unwrap(), Some(second.clone()));
    let page = |sensor, behind, records| {
        calibrations.page(sensor, behind, Limit { records, bytes: usize::MAX }).unwrap()
    };
    assert_eq!(page(one, 0, 9), [first.clone(), second.clone()]);
    assert_eq!((page(one, 0, 1), page(one, 1, 9)), (vec![first], vec![second]));
    assert_eq!(page(other, 0, 9).len(), 1);
    for number in 3..=20 {
        assert_eq!(add(one, Addition::Lines(samples::taxel_lines())).number, number);
        assert_eq!(calibrations.latest(one).unwrap().unwrap().number, number);
    }
    assert_eq!(calibrations.find(one, 21).unwrap(), None);
}

#[test]
fn lines_and_passport_of_a_sensor_keep_each_other() {
    let database = Database::in_memory();
    let (calibrations, sensor) = (database.calibrations(), Uuid::from_u128(10));
    let add = |addition| wait(calibrations.add(sensor, &addition)).unwrap();
    let first = add(Addition::Passport(samples::passport()));
    assert_eq!((first.lines, first.passport.unwrap().since), (None, 1));
    let second = add(Addition::Lines(samples::taxel_lines()));
    assert_eq!(second.lines.as_ref().map(|lines| lines.since), Some(2));
    assert_eq!(second.passport.as_ref().map(|passport| passport.since), Some(1));
    let third = add(Addition::Passport(samples::passport()));
    assert_eq!((third.lines, third.passport.unwrap().since), (second.lines, 3));
}
