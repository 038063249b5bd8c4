//! Tests of expected contacts, of the information of outcomes, and of the ranking.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::footprint::{ExpectedContact, Hand, Ray, meet};
use super::information::{Outcome, Scatter, information};
use super::*;
use crate::model::appearance::raw_dimension;
use crate::model::map::SurfaceLayout;
use crate::model::{AppearanceSpace, SurfaceMap, SurfacePatch};
use crate::model::{EvidenceCalibration, SurfaceModel};
use crate::options::SurfaceOptions;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_core::vocabulary::discriminant::Discriminant;

const HAND: Hand = Hand { half_width: 0.006, recenters: true };
const SCATTER: Scatter = Scatter { position: 0.0025, normal: 0.25, appearance: 4.0 };

fn patch(position: Vec3, normal: Vec3) -> SurfacePatch {
    SurfacePatch {
        position,
        normal,
        direction: normal.any_orthonormal_vector(),
        elongation: 0.0,
        normal_deviation: 0.0,
        feature: [0; 8],
    }
}

/// The six faces of a box about the origin with half edges in mm, a patch every 4 mm.
fn box_map(half: [i32; 3]) -> SurfaceMap {
    let mut patches = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [-1.0, 1.0] {
            for a in (-half[u]..=half[u]).step_by(4) {
                for b in (-half[v]..=half[v]).step_by(4) {
                    let (mut position, mut normal) = ([0.0; 3], [0.0; 3]);
                    position[axis] = side * half[axis] as f32 * 1e-3;
                    position[u] = a as f32 * 1e-3;
                    position[v] = b as f32 * 1e-3;
                    normal[axis] = side;
                    patches.push(patch(position.into(), normal.into()));
                }
            }
        }
    }
    SurfaceMap::new(DVec3::ZERO, patches, SurfaceLayout::default())
}

fn model(halves: &[[i32; 3]]) -> Arc<SurfaceModel> {
    let grid = *SensorDescription::digitacts_6x6().grid();
    let dimension = raw_dimension(&grid);
    let projection = Discriminant { mean: vec![0.0; dimension], axes: vec![vec![0.0; dimension]] };
    let space = AppearanceSpace::new(grid, projection, vec![[0; 8]]);
    let maps = halves.iter().map(|half| Arc::new(box_map(*half))).collect();
    Arc::new(SurfaceModel::new(space, EvidenceCalibration::default(), maps))
}

fn belief(halves: &[[i32; 3]]) -> SurfaceBelief {
    SurfaceBelief::new(model(halves), SurfaceOptions::default(), None).unwrap()
}

/// A touch at a point, the sensor looking along a direction.
fn touch(at: DVec3, along: DVec3) -> (Reading, SensorDescription) {
    let sensor = SensorDescription::digitacts_6x6();
    let rotation = glam::DQuat::from_rotation_arc(DVec3::Z, along);
    let pressures = vec![Some(10_000.0); 36];
    let pose = Pose::from_parts(rotation, at);
    (Reading::new(SensorId(0), &sensor, &pressures, pose).unwrap(), sensor)
}

fn approach(start: DVec3, along: DVec3) -> Approach {
    let rotation = glam::DQuat::from_rotation_arc(DVec3::Z, along);
    Approach { session_from_sensor: Pose::from_parts(rotation, start), reach: 0.2, cost: None }
}

fn ray(start: [f32; 3], direction: [f32; 3], reach: f32) -> Ray {
    Ray { start: start.into(), direction: Vec3::from(direction).normalize(), reach }
}

#[test]
fn a_ray_meets_the_face_before_it_and_no_farther_than_it_goes() {
    let map = box_map([20, 20, 10]);
    let down = [0.0, 0.0, -1.0];
    let (met, lie) = meet(&map, &ray([0.0, 0.0, 0.1], down, 0.2), &HAND).unwrap();
    assert!(met.position.distance(Vec3::new(0.0, 0.0, 0.01)) < 1e-6, "{met:?}");
    assert!(met.normal.distance(Vec3::Z) < 1e-6);
    assert!((lie.facing - 1.0).abs() < 1e-6 && lie.filled > 0.7, "{lie:?}");
    assert_eq!(meet(&map, &ray([0.0, 0.0, 0.1], down, 0.089), &HAND), None, "ends before it");
    assert_eq!(meet(&map, &ray([0.05, 0.0, 0.1], down, 0.2), &HAND), None, "passes by");
    assert_eq!(meet(&map, &ray([0.0, 0.0, 0.1], [0.0, 0.0, 1.0], 0.2), &HAND), None, "goes away");
}

#[test]
fn grazing_and_edges_make_a_contact_less_probable() {
    let map = box_map([20, 20, 10]);
    let contact = |ray: Ray, recenters| {
        meet(&map, &ray, &Hand { recenters, ..HAND }).map_or(0.0, |(met, _)| met.contact)
    };
    let square = ray([0.0, 0.0, 0.1], [0.0, 0.0, -1.0], 0.2);
    let tilted = ray([-0.1, 0.0, 0.068], [1.0, 0.0, -0.6], 0.3);
    let edge = ray([0.024, 0.0, 0.1], [0.0, 0.0, -1.0], 0.2);
    for recenters in [false, true] {
        assert!(contact(square, recenters) > contact(tilted, recenters) + 0.1, "{recenters}");
        assert!(contact(square, recenters) > contact(edge, recenters) + 0.01, "{recenters}");
    }
    assert!(contact(edge, true) > contact(edge, false) + 0.05);
}

