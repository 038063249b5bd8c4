//! Interest points: how much a touch at each place of an object tells about which object it is.
//!
//! Source: section 6.1.4 of the dissertation asks for distinctive points; the measure is that of
//! next touches. The object's rivals lie in its frame as its own touches place them, in the poses
//! in which they look most like it, and all are as probable as the object. The information of a
//! touch at a place is then the term of the object in the pairwise bound (equation R27a), in bits.
//! A place where all rivals have the same surface has 0 bits, one that no rival has almost log₂ of
//! the number of objects. Frames: the object's. Deterministic. Not here: what a touch tells while
//! no pose is known (its appearance alone), and "none of these".

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::stop::Stop;
use rayon::prelude::*;

use super::candidates::{Way, hidden_by, way_to};
use super::footprint::Hand;
use super::information::{Outcome, alike, bits_if_true};
use super::{Approach, NextTouchOptions, outcome, scatter};
use crate::belief::{PoseSample, SurfaceBelief};
use crate::model::{SurfaceMap, SurfaceModel, SurfacePatch};
use crate::options::SurfaceOptions;

/// Maximum number of places of an object: the first patches of its map, which cover it evenly.
pub const PLACES_MAX: usize = 500;

/// Maximum number of rivals.
pub const RIVALS_MAX: usize = 31;

/// Touches of the object that choose its rivals in a larger catalogue.
const CHOSEN_BY: usize = 8;

/// Touches of the object that place a rival.
const PLACED_BY: usize = 24;

/// Maximum number of poses of a rival.
const POSES_MAX: usize = 4;

/// A place of an object's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InterestPlace {
    /// Position, metres.
    pub position: Vec3,
    /// Outward normal, norm 1.
    pub normal: Vec3,
    /// Information of a touch there on the identity, bits.
    pub bits: f64,
}

/// An object that the touches of another one resemble.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rival {
    /// The object.
    pub object: ObjectIdx,
    /// Mean over the places of the likeness of a touch to that of the other object, 0.01 to 1.
    pub likeness: f64,
}

/// How much touches tell of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct Interest {
    /// The places, in the order of the map's patches.
    pub places: Vec<InterestPlace>,
    /// The objects that it is compared with, most alike first; none in a catalogue of one object.
    pub rivals: Vec<Rival>,
}

impl Interest {
    /// Bits of a touch that no rival could give: log₂ of the number of rivals and the object.
    #[must_use]
    pub fn bits_max(&self) -> f64 {
        (1.0 + self.rivals.len() as f64).log2()
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.places.capacity() * size_of::<InterestPlace>()
            + self.rivals.capacity() * size_of::<Rival>()
    }
}

/// The interest of the places of an object of the model. `stop` ends the work early.
///
/// At most [`PLACES_MAX`] places against at most [`RIVALS_MAX`] rivals: of a larger catalogue those
/// with the most evidence after eight touches spread over the object.
#[must_use]
pub fn interest(model: &Arc<SurfaceModel>, object: ObjectIdx, stop: &Stop) -> Interest {
    let map = &model.maps()[object.0 as usize];
    let rivals = rivals(model, object, stop);
    let placed: Vec<Vec<PoseSample>> =
        rivals.par_iter().map(|rival| poses(model, *rival, map, stop)).collect();
    let n = map.patches().len().min(PLACES_MAX);
    let likenesses: Vec<Vec<f32>> = map.patches()[..n]
        .par_iter()
        .map(|patch| {
            stop.check();
            likenesses(model.maps(), object, patch, &placed)
        })
        .collect();
    let place = |(patch, alike): (&SurfacePatch, &Vec<f32>)| InterestPlace {
        position: patch.position,
        normal: patch.normal,
        bits: bits_if_true(alike),
    };
    let mut rivals: Vec<Rival> = rivals
        .iter()
        .enumerate()
        .map(|(at, object)| {
            let sum: f64 = likenesses.iter().map(|alike| f64::from(alike[at])).sum();
            Rival { object: *object, likeness: sum / n.max(1) as f64 }
        })
        .collect();
    rivals.sort_by(|a, b| b.likeness.total_cmp(&a.likeness).then(a.object.cmp(&b.object)));
    Interest { places: map.patches().iter().zip(&likenesses).map(place).collect(), rivals }
}

