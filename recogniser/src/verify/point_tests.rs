//! Tests of contacts without an image: their density, their loss, and the free space of misses.

use glam::{DVec3, Quat, Vec3};
use palpate_core::reading::SensorId;
use palpate_core::reading::point_contact::{ContactNumbers, PointContact};
use palpate_core::units::MM;

use super::density::Kernel;
use super::free_space::contradiction;
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::{Observation, Says};
use crate::observe::press_space::PressSpace;
use crate::observe::touch::{PointDeviations, Touch, observe_contact};
use crate::options::SurfaceOptions;
use crate::test_support::{inverse, map_of, places, some_pose, space};

fn as_contact(place: &Touch, position: f64, normal: Option<f64>) -> Touch {
    let point = Some(PointDeviations { position, normal });
    let felt = if normal.is_some() { place.normal } else { DVec3::ZERO };
    Touch { normal: felt, elongation: 0.0, point, ..place.clone() }
}

/// The observation of a place as a contact, with the object at `some_pose(0)`.
fn felt(place: &Touch, position: f64, normal: Option<f64>) -> Observation {
    let contact = as_contact(place, position, normal);
    let pose = some_pose(0);
    let moved = Touch {
        position: pose * contact.position,
        normal: pose.turn(contact.normal),
        direction: pose.turn(contact.direction),
        ..contact
    };
    Observation::new(&moved, DVec3::ZERO, &space(), &SurfaceOptions::default().scale)
}

#[test]
fn a_contact_on_the_only_patch_scores_as_computed_by_hand() {
    let place = places(1, 0);
    let (map, kernel) = (map_of(&place), Kernel::new(&SurfaceOptions::default()));
    let score = |touch| kernel.score(&map, &inverse(&some_pose(0)), &touch);
    // 2 mm: 0.99 · 0.064 m³ / ((2π)^1.5 · √(0.7² + 2²) mm · (4² + 2²) mm²) = 94,925.
    let position = score(felt(&place[0], 2.0 * MM, None));
    assert!((position - 94_925f32.ln()).abs() < 0.02, "{position}");
    // A normal of 0.2 rad: 0.95 · 2/(0.1² + 0.07² + 0.2²) + 0.05 · ¾ · 2² = 34.76.
    let normal = score(felt(&place[0], 2.0 * MM, Some(0.2)));
    assert!((normal - (94_925f32 * 34.76).ln()).abs() < 0.02, "{normal}");
}

#[test]
fn a_less_certain_contact_says_less_and_excuses_more() {
    let place = places(1, 0);
    let (map, kernel) = (map_of(&place), Kernel::new(&SurfaceOptions::default()));
    let score = |touch: &Observation| kernel.score(&map, &inverse(&some_pose(0)), touch);
    let fits = [0.5, 2.0, 8.0].map(|mm| score(&felt(&place[0], mm * MM, None)));
    assert!(fits[0] > fits[1] + 1.0 && fits[1] > fits[2] + 1.0, "{fits:?}");
    let mut off = place[0].clone();
    off.position += 5.0 * MM * off.normal;
    let misfits = [0.5, 2.0, 8.0].map(|mm| score(&felt(&off, mm * MM, None)));
    assert!(misfits[1] > misfits[0] + 2.0, "{misfits:?}");
}

#[test]
fn what_a_contact_lacks_is_lost_under_every_object() {
    let place = &places(1, 0)[0];
    // ½ ln(1 + 2²/0.7²) + ln(1 + 2²/4²) = 1.331, and with a normal ln(1 + 0.2²/0.03) = 0.847.
    let loss = |normal| felt(place, 2.0 * MM, normal).loss(true, 1.2);
    assert!((loss(None) - 1.331).abs() < 0.01, "{}", loss(None));
    assert!((loss(Some(0.2)) - 2.178).abs() < 0.01, "{}", loss(Some(0.2)));
    let kinds = [None, Some(0.2)].map(|normal| Says::of(&as_contact(place, 0.001, normal)));
    assert_eq!(kinds, [Says::Position, Says::Normal]);
}

#[test]
fn a_contact_that_touched_nothing_contradicts_an_object_there() {
    let numbers = ContactNumbers {
        touched: false,
        position: [0.0; 3],
        position_deviation: 1e-4,
        normal: Some([0.0, 0.0, 1.0]),
        normal_deviation: Some(0.1),
        force: None,
    };
    let contact = |numbers| PointContact::new(SensorId(0), numbers).unwrap();
    assert!(observe_contact(&contact(numbers)).is_none());
    let map = map_of(&places(3_000, 0));
    let pose = InversePose::new(Quat::IDENTITY, Vec3::ZERO);
    let scale = SurfaceOptions::default().score;
    let lost = |contact: &PointContact| {
        let space = PressSpace::of_missed_contact(contact, DVec3::ZERO);
        contradiction(&space, &map, &pose, &scale)
    };
    // In the middle of the ellipsoid, half axes of 40, 30 and 20 mm: one point, 0.5.
    assert!((lost(&contact(numbers)) + 0.5).abs() < 0.01, "{}", lost(&contact(numbers)));
    // Below it, having come through along −z: more points, to the cap of 3.
    let below = ContactNumbers { position: [0.0, 0.0, -0.06], ..numbers };
    assert!(lost(&contact(below)).abs() < 1e-6, "beside the object");
    assert!((lost(&contact(below).after_approach(0.12)) + 3.0).abs() < 0.1);
    // A place known to 3 mm counts half.
    let vague = ContactNumbers { position_deviation: 0.003, ..numbers };
    assert!((lost(&contact(vague)) + 0.25).abs() < 0.01);
}
