//! Recorded beliefs: seeded sessions after every step, which show that a change of code does not
//! change beliefs.
//!
//! `tests/golden/beliefs.txt` has a line per step: the session, the step, a hash of the checkpoint,
//! then the numbers of the answer. The numbers are compared to 1e-3, since the last bits of `exp`
//! and `ln` differ between machines. `GOLDEN=exact` also compares every bit of the numbers and the
//! hash (on the machine that recorded them); `GOLDEN=update` records anew.

#![allow(clippy::disallowed_methods, reason = "recording anew writes the file when told to")]

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Base, Looseness, Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::belief::calibrate::{HeldBack, calibrate};
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::next_touch::{NextTouchOptions, rank};
use palpate_recogniser::options::SurfaceOptions;

use crate::ellipsoids::*;

const MOTION: Looseness = Looseness { position: 2.5 * MM, angle: 0.05 };

/// A step of a session.
enum Step {
    Touch(Reading),
    Moved(Looseness),
}

fn touched(object: usize, n: usize, seed: u64, pose: Pose) -> impl Iterator<Item = Step> {
    touches(object, n, seed).into_iter().map(move |reading| Step::Touch(reading.moved_by(pose)))
}

/// A press that meets nothing: after 0.1 m along a line through the object, or beside it.
fn miss(pose: Pose, beside: f64, approach: f64) -> Step {
    let at = Pose::from_parts(pose.rotation, pose.translation + DVec3::X * beside);
    let nothing = Reading::new(SensorId(0), &six_by_six(), &[Some(0.0); 36], at).unwrap();
    Step::Touch(nothing.after_approach(approach))
}

/// Touches of an object that moves before each of them.
fn moving(object: usize, n: usize, by: Looseness, seed: u64) -> Vec<Step> {
    let mut stream = Stream::new(seed, Purpose::Perturbation, object as u64);
    let mut pose = some_pose(object as u64);
    let step = |reading: Reading| {
        let mut three = |by: f64| by * DVec3::from_array([0; 3].map(|_| stream.normal()));
        let (shift, turn) = (three(by.position), DQuat::from_scaled_axis(three(by.angle)));
        pose = Pose::from_parts(turn * pose.rotation, pose.translation + shift);
        Step::Touch(reading.moved_by(pose))
    };
    touches(object, n, seed).into_iter().map(step).collect()
}

/// Half axes of the `index`th of many ellipsoids, and touches of it.
fn one_of_many(index: usize, n: usize, seed: u64) -> Vec<Reading> {
    let mut shape = Stream::new(11, Purpose::Shape, index as u64);
    let half = DVec3::from_array([0; 3].map(|_| shape.uniform(0.012, 0.045)));
    let mut stream = Stream::new(seed, Purpose::Sampling, index as u64);
    (0..n).map(|_| touch_of(half, &six_by_six(), &mut stream)).collect()
}

/// Enough ellipsoids that candidates are retrieved from the joint pair table.
fn many() -> Arc<SurfaceModel> {
    let map = |index| map_of(&one_of_many(index, 150, 1));
    Arc::new(MODEL.with_maps((0..70).map(map).collect()))
}

/// Records a session: its belief after every step.
fn record(out: &mut String, name: &str, mut belief: SurfaceBelief, steps: Vec<Step>) {
    for (n, step) in steps.into_iter().enumerate() {
        match step {
            Step::Touch(reading) => belief.add(&reading, &six_by_six()),
            Step::Moved(motion) => belief.announce_move(&motion),
        }
        let answer = belief.answer(3);
        let kept = hash(&belief.checkpoint());
        write!(out, "{name} {n} {kept:016x} {:?} {:?}", answer.unknown, answer.entropy_bits)
            .unwrap();
        let mut likeliest: Vec<(usize, f64)> =
            answer.probabilities.iter().copied().enumerate().collect();
        likeliest.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        for (object, p) in likeliest.iter().take(2) {
            write!(out, " {object} {p:?}").unwrap();
        }
        if let Some(mode) = answer.modes.first() {
            write!(out, " {} {:?}", mode.object.0, mode.weight).unwrap();
            let pose = mode.session_from_object;
            let q = if pose.rotation.w < 0.0 { -pose.rotation } else { pose.rotation };
            for number in pose.translation.to_array().into_iter().chain(q.to_array()) {
                write!(out, " {number:?}").unwrap();
            }
            write!(out, " {:?} {:?}", mode.covariance[(0, 0)], mode.covariance[(5, 5)]).unwrap();
        }
        out.push('\n');
    }
    record_next_touches(out, name, &belief);
}

