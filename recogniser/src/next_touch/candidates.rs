//! Own approaches: against patches of the samples' objects, and a few at random.
//!
//! Each begins outside its target object and moves against the surface's normal. It is drawn
//! again if it would meet another part of that object first. One in eight is blind: it passes
//! near the centre of the object from a random direction, since the samples may be wrong.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::{Approach, NextTouchOptions};
use crate::belief::PoseSample;
use crate::model::SurfaceMap;
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;
use palpate_core::units::MM;

/// Least distance outside the object at which an approach begins, metres.
const CLEARANCE: f64 = 30.0 * MM;

/// One approach in this many is blind.
const BLIND_EVERY: usize = 8;

/// Maximum number of draws of an approach that would meet another part first.
const DRAWS_MAX: usize = 4;

/// Least distance of a hiding patch ahead of the target along the way out, metres.
const AHEAD_MIN: f32 = 0.008;

/// Largest distance of a hiding patch from the way out, in spacings.
const BESIDE_SPACINGS: f32 = 0.75;

/// Radius about the centre through which blind approaches pass, in radii of the object.
const BLIND_RADII: f64 = 0.5;

/// Approaches towards the samples' objects; none without samples.
pub(super) fn own_approaches(
    maps: &[Arc<SurfaceMap>],
    samples: &[PoseSample],
    options: &NextTouchOptions,
    stream: &mut Stream,
) -> Vec<Approach> {
    let total: f64 = samples.iter().map(|sample| sample.probability).sum();
    if samples.is_empty() || total <= 0.0 {
        return Vec::new();
    }
    let approach = |index: usize| {
        let sample = drawn(samples, total * stream.uniform(0.0, 1.0));
        let map = &maps[sample.index()];
        if index % BLIND_EVERY == BLIND_EVERY - 1 {
            return blind(map, sample, stream);
        }
        directed(map, sample, stream)
    };
    (0..options.n_approaches).map(approach).collect()
}

/// The sample in which a running sum of probabilities reaches `place`.
fn drawn(samples: &[PoseSample], mut place: f64) -> &PoseSample {
    for candidate in samples {
        place -= candidate.probability;
        if place < 0.0 {
            return candidate;
        }
    }
    &samples[samples.len() - 1]
}

/// An approach against a patch of an object, from outside it.
fn directed(map: &SurfaceMap, sample: &PoseSample, stream: &mut Stream) -> Approach {
    let mut approach = None;
    for _ in 0..DRAWS_MAX {
        let patch = &map.patches()[stream.index(map.patches().len())];
        let (target, outward) = (patch.position.as_dvec3(), patch.normal.as_dvec3());
        approach = Some(toward(map, sample, target, outward, stream));
        if !is_hidden(map, target, outward) {
            break;
        }
    }
    approach.unwrap_or_else(|| blind(map, sample, stream))
}

/// Whether another part of the surface lies before a point of it along its way out.
fn is_hidden(map: &SurfaceMap, target: DVec3, outward: DVec3) -> bool {
    hidden_by(map, target, outward).is_some()
}

/// Distance (m) from a point of the surface along its way out to the nearest other part of the
/// surface; `None` if the way is free.
pub(super) fn hidden_by(map: &SurfaceMap, target: DVec3, outward: DVec3) -> Option<f64> {
    let (target, outward) = (target.as_vec3(), outward.as_vec3());
    let ahead = map.patches().iter().filter_map(|patch| {
        let off = patch.position - target;
        let ahead = off.dot(outward);
        let beside = off - ahead * outward;
        let is_near = beside.length_squared() < (BESIDE_SPACINGS * map.spacing()).powi(2);
        (ahead > AHEAD_MIN && is_near).then_some(ahead)
    });
    ahead.reduce(f32::min).map(f64::from)
}

/// A straight way from outside an object to a point of it and on, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    /// Distance of its beginning from the point.
    pub(super) stand_off: f64,
    /// Its length, as far beyond the object on the other side.
    pub(super) reach: f64,
}

/// The way to a point of an object against the direction `outward`.
pub(super) fn way_to(map: &SurfaceMap, target: DVec3, outward: DVec3) -> Way {
    let radius = f64::from(map.reach());
    // Where the way out leaves the ball about the object: |target + s·outward| = radius.
    let along = target.dot(outward);
    let within = (along * along + radius * radius - target.length_squared()).max(0.0);
    let leaves = within.sqrt() - along;
    Way { stand_off: leaves + CLEARANCE, reach: CLEARANCE + 2.0 * within.sqrt() + CLEARANCE }
}

/// A blind approach: past the centre of an object from a random direction.
fn blind(map: &SurfaceMap, sample: &PoseSample, stream: &mut Stream) -> Approach {
    let radius = f64::from(map.reach());
    let target = BLIND_RADII * radius * stream.uniform(0.0, 1.0).cbrt() * stream.direction();
    let outward = stream.direction();
    toward(map, sample, target, outward, stream)
}

/// An approach from outside an object to a point of it, and beyond as far as its reach allows.
fn toward(
    map: &SurfaceMap,
    sample: &PoseSample,
    target: DVec3,
    outward: DVec3,
    stream: &mut Stream,
) -> Approach {
    let Way { stand_off, reach } = way_to(map, target, outward);
    let roll = DQuat::from_rotation_z(stream.uniform(0.0, TAU));
    let facing = DQuat::from_rotation_arc(DVec3::Z, -outward) * roll;
    let object_from_sensor = Pose::from_parts(facing, target + stand_off * outward);
    Approach {
        session_from_sensor: sample.session_from_object * object_from_sensor,
        reach,
        cost: None,
    }
}
