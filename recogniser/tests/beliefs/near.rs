//! Touches near each other: as they approach, the belief of several approaches that of one, without
//! a jump on the way (equations R2 and R17a). A sensor that stays feels new places of an object
//! that moves.

use glam::DVec3;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::{Looseness, Reading, SensorId};
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::next_touch::{NextTouchOptions, rank};
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::pose_prior::{PoseHypothesis, PosePrior};

use crate::ellipsoids::*;

/// Largest change of a probability over 0.1 mm.
const JUMP: f64 = 0.06;

/// The same where poses tell: at every distance other pairs of patches propose others, or others are
/// drawn. The largest is far from the other touches, at 19 mm.
const JUMP_OF_POSES: f64 = 0.15;

/// Largest difference between a touch and the same touched again at 0.3 mm.
const SAME: f64 = 2e-3;

/// The probability of each object, then of "none of these".
fn believed(readings: &[Reading]) -> Vec<f64> {
    felt(belief(), readings).posterior()
}

fn felt(mut belief: SurfaceBelief, readings: &[Reading]) -> SurfaceBelief {
    readings.iter().for_each(|reading| belief.add(reading, &six_by_six()));
    belief
}

fn beside(reading: &Reading, off: DVec3) -> Reading {
    reading.moved_by(Pose::from_parts(glam::DQuat::IDENTITY, off))
}

/// Directions along the sensor's axes, the last off the surface.
fn directions(reading: &Reading) -> [DVec3; 3] {
    DVec3::AXES.map(|axis| reading.session_from_sensor().turn(axis))
}