/// Records the ranked next touches.
fn record_next_touches(out: &mut String, name: &str, belief: &SurfaceBelief) {
    let options = NextTouchOptions { n_approaches: 6, seed: 4, ..NextTouchOptions::default() };
    let ranking = rank(belief, None, &options, &mut || false).unwrap();
    let best = ranking.ranked[0];
    write!(out, "{name} next {:016x}", hash(format!("{ranking:?}").as_bytes())).unwrap();
    writeln!(out, " {:?} {:?} {:?}", best.identity_bits, best.pose_bits, best.contact_probability)
        .unwrap();
}

/// FNV-1a.
fn hash(bytes: &[u8]) -> u64 {
    let mix = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix)
}

fn belief_of(model: &Arc<SurfaceModel>, options: SurfaceOptions) -> SurfaceBelief {
    SurfaceBelief::new(model.clone(), options, None).unwrap()
}

/// All sessions.
fn recorded() -> String {
    let mut out = String::new();
    let (pose, plain) = (some_pose(1), SurfaceOptions::default());
    record(&mut out, "one", belief(), touched(2, 1, 5, pose).collect());
    let steps = touched(0, 7, 2, pose).chain([miss(pose, 0.02, 0.1), miss(pose, 1.0, 0.1)]);
    record(&mut out, "rest", belief(), steps.chain(touched(0, 3, 6, pose)).collect());
    let prior = SurfaceBelief::new(MODEL.clone(), plain, Some(&[1.0, 3.0, 0.0])).unwrap();
    record(&mut out, "prior", prior, touched(1, 6, 3, pose).collect());
    record(&mut out, "unannounced", belief(), moving(1, 12, MOTION, 6));
    let options = SurfaceOptions { motion: Some(MOTION), ..plain };
    record(&mut out, "announced", belief_of(&MODEL, options), moving(2, 10, MOTION, 7));
    let mut steps = vec![miss(pose, 0.5, 0.0)];
    steps.extend(touched(1, 5, 2, pose));
    steps.extend([Step::Moved(MOTION), miss(pose, 0.5, 0.1), Step::Moved(MOTION)]);
    steps.extend(touched(1, 4, 3, pose));
    record(&mut out, "moved", belief(), steps);
    let looseness = Looseness { position: 3.0 * MM, angle: 0.05 };
    let loose = touches(2, 10, 4).into_iter().enumerate().map(|(n, reading)| {
        let reading = reading.moved_by(pose);
        let base = Base { robot: n as u32 % 3, looseness };
        Step::Touch(if n % 3 == 0 { reading } else { reading.with_base(base) })
    });
    record(&mut out, "bases", belief(), loose.collect());
    let many = many();
    for (name, index) in [("many", 33), ("foreign", 75)] {
        let steps = one_of_many(index, 8, 2).into_iter().map(|r| Step::Touch(r.moved_by(pose)));
        record(&mut out, name, belief_of(&many, plain), steps.collect());
    }
    record_calibration(&mut out);
    out
}

fn record_calibration(out: &mut String) {
    let sensor = six_by_six();
    let readings: Vec<Vec<Reading>> = (0..N_OBJECTS).map(|o| touches(o, 12, 4)).collect();
    let held_back: Vec<HeldBack<'_>> =
        readings.iter().map(|readings| HeldBack { readings, sensor: &sensor, run: None }).collect();
    let calibration = calibrate(&MODEL, &held_back, SurfaceOptions::default(), 1);
    for (n, stage) in calibration.stages.iter().enumerate() {
        let [a, b, c] = [stage.temperature, stage.unknown, stage.unknown_per_touch];
        writeln!(out, "calibration {n} {:016x} {a:?} {b:?} {c:?}", 0).unwrap();
    }
}

#[test]
fn recorded_beliefs_stay_as_they_were() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/beliefs.txt");
    let found = recorded();
    let mode = std::env::var("GOLDEN").unwrap_or_default();
    if mode == "update" {
        std::fs::write(&path, &found).unwrap();
    }
    let expected = std::fs::read_to_string(&path).unwrap();
    assert_eq!(found.lines().count(), expected.lines().count());
    for (found, expected) in found.lines().zip(expected.lines()) {
        if mode == "exact" {
            assert_eq!(found, expected);
        }
        let split = |line: &str| -> (String, Vec<f64>) {
            let words: Vec<&str> = line.split(' ').collect();
            (words[..2].join(" "), words[3..].iter().map(|word| word.parse().unwrap()).collect())
        };
        let ((name, numbers), (expected_name, expected)) = (split(found), split(expected));
        assert_eq!((&name, numbers.len()), (&expected_name, expected.len()));
        for (number, expected) in numbers.iter().zip(&expected) {
            let off = (number - expected).abs();
            assert!(off <= 1e-3 * (1.0 + expected.abs()), "{name}: {number}, expected {expected}");
        }
    }
}