fn outcome(object: u32, probability: f32, height: Option<f32>) -> Outcome {
    let met = height.map(|z| ExpectedContact {
        contact: 1.0,
        position: Vec3::new(0.0, 0.0, z),
        normal: Vec3::Z,
        normal_deviation: 0.0,
        feature: [0; 8],
    });
    Outcome { object: ObjectIdx(object), probability, met }
}

#[test]
fn telling_four_equal_objects_apart_is_worth_two_bits() {
    let apart: Vec<Outcome> = (0..4).map(|n| outcome(n, 0.25, Some(0.05 * n as f32))).collect();
    let bits = information(&apart, 0.0, &SCATTER);
    // Distinct outcomes keep a likeness of 1 %: log2(4 / (1 + 3 · 0.01)) = 1.957.
    assert!((bits.identity - 1.957).abs() < 1e-3, "{bits:?}");
    assert!(bits.pose.abs() < 1e-6, "one pose each: {bits:?}");
    let alike: Vec<Outcome> = (0..4).map(|n| outcome(n, 0.25, Some(0.05))).collect();
    assert!(information(&alike, 0.0, &SCATTER).identity.abs() < 1e-5);
}

#[test]
fn poses_of_one_object_give_bits_on_the_pose_only() {
    let poses = [outcome(0, 0.5, Some(0.0)), outcome(0, 0.5, Some(0.05))];
    let bits = information(&poses, 0.0, &SCATTER);
    // log2(1 / (0.5 + 0.5 · 0.01)) = 0.986.
    assert!(bits.identity.abs() < 1e-6 && (bits.pose - 0.986).abs() < 1e-3, "{bits:?}");
    let missed = [outcome(0, 0.5, Some(0.0)), outcome(1, 0.5, None)];
    let bits = information(&missed, 0.0, &SCATTER);
    assert!((bits.identity - 0.986).abs() < 1e-3, "{bits:?}");
    // 2.5 mm is one deviation: the likeness is exp(−1/8) = 0.8825; log2(2 / 1.8825) = 0.0874.
    let near = [outcome(0, 0.5, Some(0.0)), outcome(1, 0.5, Some(0.002_5))];
    assert!((information(&near, 0.0, &SCATTER).identity - 0.0874).abs() < 1e-3);
}

/// A flat plate and a thick one share a face and differ only from the side.
#[test]
fn the_press_that_tells_objects_apart_comes_first() {
    let mut belief = belief(&[[24, 24, 4], [24, 24, 16]]);
    // The corners of the large face, which fit no other face of the thick plate.
    for (x, y) in [(0.022, 0.022), (-0.022, 0.022), (0.022, -0.022), (-0.022, -0.022)] {
        let (reading, sensor) = touch(DVec3::new(x, y, 0.0), DVec3::NEG_Z);
        belief.add(&reading, &sensor);
    }
    let approaches = [
        approach(DVec3::new(0.01, 0.01, 0.1), DVec3::NEG_Z), // onto the shared face
        approach(DVec3::new(0.0, 0.0, -0.1), DVec3::Z),      // onto the back: 8 or 32 mm deep
        approach(DVec3::new(0.3, 0.3, 0.1), DVec3::NEG_Z),   // past everything
    ];
    let options = NextTouchOptions::default();
    let ranking = rank(&belief, Some(&approaches), &options, &mut || false).unwrap();
    let order: Vec<usize> = ranking.ranked.iter().map(|ranked| ranked.index).collect();
    assert_eq!(order, [1, 0, 2], "{ranking:?}");
    let [best, shared, past] = [0, 1, 2].map(|place| ranking.ranked[place]);
    assert!(best.identity_bits > 1.1 * shared.identity_bits, "{ranking:?}");
    assert!(best.contact_probability > 0.7 && past.contact_probability.abs() < 1e-9);
    assert!(ranking.is_complete && ranking.entropy_bits > 0.3);
    // With a high cost the best approach loses the first rank.
    let mut costly = approaches;
    costly.iter_mut().for_each(|approach| approach.cost = Some(1.0));
    costly[1].cost = Some(1e3);
    let ranking = rank(&belief, Some(&costly), &options, &mut || false).unwrap();
    assert_eq!(ranking.ranked[0].index, 0, "{ranking:?}");
    assert!(ranking.ranked.is_sorted_by(|a, b| a.worth() >= b.worth()), "{ranking:?}");
}