/// Distances from 0 to 20 mm, 0.1 mm apart.
fn distances() -> impl Iterator<Item = f64> {
    (0..=200).map(|step| f64::from(step) * 0.1 * MM)
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Checks the beliefs of `at` over all distances: that of `limit` at 0.3 mm and less, and no jump.
#[track_caller]
fn check(limit: &[f64], jump_max: f64, name: &str, at: impl Fn(f64) -> Vec<f64>) {
    let mut before: Option<Vec<f64>> = None;
    for distance in distances() {
        let now = at(distance);
        if distance < 0.35 * MM {
            let off = difference(&now, limit);
            assert!(off < SAME, "{name}: {off} at {distance} m: {now:?} {limit:?}");
        }
        let jump = before.map_or(0.0, |before| difference(&before, &now));
        assert!(jump < jump_max, "{name}: {jump} at {distance} m: {now:?}");
        before = Some(now);
    }
}

#[test]
fn a_second_touch_passes_over_to_the_first() {
    for (object, first) in (0..N_OBJECTS).map(|object| (object, touches(object, 3, 2).remove(2))) {
        let one = believed(std::slice::from_ref(&first));
        for (axis, along) in directions(&first).into_iter().enumerate() {
            let at = |distance| believed(&[first.clone(), beside(&first, distance * along)]);
            check(&one, JUMP, &format!("object {object}, axis {axis}"), at);
        }
    }
}

#[test]
fn three_touches_pass_over_to_one() {
    for object in 0..N_OBJECTS {
        let first = touches(object, 3, 2).remove(2);
        let one = believed(std::slice::from_ref(&first));
        let [x, y, _] = directions(&first);
        let at = |distance: f64| {
            let around = [DVec3::ZERO, x, y].map(|along| beside(&first, distance * along));
            believed(&around)
        };
        check(&one, JUMP_OF_POSES, &format!("object {object}"), at);
    }
}

#[test]
fn a_touch_beside_one_of_many_passes_over_to_it() {
    for n in 2..=5 {
        let many = touches(1, n, 3);
        let without = believed(&many);
        let [x, ..] = directions(&many[0]);
        let at = |distance: f64| believed(&[&many[..], &[beside(&many[0], distance * x)]].concat());
        check(&without, JUMP_OF_POSES, &format!("{n} touches"), at);
    }
}

#[test]
fn a_second_touch_beside_a_stated_pose_passes_over() {
    let first = touches(1, 3, 2).remove(2).moved_by(some_pose(5));
    let hypothesis = PoseHypothesis {
        object: Some(ObjectIdx(1)),
        session_from_object: some_pose(5),
        covariance: PoseHypothesis::diagonal(0.01, 0.17),
        weight: 1.0,
    };
    let said = PosePrior { hypotheses: vec![hypothesis], ..PosePrior::default() };
    let after =
        |readings: &[Reading]| felt(belief().with_pose_prior(&said).unwrap(), readings).posterior();
    let one = after(std::slice::from_ref(&first));
    let [x, ..] = directions(&first);
    check(&one, JUMP_OF_POSES, "stated", |distance| {
        after(&[first.clone(), beside(&first, distance * x)])
    });
}

#[test]
fn a_doubled_touch_leaves_the_next_one_as_it_was() {
    let first = touches(1, 3, 2).remove(2);
    let next = |readings: &[Reading]| {
        let options = NextTouchOptions::default();
        let ranking = rank(&felt(belief(), readings), None, &options, &mut || false).unwrap();
        (ranking.ranked[0].approach, ranking.ranked[0].identity_bits)
    };
    let one = next(std::slice::from_ref(&first));
    for distance in [0.05 * MM, 0.3 * MM, 0.8 * MM] {
        let [x, ..] = directions(&first);
        assert_eq!(next(&[first.clone(), beside(&first, distance * x)]), one, "{distance} m");
    }
}

#[test]
fn a_miss_that_comes_again_says_nothing_new() {
    let many = touches(1, 4, 3);
    let missed = |n: usize| {
        // Through the middle of the object, where it cannot have been free.
        let at = Pose::from_parts(glam::DQuat::IDENTITY, DVec3::Z * 0.01);
        let miss = Reading::new(SensorId(0), &six_by_six(), &[Some(0.0); 36], at).unwrap();
        let misses = vec![miss.after_approach(0.05); n];
        [&many[..], &misses[..]].concat()
    };
    let [none, once, often] = [0, 1, 20].map(|n| felt(belief(), &missed(n)).log_evidence());
    assert!(difference(&none, &once) > 0.2, "{none:?} {once:?}");
    assert!(difference(&once, &often) < 0.01, "{once:?} {often:?}");
}

#[test]
fn doubling_every_touch_costs_no_probability() {
    for n in 1..=6 {
        let gains = (0..24).map(|session| {
            let object = session % N_OBJECTS;
            let single = touches(object, n, 100 + session as u64);
            let twice = |reading: &Reading| {
                let [x, ..] = directions(reading);
                [reading.clone(), beside(reading, 0.3 * MM * x)]
            };
            let doubled: Vec<Reading> = single.iter().flat_map(twice).collect();
            believed(&doubled)[object] - believed(&single)[object]
        });
        let mean = gains.sum::<f64>() / 24.0;
        assert!(mean.abs() < 0.02, "{n} touches: {mean}");
    }
}

/// Touches of an object that turns under a sensor at rest, by about 10 mm and 0.5 rad each time.
fn turning_below(object: usize, n: usize, seed: u64) -> Vec<Reading> {
    let mut all = touches(object, 400, seed);
    let mut found = vec![all.swap_remove(0)];
    while found.len() < n {
        let before = found[found.len() - 1].session_from_sensor();
        let cost = |reading: &Reading| {
            let moved = reading.session_from_sensor().inverse() * before;
            let off = moved.translation.length() / (10.0 * MM);
            off.hypot(moved.rotation.to_scaled_axis().length() / 0.5)
        };
        let nearest = |a: &usize, b: &usize| cost(&all[*a]).total_cmp(&cost(&all[*b]));
        let next = (0..all.len()).min_by(nearest).unwrap();
        found.push(all.swap_remove(next));
    }
    let under = |reading: &Reading| {
        reading.moved_by(some_pose(5) * reading.session_from_sensor().inverse())
    };
    found.iter().map(under).collect()
}

#[test]
fn touches_of_a_resting_sensor_count_if_the_object_moves() {
    let after = |readings: &[Reading], position: f64, angle: f64| {
        let motion = Some(Looseness { position, angle });
        let options = SurfaceOptions { motion, ..SurfaceOptions::default() };
        felt(SurfaceBelief::new(MODEL.clone(), options, None).unwrap(), readings).posterior()
    };
    let mut learnt = 0.0;
    for session in 0..12 {
        let readings = turning_below(session % N_OBJECTS, 8, 200 + session as u64);
        let one = after(&readings[..1], 5.0 * MM, 0.25);
        learnt += difference(&one, &after(&readings, 5.0 * MM, 0.25)) / 12.0;
        // Next to no drift is rest.
        let (rests, barely) = (believed(&readings), after(&readings, 1e-9, 1e-9));
        assert!(difference(&rests, &barely) < SAME, "{rests:?} {barely:?}");
    }
    assert!(learnt > 0.1, "{learnt}");
}

#[test]
fn a_repeated_miss_counts_where_the_object_may_have_moved() {
    let many = touches(1, 4, 3);
    let drifting = |drift: f64, between: bool| {
        let motion = Some(Looseness { position: drift, angle: 0.0 });
        let options = SurfaceOptions { motion, ..SurfaceOptions::default() };
        let at = Pose::from_parts(glam::DQuat::IDENTITY, DVec3::Z * 0.01);
        let miss = Reading::new(SensorId(0), &six_by_six(), &[Some(0.0); 36], at).unwrap();
        let miss = miss.after_approach(0.05);
        let mut readings = many[..3].to_vec();
        readings.extend(between.then(|| miss.clone()));
        readings.extend([many[3].clone(), miss]);
        let belief = SurfaceBelief::new(MODEL.clone(), options, None).unwrap();
        felt(belief, &readings).log_evidence()
    };
    let gain = |drift| difference(&drifting(drift, true), &drifting(drift, false));
    let (rests, moves) = (gain(1e-6), gain(0.003));
    assert!(rests < 0.01 && moves > 0.1, "{rests} {moves}");
}