/// The objects that an object is compared with, in the order of the catalogue.
fn rivals(model: &Arc<SurfaceModel>, object: ObjectIdx, stop: &Stop) -> Vec<ObjectIdx> {
    let own = object.0 as usize;
    let mut others: Vec<usize> = (0..model.n_objects()).filter(|other| *other != own).collect();
    if others.len() > RIVALS_MAX {
        let prior: Vec<f64> =
            (0..model.n_objects()).map(|other| f64::from(u8::from(other != own))).collect();
        let touches = model.maps()[own].patches();
        let belief = felt(model, Some(&prior), &touches[..touches.len().min(CHOSEN_BY)], stop);
        let evidence = belief.log_evidence();
        others.sort_by(|a, b| evidence[*b].total_cmp(&evidence[*a]).then(a.cmp(b)));
        others.truncate(RIVALS_MAX);
        others.sort_unstable();
    }
    others.into_iter().map(|other| ObjectIdx(other as u32)).collect()
}

/// The belief after touches of patches.
fn felt(
    model: &Arc<SurfaceModel>,
    prior: Option<&[f64]>,
    patches: &[SurfacePatch],
    stop: &Stop,
) -> SurfaceBelief {
    let mut belief = SurfaceBelief::new(Arc::clone(model), SurfaceOptions::default(), prior)
        .expect("the prior has a weight above 0 for another object of the model");
    belief.heed(stop);
    patches.iter().for_each(|patch| belief.add_patch(patch));
    belief
}

/// The poses in which touches of a map look like a rival's, with probabilities that sum to 1. Each
/// rival is searched by itself, so that a better one does not end its search.
fn poses(model: &SurfaceModel, rival: ObjectIdx, map: &SurfaceMap, stop: &Stop) -> Vec<PoseSample> {
    let alone = Arc::new(model.with_maps(vec![Arc::clone(&model.maps()[rival.0 as usize])]));
    let patches = map.patches();
    let belief = felt(&alone, None, &patches[..patches.len().min(PLACED_BY)], stop);
    let mut stream = Stream::new(0, Purpose::NextTouch, u64::from(rival.0));
    let mut samples = belief.samples(POSES_MAX, &mut stream);
    let total: f64 = samples.iter().map(|sample| sample.probability).sum();
    for sample in &mut samples {
        sample.object = rival;
        sample.probability /= total;
    }
    samples
}

/// The likeness of a touch at a patch of an object to that of each rival in its poses.
fn likenesses(
    maps: &[Arc<SurfaceMap>],
    object: ObjectIdx,
    patch: &SurfacePatch,
    placed: &[Vec<PoseSample>],
) -> Vec<f32> {
    let options = NextTouchOptions::default();
    let hand = Hand { half_width: options.half_width as f32, recenters: options.recenters };
    // Poses are known, as after several touches.
    let scatter = scatter(1.0);
    let own = &maps[object.0 as usize];
    let approach = approach(own, patch);
    let met = |sample: &PoseSample| -> Outcome {
        outcome(&maps[sample.index()], sample, &approach, &hand)
    };
    let truth = PoseSample { object, session_from_object: Pose::IDENTITY, probability: 1.0 };
    let truth = met(&truth);
    let likeness = |poses: &Vec<PoseSample>| -> f32 {
        let of = |sample| {
            let other = met(sample);
            other.probability * alike(&truth, &other, &scatter)
        };
        poses.iter().map(of).sum()
    };
    placed.iter().map(likeness).collect()
}

