//! How readings lie on an object: what an explanation shows about each.

use glam::{DQuat, DVec3};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::units::MM;
use palpate_recogniser::belief::{Misfit, SurfaceBelief};

use crate::ellipsoids::*;

const OBJECT: usize = 1;

fn misfit(belief: &SurfaceBelief, object: usize, reading: &Reading) -> Misfit {
    belief.misfit(ObjectIdx(object as u32), reading, &six_by_six()).unwrap()
}

/// Misfits of another session's touches, each displaced in its own sensor's frame.
fn displaced(belief: &SurfaceBelief, pose: &Pose, by: Pose) -> Vec<Misfit> {
    let readings = touches(OBJECT, 20, 77);
    let moved = readings.iter().map(|reading| {
        let own = reading.session_from_sensor();
        reading.moved_by(*pose * own * by * own.inverse())
    });
    moved.map(|reading| misfit(belief, OBJECT, &reading)).collect()
}

fn mean(misfits: &[Misfit], of: impl Fn(&Misfit) -> Option<f64>) -> f64 {
    let found: Vec<f64> = misfits.iter().filter_map(of).collect();
    assert!(found.len() >= 15, "{misfits:?}");
    found.iter().sum::<f64>() / found.len() as f64
}

#[test]
fn a_misfit_names_the_height_the_turn_and_the_image() {
    let pose = some_pose(4);
    let belief = recognise(OBJECT, pose, 12);
    let right = displaced(&belief, &pose, Pose::IDENTITY);
    assert!(mean(&right, |m| m.height).abs() < 0.4 * MM);
    assert!(mean(&right, |m| m.turn) < 0.2);
    assert!(mean(&right, |m| m.appearance) > 0.0, "{right:?}");
    // The sensor looks along its +z at the object: back by 2 mm is 2 mm above the surface.
    let back = Pose::from_parts(DQuat::IDENTITY, DVec3::Z * -2.0 * MM);
    let high = displaced(&belief, &pose, back);
    assert!((mean(&high, |m| m.height) - 2.0 * MM).abs() < 0.5 * MM, "{high:?}");
    let tilted =
        displaced(&belief, &pose, Pose::from_parts(DQuat::from_rotation_x(0.5), DVec3::ZERO));
    assert!((mean(&tilted, |m| m.turn) - 0.5).abs() < 0.15, "{tilted:?}");
}

#[test]
fn a_miss_inside_the_object_is_contradicted_and_no_touch() {
    let pose = some_pose(4);
    let belief = recognise(OBJECT, pose, 12);
    let silent = |at: DVec3| {
        let pose = pose * Pose::from_parts(DQuat::IDENTITY, at);
        Reading::new(palpate_core::reading::SensorId(0), &six_by_six(), &[Some(0.0); 36], pose)
            .unwrap()
    };
    let inside = misfit(&belief, OBJECT, &silent(DVec3::ZERO));
    assert!(!inside.is_touch && inside.height.is_none());
    assert!(inside.free_space < -1.0, "{inside:?}");
    let outside = misfit(&belief, OBJECT, &silent(DVec3::X));
    assert!(outside.free_space.abs() < 1e-9, "{outside:?}");
}

#[test]
fn without_poses_there_is_no_misfit() {
    let reading = touches(OBJECT, 1, 77).remove(0);
    assert_eq!(belief().misfit(ObjectIdx(0), &reading, &six_by_six()), None);
    let belief = recognise(OBJECT, some_pose(4), 12);
    assert_eq!(belief.misfit(ObjectIdx(99), &reading, &six_by_six()), None);
}
