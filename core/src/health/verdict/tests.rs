//! Tests of judgements, on days whose sums are stated.

use glam::DVec3;

use super::*;
use crate::belief::answer::SensorShift;

fn sensor() -> SensorDescription {
    SensorDescription::digitacts_6x6()
}

fn floor() -> f64 {
    sensor().contact_floor()
}

/// A taxel at rest, in contact floors.
fn at_rest(mean: f64, noise: f64, n_quiet: u32) -> TaxelSums {
    let steps = 2.0 * f64::from(n_quiet) * (noise * floor()).powi(2);
    let (mean, latest) = (mean * floor(), mean * floor());
    TaxelSums { n_quiet, mean, latest, n_steps: n_quiet, steps, ..TaxelSums::default() }
}

/// A day of good taxels but those that are given.
fn day(day: u32, others: &[(usize, TaxelSums)]) -> Day {
    let n_quiet = others.first().map_or(60, |(_, sums)| sums.n_quiet.max(20));
    let mut taxels = vec![at_rest(0.0, 0.1, n_quiet); 36];
    others.iter().for_each(|(taxel, sums)| taxels[*taxel] = *sums);
    Day { day, presses: PressSums { n_presses: 80, n_quiet, taxels }, ..Day::default() }
}

fn found(days: &[Day]) -> Vec<(Fault, Severity)> {
    judge(days, &sensor()).findings.iter().map(|it| (it.fault, it.severity)).collect()
}

#[track_caller]
fn check(days: &[Day], expected: &[(Fault, Severity)]) {
    assert_eq!(found(days), expected);
}

use Severity::{Commission, Watch};

#[test]
fn a_good_sensor_has_no_findings() {
    check(&[day(1, &[]), day(2, &[]), day(5, &[])], &[]);
    assert!(judge(&[day(1, &[])], &sensor()).is_known());
    assert!(!judge(&[], &sensor()).is_known(), "nothing is known");
    let few = day(1, &[(0, at_rest(0.0, 0.1, 9))]);
    let few = Day { presses: PressSums { n_quiet: 9, ..few.presses }, ..few };
    assert!(!judge(&[few], &sensor()).is_known());
}

#[test]
fn a_taxel_is_judged_at_half_of_and_at_the_contact_floor() {
    let one = |mean, noise, n| [day(1, &[(7, at_rest(mean, noise, n))])];
    check(&one(1.2, 0.1, 60), &[(Fault::Offset(7), Commission)]);
    check(&one(-1.2, 0.1, 60), &[(Fault::Offset(7), Commission)]);
    check(&one(0.6, 0.1, 60), &[(Fault::Offset(7), Watch)]);
    check(&one(0.4, 0.1, 60), &[]);
    check(&one(1.2, 0.1, 9), &[]);
    // It has drifted in the course of the day.
    let late = TaxelSums { mean: 0.2 * floor(), ..at_rest(1.2, 0.1, 60) };
    check(&[day(1, &[(7, late)])], &[(Fault::Offset(7), Commission)]);
}

#[test]
fn a_change_since_the_first_days_is_drift() {
    let then = |mean| day(1, &[(7, at_rest(mean, 0.1, 60))]);
    let now = |mean| day(9, &[(7, at_rest(mean, 0.1, 60))]);
    check(&[then(0.1), now(1.2)], &[(Fault::Drift(7), Commission)]);
    check(&[then(-0.6), now(0.3)], &[(Fault::Drift(7), Watch)]);
    check(&[then(1.1), now(1.2)], &[(Fault::Offset(7), Commission)]);
    check(&[then(1.1), now(0.0)], &[(Fault::Drift(7), Commission)]);
    let health = judge(&[then(0.1), day(4, &[]), now(1.2)], &sensor());
    let finding = health.findings[0];
    assert!((finding.value / floor() - 1.1).abs() < 1e-9, "{finding:?}");
    assert!((finding.expected / floor() - 1.0).abs() < 1e-9, "{finding:?}");
}

#[test]
fn an_offset_of_all_taxels_is_said_once() {
    let mut shifted = day(1, &[]);
    shifted.presses.taxels.iter_mut().for_each(|taxel| taxel.latest += 2.0 * floor());
    shifted.presses.taxels[3].latest += 1.5 * floor();
    check(&[shifted], &[(Fault::CommonOffset, Commission), (Fault::Offset(3), Commission)]);
}

#[test]
fn noise_is_judged_by_false_contacts() {
    let one = |noise, n| [day(1, &[(7, at_rest(0.0, noise, n))])];
    // The described noise is a fifth of the floor.
    check(&one(0.25, 60), &[]);
    check(&one(0.35, 60), &[(Fault::Noise(7), Watch)]);
    check(&one(0.5, 60), &[(Fault::Noise(7), Commission)]);
    check(&one(0.5, 19), &[]);
}