/// The press against a patch: from outside the object or, if another part of it is in the way,
/// from half the way to that part.
fn approach(map: &SurfaceMap, patch: &SurfacePatch) -> Approach {
    let (target, outward): (DVec3, DVec3) = (patch.position.as_dvec3(), patch.normal.as_dvec3());
    let Way { stand_off, reach } = way_to(map, target, outward);
    let stand_off = hidden_by(map, target, outward).map_or(stand_off, |ahead| 0.5 * ahead);
    let facing = DQuat::from_rotation_arc(DVec3::Z, -outward);
    let session_from_sensor = Pose::from_parts(facing, target + stand_off * outward);
    Approach { session_from_sensor, reach, cost: None }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{PI, TAU};

    use super::super::information::{Bits, Scatter, information};
    use super::*;
    use crate::model::map::SurfaceLayout;
    use crate::model::thinning::farthest_first;
    use crate::model::{EvidenceCalibration, SurfaceMap};
    use crate::test_support::{map_of, places, space};

    fn patch(position: Vec3, normal: Vec3) -> SurfacePatch {
        SurfacePatch {
            position,
            normal,
            direction: normal.any_orthonormal_vector(),
            elongation: 0.0,
            normal_deviation: 0.05,
            feature: [0; 8],
        }
    }

    /// A cup: a closed cylinder with its axis along z, a patch about every 5 mm.
    fn cup(radius: f32, height: f32) -> Vec<SurfacePatch> {
        let mut patches = Vec::new();
        let n_rings = (height / 0.005) as usize;
        let n_around = (TAU * radius / 0.005) as usize;
        for ring in 0..=n_rings {
            for place in 0..n_around {
                let (sin, cos) = (TAU * place as f32 / n_around as f32).sin_cos();
                let z = height * (ring as f32 / n_rings as f32 - 0.5);
                patches.push(patch(
                    Vec3::new(radius * cos, radius * sin, z),
                    Vec3::new(cos, sin, 0.0),
                ));
            }
        }
        for disc in 1..(radius / 0.005) as usize {
            let at = 0.005 * disc as f32;
            let n_around = (TAU * at / 0.005) as usize;
            for place in 0..n_around {
                let (sin, cos) = (TAU * place as f32 / n_around as f32).sin_cos();
                for side in [-1.0, 1.0] {
                    let position = Vec3::new(at * cos, at * sin, 0.5 * side * height);
                    patches.push(patch(position, side * Vec3::Z));
                }
            }
        }
        patches
    }

    /// Half a ring of 20 mm radius, 12 mm thick, on the side of a cup.
    fn handle(cup_radius: f32) -> Vec<SurfacePatch> {
        let mut patches = Vec::new();
        for along in 1..12 {
            let (sin, cos) = (PI * (along as f32 / 12.0 - 0.5)).sin_cos();
            let outward = Vec3::new(cos, 0.0, sin);
            for around in 0..7 {
                let (up, out) = (TAU * around as f32 / 7.0).sin_cos();
                let normal = out * outward + up * Vec3::Y;
                let middle = Vec3::X * cup_radius + 0.020 * outward;
                patches.push(patch(middle + 0.006 * normal, normal));
            }
        }
        patches
    }

    /// The map of patches in the order of thinning, as a training has it.
    fn thinned(patches: Vec<SurfacePatch>) -> SurfaceMap {
        let places: Vec<_> = patches.iter().map(|one| (one.position, one.normal)).collect();
        let order = farthest_first(&places, 1_000);
        let patches = order.into_iter().map(|at| patches[at]).collect();
        SurfaceMap::new(DVec3::ZERO, patches, SurfaceLayout::default())
    }

    fn model(maps: Vec<SurfaceMap>) -> Arc<SurfaceModel> {
        let maps = maps.into_iter().map(Arc::new).collect();
        Arc::new(SurfaceModel::new(space(), EvidenceCalibration::default(), maps))
    }

    fn mean_bits(interest: &Interest, is_meant: impl Fn(Vec3) -> bool) -> f64 {
        let meant = interest.places.iter().filter(|place| is_meant(place.position));
        let bits: Vec<f64> = meant.map(|place| place.bits).collect();
        assert!(bits.len() > 10, "{}", bits.len());
        bits.iter().sum::<f64>() / bits.len() as f64
    }

    #[test]
    fn the_handle_of_a_mug_tells_it_from_cups_and_its_body_does_not() {
        let radius = 0.030;
        let mug = [cup(radius, 0.060), handle(radius)].concat();
        let cups = [cup(radius, 0.060), cup(radius, 0.060)];
        let model = model([vec![mug], cups.to_vec()].concat().into_iter().map(thinned).collect());
        let found = interest(&model, ObjectIdx(0), &Stop::never());
        let on_handle = mean_bits(&found, |at| at.x > radius + 0.008);
        let on_body = mean_bits(&found, |at| at.x < 0.0);
        // Of three objects at most log2 3 = 1.58 bits.
        assert!(on_handle > 1.2, "{on_handle}");
        assert!(on_body < 0.2, "{on_body}");
        assert!(
            found.rivals.iter().all(|rival| (0.6..0.98).contains(&rival.likeness)),
            "{found:?}"
        );
        // To a cup the mug is as alike, except that the handle is not on it.
        let of_cup = interest(&model, ObjectIdx(1), &Stop::never());
        assert_eq!(of_cup.rivals[0].object, ObjectIdx(2), "its twin is the most alike");
        assert!(of_cup.rivals[0].likeness > 0.95, "{:?}", of_cup.rivals);
    }

    #[test]
    fn a_single_object_has_nothing_to_be_told_from() {
        let found = interest(&model(vec![thinned(cup(0.02, 0.04))]), ObjectIdx(0), &Stop::never());
        assert!(found.rivals.is_empty() && !found.places.is_empty());
        assert!(found.places.iter().all(|place| place.bits.abs() < 1e-12));
    }

    #[test]
    fn a_large_catalogue_is_bounded_to_the_most_alike() {
        let flat = |n: usize| cup(0.010, 0.050 + 0.001 * n as f32);
        let mut maps: Vec<SurfaceMap> = (0..36).map(|n| thinned(flat(n))).collect();
        maps.push(map_of(&places(200, 0)));
        // The twin of the ellipsoid stands last.
        maps.push(map_of(&places(200, 1)));
        let found = interest(&model(maps), ObjectIdx(36), &Stop::never());
        assert_eq!(found.rivals.len(), RIVALS_MAX);
        assert_eq!(found.rivals[0].object, ObjectIdx(37), "{:?}", found.rivals);
        assert!(found.places.len() == 200 && found.bytes() > 200 * size_of::<InterestPlace>());
    }

    #[test]
    fn the_mean_over_true_objects_is_that_of_next_touches() {
        let met = |z: f32| super::super::footprint::ExpectedContact {
            contact: 0.9,
            position: Vec3::Z * z,
            normal: Vec3::Z,
            normal_deviation: 0.1,
            feature: [0; 8],
        };
        let outcome = |object: u32| Outcome {
            object: ObjectIdx(object),
            probability: 1.0 / 3.0,
            met: (object < 2).then(|| met(0.002 * object as f32)),
        };
        let outcomes: Vec<Outcome> = (0..3).map(outcome).collect();
        let scatter = Scatter { position: 0.002_5, normal: 0.25, appearance: 4.0 };
        let Bits { identity, .. } = information(&outcomes, 0.0, &scatter);
        let of = |truth: &Outcome| {
            let others = outcomes.iter().filter(|other| other.object != truth.object);
            bits_if_true(&others.map(|other| alike(truth, other, &scatter)).collect::<Vec<_>>())
        };
        let mean = outcomes.iter().map(of).sum::<f64>() / 3.0;
        assert!((mean - identity).abs() < 1e-6, "{mean} {identity}");
    }

    #[test]
    fn a_stop_ends_the_work() {
        let (model, stop) = (model(vec![thinned(cup(0.02, 0.04)); 2]), Stop::possible());
        stop.ask();
        assert!(Stop::heeding(|| interest(&model, ObjectIdx(0), &stop)).is_err());
    }
}
