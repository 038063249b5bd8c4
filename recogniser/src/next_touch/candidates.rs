//! Approaches of our own: against mapped touches of what the belief expects, and a few blind.
//!
//! Each begins outside of the object that it aims at and goes against the surface's
//! normal. Those that would meet another part of that object first are drawn
//! again. One in eight goes past the middle of the believed object from anywhere, since what
//! is expected may be wrong.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::{Approach, NextTouchOptions};
use crate::belief::Expected;
use crate::model::SurfaceModel;
use crate::surface::SurfaceMap;
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;
use palpate_core::units::MM;

/// How far outside of the object an approach begins at least, metres.
const CLEARANCE: f64 = 30.0 * MM;

/// The share of approaches that are blind: one in so many.
const BLIND_EVERY: usize = 8;

/// How often an approach is drawn again that would meet another part first.
const DRAWS_MAX: usize = 4;

/// How far from the object's origin its touches are, metres.
pub(super) fn radius_of(map: &SurfaceMap) -> f32 {
    map.patches().iter().map(|patch| patch.position.length()).fold(0.0, f32::max)
}

/// Approaches to what is expected; none when nothing is.
pub(super) fn own_approaches(
    model: &SurfaceModel,
    expected: &[Expected],
    options: &NextTouchOptions,
    stream: &mut Stream,
) -> Vec<Approach> {
    let total: f64 = expected.iter().map(|expected| expected.probability).sum();
    if expected.is_empty() || total <= 0.0 {
        return Vec::new();
    }
    let approach = |index: usize| {
        let expected = drawn(expected, total * stream.uniform(0.0, 1.0));
        let map = &model.maps()[expected.object.0 as usize];
        if index % BLIND_EVERY == BLIND_EVERY - 1 {
            return blind(map, expected, stream);
        }
        directed(map, expected, stream)
    };
    (0..options.n_approaches).map(approach).collect()
}

/// The one of what is expected in which a running sum of probabilities reaches `place`.
fn drawn(expected: &[Expected], mut place: f64) -> &Expected {
    for candidate in expected {
        place -= candidate.probability;
        if place < 0.0 {
            return candidate;
        }
    }
    &expected[expected.len() - 1]
}

/// Against a mapped touch of an object, from outside of it.
fn directed(map: &SurfaceMap, expected: &Expected, stream: &mut Stream) -> Approach {
    let mut approach = None;
    for _ in 0..DRAWS_MAX {
        let patch = &map.patches()[stream.index(map.patches().len())];
        let (target, outward) = (patch.position.as_dvec3(), patch.normal.as_dvec3());
        approach = Some(toward(map, expected, target, outward, stream));
        if !is_hidden(map, target, outward) {
            break;
        }
    }
    approach.unwrap_or_else(|| blind(map, expected, stream))
}

/// Whether another part of the surface lies before a point of it along its way out.
fn is_hidden(map: &SurfaceMap, target: DVec3, outward: DVec3) -> bool {
    let (target, outward) = (target.as_vec3(), outward.as_vec3());
    map.patches().iter().any(|patch| {
        let off = patch.position - target;
        let ahead = off.dot(outward);
        let beside = off - ahead * outward;
        ahead > 0.008 && beside.length_squared() < (0.75 * map.spacing()).powi(2)
    })
}

/// Past the middle of an object, from anywhere.
fn blind(map: &SurfaceMap, expected: &Expected, stream: &mut Stream) -> Approach {
    let radius = f64::from(radius_of(map));
    let target = 0.5 * radius * stream.uniform(0.0, 1.0).cbrt() * stream.direction();
    let outward = stream.direction();
    toward(map, expected, target, outward, stream)
}

/// From outside of an object to a point of it, and as far beyond as it may reach.
fn toward(
    map: &SurfaceMap,
    expected: &Expected,
    target: DVec3,
    outward: DVec3,
    stream: &mut Stream,
) -> Approach {
    let radius = f64::from(radius_of(map));
    // Where the way out leaves the ball about the object: |target + s·outward| = radius.
    let along = target.dot(outward);
    let within = (along * along + radius * radius - target.length_squared()).max(0.0);
    let leaves = within.sqrt() - along;
    let stand_off = leaves + CLEARANCE;
    let roll = DQuat::from_rotation_z(stream.uniform(0.0, TAU));
    let facing = DQuat::from_rotation_arc(DVec3::Z, -outward) * roll;
    let object_from_sensor = Pose::from_parts(facing, target + stand_off * outward);
    Approach {
        session_from_sensor: expected.session_from_object * object_from_sensor,
        reach: CLEARANCE + 2.0 * within.sqrt() + CLEARANCE,
        cost: None,
    }
}