#[test]
fn equal_seeds_give_equal_answers_and_a_stop_leaves_a_valid_one() {
    let mut belief = belief(&[[24, 24, 4], [12, 12, 40]]);
    let (reading, sensor) = touch(DVec3::new(0.3, 0.2, 0.1), DVec3::X);
    belief.add(&reading, &sensor);
    let options = NextTouchOptions { seed: 7, ..NextTouchOptions::default() };
    let ask = |options: &NextTouchOptions| rank(&belief, None, options, &mut || false).unwrap();
    let whole = ask(&options);
    assert_eq!(whole, ask(&options));
    assert_ne!(whole.ranked, ask(&NextTouchOptions { seed: 8, ..options }).ranked);
    assert_eq!(whole.ranked.len(), options.n_approaches);
    let with_later = |ranked: &Ranked| ranked.worth() + ranked.later_worth;
    let (firsts, others) = whole.ranked.split_at(ahead::FIRSTS);
    assert!(firsts.is_sorted_by(|a, b| with_later(a) >= with_later(b)), "{firsts:?}");
    assert!(
        firsts.iter().all(|first| first.later_worth > 0.0 && first.worth() >= others[0].worth())
    );
    assert!(others.is_sorted_by(|a, b| a.worth() >= b.worth()), "{others:?}");
    assert!(others.iter().all(|other| other.later_worth.abs() < 1e-12), "{others:?}");
    let mut asked = 0;
    let mut stop = || {
        asked += 1;
        asked == 5
    };
    let cut = rank(&belief, None, &options, &mut stop).unwrap();
    assert_eq!((cut.ranked.len(), cut.is_complete), (5, false));
    let alone = |ranked: &Ranked| Ranked { later_worth: 0.0, ..*ranked };
    let whole: Vec<Ranked> = whole.ranked.iter().map(alone).collect();
    let in_both = |ranked: &Ranked| whole.contains(ranked);
    assert!(cut.ranked.iter().all(in_both), "the first five are the same");
    // All are evaluated, then time is up before the second press is looked at.
    let mut asked = 0;
    let mut stop = || {
        asked += 1;
        asked == options.n_approaches
    };
    let one_ahead = rank(&belief, None, &options, &mut stop).unwrap();
    assert_eq!((one_ahead.ranked.len(), one_ahead.is_complete), (options.n_approaches, false));
    assert!(one_ahead.ranked.is_sorted_by(|a, b| a.worth() >= b.worth()), "{one_ahead:?}");
}

#[test]
fn own_approaches_begin_outside_and_mostly_touch() {
    let mut belief = belief(&[[24, 24, 4]]);
    let truth = Pose::from_parts(glam::DQuat::from_rotation_x(0.7), DVec3::new(0.2, 0.0, 0.1));
    for (x, y) in [(0.0, 0.0), (0.02, 0.0), (0.0, 0.02), (-0.02, 0.01)] {
        let at = truth * DVec3::new(x, y, 0.004);
        let (reading, sensor) = touch(at, truth.turn(DVec3::NEG_Z));
        belief.add(&reading, &sensor);
    }
    let options = NextTouchOptions::default();
    let ranking = rank(&belief, None, &options, &mut || false).unwrap();
    let probable = ranking.ranked.iter().filter(|r| r.contact_probability > 0.5).count();
    assert!(probable > options.n_approaches / 2, "{probable}");
    for ranked in &ranking.ranked {
        let start = ranked.approach.session_from_sensor.translation;
        // The plate's corners are 34 mm from its centre.
        assert!(start.distance(truth.translation) > 0.034, "{start}");
    }
}

#[test]
fn before_the_first_touch_a_workspace_is_needed_and_enough() {
    let belief = belief(&[[24, 24, 4], [12, 12, 40]]);
    let options = NextTouchOptions::default();
    let nothing = rank(&belief, None, &options, &mut || false);
    assert_eq!(nothing, Err(NextTouchError::NoTouch));
    let center = DVec3::new(0.3, 0.0, 0.2);
    let workspace = Some(Workspace { center, radius: 0.06 });
    let known = NextTouchOptions { workspace, ..options };
    let ranking = rank(&belief, None, &known, &mut || false).unwrap();
    let best = ranking.ranked[0];
    assert!(best.contact_probability > 0.2, "{best:?}");
    let past = best.approach.session_from_sensor;
    let (off, along) = (center - past.translation, past.turn(DVec3::Z));
    assert!((off - off.dot(along) * along).length() < 0.06, "aims into the workspace");
}

#[test]
fn a_surely_unknown_object_still_gets_approaches() {
    let sure = SurfaceOptions { unknown: 1.0, ..SurfaceOptions::default() };
    let mut belief = SurfaceBelief::new(model(&[[24, 24, 4], [12, 12, 40]]), sure, None).unwrap();
    for x in [-0.01, 0.0, 0.012] {
        let (reading, sensor) = touch(DVec3::new(x, 0.005, 0.0), DVec3::NEG_Z);
        belief.add(&reading, &sensor);
        assert!((belief.posterior()[2] - 1.0).abs() < 1e-12, "{:?}", belief.posterior());
        let ranking = rank(&belief, None, &NextTouchOptions::default(), &mut || false).unwrap();
        assert!(!ranking.ranked.is_empty());
        assert!(ranking.ranked[0].contact_probability > 0.25, "{:?}", ranking.ranked[0]);
    }
}