/// Taxel 7 beside answering neighbours.
fn asked(n_asked: u32, n_answered: u32, value: f64, range: f64) -> TaxelSums {
    let (own, around) = (f64::from(n_asked) * value, f64::from(n_asked) * 8.0 * floor());
    let (low, high) = (value * floor(), (value + range) * floor());
    TaxelSums {
        n_asked,
        n_answered,
        own: own * floor(),
        around,
        low,
        high,
        ..at_rest(0.0, 0.1, 60)
    }
}

#[test]
fn taxels_that_do_not_answer_are_dead_or_stuck() {
    let one = |sums| [day(1, &[(7, sums)])];
    check(&one(asked(10, 0, 0.0, 0.5)), &[(Fault::Dead(7), Commission)]);
    check(&one(asked(9, 0, 0.0, 0.5)), &[]);
    check(&one(asked(20, 2, 0.3, 5.0)), &[]);
    check(&one(asked(20, 1, 0.3, 5.0)), &[(Fault::Dead(7), Commission)]);
    // It reads what its neighbours read, and reads it always.
    check(&one(asked(20, 20, 8.0, 0.2)), &[(Fault::Stuck(7), Commission)]);
    check(&one(asked(20, 20, 8.0, 3.0)), &[]);
    let health = judge(&one(asked(10, 0, 0.0, 0.5)), &sensor());
    assert_eq!((health.dead(), health.stuck()), (vec![7], vec![]));
}

#[test]
fn answers_that_have_weakened_are_found() {
    let days = |now| [day(1, &[(7, asked(20, 20, 8.0, 9.0))]), day(9, &[(7, now)])];
    check(&days(asked(20, 20, 7.0, 9.0)), &[]);
    check(&days(asked(20, 20, 4.0, 9.0)), &[(Fault::Gain(7), Watch)]);
    check(&days(asked(20, 20, 3.0, 9.0)), &[(Fault::Gain(7), Commission)]);
    check(&days(asked(9, 9, 3.0, 9.0)), &[]);
}

/// A day of sessions with a shift along x and z, mm.
fn sessions(n: u32, x: f64, z: f64, deviation: f64) -> Day {
    let mut day = day(1, &[]);
    let (shift, deviation) = (DVec3::new(x, 0.0, z) * MM, DVec3::splat(deviation * MM));
    (0..n).for_each(|_| day.shifts.add(&SensorShift { shift, deviation, n_touches: 8 }));
    day
}

#[test]
fn a_tool_centre_is_judged_once_it_is_certain() {
    check(&[sessions(5, 0.2, 2.0, 0.2)], &[(Fault::ToolCenter(2), Commission)]);
    check(&[sessions(5, -0.8, 0.1, 0.2)], &[(Fault::ToolCenter(0), Watch)]);
    check(&[sessions(2, 0.2, 2.0, 0.2)], &[]);
    check(&[sessions(5, 0.2, 2.0, 1.5)], &[]);
    let found = judge(&[sessions(5, 0.2, -2.0, 0.2)], &sensor()).findings[0];
    assert!((found.value / MM + 2.0).abs() < 1e-9, "the sign stays: {found:?}");
}

#[test]
fn days_of_earlier_calibrations_do_not_count() {
    let bad = || day(1, &[(7, at_rest(3.0, 0.1, 60))]);
    let good = || Day { calibration: 1, ..day(2, &[]) };
    check(&[bad(), good()], &[]);
    let health = judge(&[bad(), good()], &sensor());
    assert_eq!(health.first, None, "nothing to compare with");
}

#[test]
fn the_newest_days_are_judged_and_not_older_ones() {
    let bad = |at| day(at, &[(7, at_rest(3.0, 0.1, 60))]);
    assert!(!found(&[day(1, &[]), bad(2)]).is_empty());
    // Repaired, and then compared with the first days.
    check(&[day(1, &[]), bad(2), day(3, &[])], &[]);
    // Within few presses: 24 leave 0.9²⁴ = 8 % of the offset before them.
    let two = |first, second| {
        let quiet = |at, mean, n| {
            let mut day = day(at, &[(7, at_rest(mean, 0.1, n))]);
            day.presses.n_quiet = n;
            day
        };
        [quiet(2, first, 20), quiet(3, second, 24)]
    };
    check(&two(3.0, 0.0), &[]);
    check(&two(0.0, 3.0), &[(Fault::Offset(7), Commission)]);
}
