//! Training: an appearance space for all objects, and a thinned map of each.
//!
//! The space is learnt once from all objects together; each map depends on its own readings and
//! the space alone. Two touches less than [`SAME_PLACE`] apart that face the same way are
//! touches of one place; the space ignores their differences.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::model::agreement::{N_AXES, StoredFeature, stored};
use crate::model::appearance::{AppearanceSpace, project, raw_descriptor, raw_feature};
use crate::model::map::{PATCHES_MAX, SurfaceLayout, SurfaceMap};
use crate::model::patch::SurfacePatch;
use crate::model::thinning::farthest_first;
use crate::observe::touch::{Touch, observe_touch};
use palpate_core::contact::touches;
use palpate_core::contact::{center_of_pressure, contact_points, normal_constraint};
use palpate_core::object::MapError;
use palpate_core::object::MapPatch;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::symmetry::{Finding, Press};
use palpate_core::training::{TrainingError, TrainingSet, check_shapes};
use palpate_core::units::MM;
use palpate_core::vocabulary::discriminant::find_discriminants;

/// Distance below which two touches are of one place, metres.
pub const SAME_PLACE: f64 = 3.0 * MM;

/// Least cosine of the normals of two touches of one place.
const SAME_FACING: f64 = 0.85;

/// Maximum number of pairs of touches of one place from which the space is learnt.
const PLACES_MAX: usize = 6_000;

/// Minimum number of such pairs; with fewer, the space allows larger differences within a place.
const PLACES_MIN: usize = 40;

/// Number of features of touches anywhere that the space keeps.
const ANYWHERE: usize = 2_000;

/// Bounds of the deviation of normals about a patch, rad.
const NORMAL_DEVIATION: std::ops::RangeInclusive<f32> = 0.08..=0.6;

/// Prior deviation of normals (rad), with the weight of one neighbour.
const NORMAL_DEVIATION_PRIOR: f32 = 0.15;

/// Least cosine of the normals of two neighbours.
const NEIGHBOUR_FACING: f32 = 0.5;

/// Shrinkage of the covariance within places towards a multiple of the identity.
const SHRINKAGE: f64 = 0.02;

/// Default number of simulated touches of a mesh, for all methods.
const MESH_TOUCHES: u32 = 1_000;

/// Default number of simulated touches of a mesh for its surface, those for all methods among them.
const SURFACE_TOUCHES: u32 = 2_400;

/// The numbers of simulated touches of a mesh, for all methods and for its surface, as stated or by
/// default. If only the first is stated, the second equals it.
#[must_use]
pub fn mesh_touches(stated: Option<u32>, of_surface: Option<u32>) -> [u32; 2] {
    [stated.unwrap_or(MESH_TOUCHES), of_surface.or(stated).unwrap_or(SURFACE_TOUCHES)]
}

/// Options of training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceConfig {
    /// Maximum number of patches of a map.
    pub patches_max: usize,
    /// Layout of the maps.
    pub layout: SurfaceLayout,
}

impl Default for SurfaceConfig {
    fn default() -> Self {
        Self { patches_max: 1_000, layout: SurfaceLayout::default() }
    }
}

/// Learns the appearance space of a catalogue.
///
/// # Errors
/// [`TrainingError`] when nothing was touched, images differ in shape, or no two touches are of
/// one place.
pub fn learn_space(sets: &[TrainingSet<'_>], seed: u64) -> Result<AppearanceSpace, TrainingError> {
    let touched: Vec<Vec<&Reading>> = sets
        .iter()
        .map(|set| set.readings.iter().filter(|r| touches(r, set.sensor)).collect())
        .collect();
    let Some(set) = sets.iter().zip(&touched).find(|(_, readings)| !readings.is_empty()) else {
        return Err(TrainingError::NothingTouched);
    };
    let grid = *set.0.sensor.grid();
    for readings in &touched {
        check_shapes(readings, grid.rows, grid.cols)?;
    }
    let descriptor = raw_descriptor(&grid);
    let features: Vec<Vec<Vec<f64>>> = touched
        .par_iter()
        .map(|readings| readings.iter().map(|r| raw_feature(&descriptor, r.image())).collect())
        .collect();
    let pairs = pairs_of_places(&touched, &features);
    let mut stream = Stream::new(seed, Purpose::Clustering, 1);
    let pairs = palpate_core::training::subsample(&pairs, PLACES_MAX, &mut stream);
    let unlearnt = if pairs.len() < 2 { TrainingError::NoPlaces } else { TrainingError::Alike };
    let mut projection = find_discriminants(&pairs, N_AXES, SHRINKAGE).ok_or(unlearnt)?;
    // Each of two touches differs from their mean by half of their difference; after halving,
    // the difference has unit covariance.
    projection.axes.iter_mut().flatten().for_each(|value| *value *= 0.5);
    let all: Vec<StoredFeature> =
        features.iter().flatten().map(|raw| stored(&project(&projection, raw))).collect();
    let anywhere = palpate_core::training::subsample(&all, ANYWHERE, &mut stream);
    Ok(AppearanceSpace::new(grid, projection, anywhere))
}

/// Raw features of touches of one place. The tolerance grows until there are enough pairs; in
/// the end the facing is ignored, too.
fn pairs_of_places(touched: &[Vec<&Reading>], features: &[Vec<Vec<f64>>]) -> Vec<Vec<Vec<f64>>> {
    let facings = [SAME_FACING, SAME_FACING, SAME_FACING, SAME_FACING, -1.0];
    let mut pairs = Vec::new();
    for (doubling, facing) in facings.into_iter().enumerate() {
        let reach = SAME_PLACE * f64::from(1u32 << (2 * doubling));
        pairs.clear();
        for (readings, features) in touched.iter().zip(features) {
            let of_place = |[a, b]: [usize; 2]| vec![features[a].clone(), features[b].clone()];
            pairs.extend(same_places(readings, reach, facing).into_iter().map(of_place));
        }
        if pairs.len() >= PLACES_MIN {
            break;
        }
    }
    pairs
}

/// Pairs of readings that touched one place: each reading with its nearest neighbour within
/// `reach` (m) that faces the same way, to a cosine of `facing`.
fn same_places(readings: &[&Reading], reach: f64, facing: f64) -> Vec<[usize; 2]> {
    let place = |reading: &&Reading| {
        let pose = reading.session_from_sensor();
        (pose.translation, pose.turn(DVec3::NEG_Z))
    };
    let places: Vec<(DVec3, DVec3)> = readings.iter().map(place).collect();
    let nearest = |(index, (position, normal)): (usize, &(DVec3, DVec3))| {
        let mut best = (reach * reach, None);
        for (other, (place, outward)) in places.iter().enumerate() {
            let distance = position.distance_squared(*place);
            if other != index && distance < best.0 && normal.dot(*outward) > facing {
                best = (distance, Some(other));
            }
        }
        best.1.map(|other| [index, other])
    };
    places.iter().enumerate().filter_map(nearest).collect()
}

/// Maps the surface of one object. `origin_in_training` (metres) becomes the object frame's
/// origin; `None` is the centroid of the touches.
///
/// # Errors
/// [`TrainingError`] when images do not fit the space or too few readings touched.
pub fn map_surface(
    set: &TrainingSet<'_>,
    space: &AppearanceSpace,
    config: &SurfaceConfig,
    origin_in_training: Option<DVec3>,
) -> Result<SurfaceMap, TrainingError> {
    let touches: Vec<Touch> =
        set.readings.iter().filter_map(|r| observe_touch(r, set.sensor, space)).collect();
    let found = touches.len();
    if found < palpate_core::object::MIN_PATCHES {
        return Err(MapError::TooFew { found, expected: palpate_core::object::MIN_PATCHES }.into());
    }
    let centroid = || touches.iter().map(|t| t.position).sum::<DVec3>() / found as f64;
    let origin = origin_in_training.unwrap_or_else(centroid);
    let places: Vec<(Vec3, Vec3)> =
        touches.iter().map(|t| ((t.position - origin).as_vec3(), t.normal.as_vec3())).collect();
    let kept = farthest_first(&places, config.patches_max.min(PATCHES_MAX));
    let patch = |index: usize| SurfacePatch {
        position: places[index].0,
        normal: places[index].1,
        direction: touches[index].direction.as_vec3(),
        elongation: touches[index].elongation as f32,
        normal_deviation: normal_deviation(index, &places),
        feature: stored(&touches[index].feature),
    };
    let patches = kept.into_iter().map(patch).collect();
    Ok(SurfaceMap::new(origin, patches, config.layout))
}

/// The symmetry of an object from its touches, in the object frame whose origin lies at
/// `origin_in_training` (metres).
#[must_use]
pub fn find_symmetry(set: &TrainingSet<'_>, origin_in_training: DVec3) -> Finding {
    let single = |v: DVec3| v.to_array().map(|value| value as f32);
    let grid = set.sensor.grid();
    let half = 0.5 * grid.pitch * DVec2::new(grid.cols as f64, grid.rows as f64);
    let press = |reading: &Reading| {
        let object_from_sensor = reading.session_from_sensor();
        let image = reading.image();
        let center = object_from_sensor * center_of_pressure(image, set.sensor);
        touches(reading, set.sensor).then(|| Press {
            patch: MapPatch {
                position: single(center - origin_in_training),
                normal: single(object_from_sensor.turn(DVec3::NEG_Z)),
                normal_confidence: normal_constraint(&contact_points(image, set.sensor)) as f32,
            },
            object_from_sensor: Pose::from_parts(
                object_from_sensor.rotation,
                object_from_sensor.translation - origin_in_training,
            ),
            half,
        })
    };
    Finding::of_touches(&set.readings.iter().filter_map(press).collect::<Vec<_>>())
}

/// The deviation of normals about one touch, among its near neighbours.
fn normal_deviation(index: usize, places: &[(Vec3, Vec3)]) -> f32 {
    let (position, normal) = places[index];
    let reach = SAME_PLACE as f32;
    let (mut squares, mut weight) = (NORMAL_DEVIATION_PRIOR.powi(2), 1.0);
    for (neighbour, (other, facing)) in places.iter().enumerate() {
        let cosine = normal.dot(*facing);
        let near = position.distance_squared(*other) < reach * reach;
        if neighbour != index && near && cosine > NEIGHBOUR_FACING {
            squares += 2.0 * (1.0 - cosine);
            weight += 1.0;
        }
    }
    (squares / weight).sqrt().clamp(*NORMAL_DEVIATION.start(), *NORMAL_DEVIATION.end())
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::model::appearance::raw_descriptor;
    use palpate_core::descriptor::Descriptor as _;
    use palpate_core::reading::SensorId;
    use palpate_core::sensor::SensorDescription;
    use palpate_core::symmetry::{AxisOrder, PATCHES_MIN};
    use palpate_core::vocabulary::discriminant::Discriminant;

    /// A press of `pressure` (Pa) at a place (mm) on a face with this `normal`.
    fn press(millimetres: [f64; 3], normal: DVec3, pressure: f64) -> Reading {
        let sensor = SensorDescription::digitacts_6x6();
        let turn = DQuat::from_rotation_arc(DVec3::Z, -normal);
        let pose = Pose::from_parts(turn, DVec3::from_array(millimetres) * MM);
        Reading::new(SensorId(0), &sensor, &[Some(pressure); 36], pose).unwrap()
    }

    fn space() -> AppearanceSpace {
        let grid = *SensorDescription::digitacts_6x6().grid();
        let dimension = raw_descriptor(&grid).dimension() + 1;
        let projection =
            Discriminant { mean: vec![0.0; dimension], axes: vec![vec![1.0; dimension]] };
        AppearanceSpace::new(grid, projection, Vec::new())
    }

    #[test]
    fn touches_of_one_place_are_near_and_face_the_same_way() {
        let [up, down] = [DVec3::Z, DVec3::NEG_Z];
        let readings = [
            press([0.0, 0.0, 0.0], up, 5e3),
            press([2.0, 0.0, 0.0], up, 5e3),
            press([0.0, 1.0, 0.0], down, 5e3),
            press([2.0, 3.5, 0.0], up, 5e3),
        ];
        let readings: Vec<&Reading> = readings.iter().collect();
        // The third is nearer to the first but faces away; the fourth is 3.5 mm off.
        assert_eq!(same_places(&readings, SAME_PLACE, SAME_FACING), [[0, 1], [1, 0]]);
    }

    #[test]
    fn where_touches_are_few_a_place_is_larger() {
        // 4 mm apart: no two within 3 mm, each with its nearest neighbour within 12 mm.
        let row: Vec<Reading> =
            (0..50).map(|n| press([4.0 * f64::from(n), 0.0, 0.0], DVec3::Z, 5e3)).collect();
        let features: Vec<Vec<f64>> = (0..50).map(|n| vec![f64::from(n)]).collect();
        let pairs = pairs_of_places(&[row.iter().collect()], &[features]);
        assert_eq!(pairs.len(), 50);
        assert!(pairs.iter().all(|pair| (pair[0][0] - pair[1][0]).abs() < 1.5), "{pairs:?}");
    }

    #[test]
    fn normals_scatter_as_far_as_the_neighbours_turn() {
        let turned = |angle: f32| Vec3::new(angle.sin(), 0.0, angle.cos());
        let at = |x: f32, angle: f32| (Vec3::new(x, 0.0, 0.0), turned(angle));
        // Without neighbours: the prior.
        assert!((normal_deviation(0, &[at(0.0, 0.0), at(0.01, 0.0)]) - 0.15).abs() < 1e-6);
        // One neighbour 0.3 rad off: √((0.0225 + 2(1 − cos 0.3))/2) = 0.23645.
        let off = normal_deviation(0, &[at(0.0, 0.0), at(0.001, 0.3)]);
        assert!((off - 0.236_45).abs() < 1e-4, "{off}");
        // Three neighbours with the same normal: √(0.0225/4) = 0.075, raised to 0.08.
        let flat: Vec<(Vec3, Vec3)> = (0..4).map(|n| at(0.000_5 * n as f32, 0.0)).collect();
        assert!((normal_deviation(1, &flat) - 0.08).abs() < 1e-6);
    }

    #[test]
    fn the_origin_is_the_centroid_unless_it_is_given() {
        let sensor = SensorDescription::digitacts_6x6();
        let readings: Vec<Reading> =
            (0..20).map(|n| press([f64::from(n), 50.0, 0.0], DVec3::Z, 5e3)).collect();
        let set = TrainingSet { readings: &readings, sensor: &sensor };
        let config = SurfaceConfig { patches_max: 7, ..SurfaceConfig::default() };
        let map = map_surface(&set, &space(), &config, None).unwrap();
        // Touches at x = 0 to 19 mm: 9.5 in the mean.
        assert!(map.origin_in_training().distance(DVec3::new(9.5 * MM, 50.0 * MM, 0.0)) < 1e-9);
        assert_eq!(map.patches().len(), 7);
        // The first touch, then the one farthest from it.
        assert!((map.patches()[0].position - Vec3::new(-0.009_5, 0.0, 0.0)).length() < 1e-6);
        assert!((map.patches()[1].position - Vec3::new(0.009_5, 0.0, 0.0)).length() < 1e-6);
        let map = map_surface(&set, &space(), &config, Some(DVec3::ZERO)).unwrap();
        assert!((map.patches()[0].position - Vec3::new(0.0, 0.05, 0.0)).length() < 1e-6);
    }

    #[test]
    fn symmetry_is_found_in_the_object_frame_from_enough_touches() {
        // A rod of 10 mm radius and 80 mm length along z about x = 50 mm, touched anywhere.
        let mut stream = Stream::new(7, Purpose::Sampling, 0);
        let readings: Vec<Reading> = (0..400)
            .map(|_| {
                let (around, along) = (stream.uniform(-3.2, 3.2), stream.uniform(-40.0, 40.0));
                let outward = DVec3::new(around.cos(), around.sin(), 0.0);
                let at = 10.0 * outward + DVec3::new(50.0, 0.0, along);
                press(at.to_array(), outward, 5e3)
            })
            .collect();
        let sensor = SensorDescription::digitacts_6x6();
        let origin = DVec3::new(45.0 * MM, 0.0, 0.0);
        let find = |readings| find_symmetry(&TrainingSet { readings, sensor: &sensor }, origin);
        let found = find(&readings).into_symmetry();
        // Without any noise a round rod may count as one of many sides.
        assert!(!matches!(found.axes[0].order, AxisOrder::Finite(0..12)), "{found:?}");
        assert!(found.axes[0].direction.z.abs() > 0.999, "{found:?}");
        let off = found.center - DVec3::new(5.0 * MM, 0.0, 0.0);
        assert!(off.length() < 1.0 * MM, "{found:?}");
        let few = find(&readings[..PATCHES_MIN - 1]);
        assert_eq!(few, Finding::Undetermined { touches_needed: 1 });
    }

    #[test]
    fn what_cannot_be_trained_is_refused() {
        let sensor = SensorDescription::digitacts_6x6();
        let set = |readings| TrainingSet { readings, sensor: &sensor };
        let nothing = [press([0.0; 3], DVec3::Z, 0.0)];
        assert_eq!(learn_space(&[set(&nothing)], 1), Err(TrainingError::NothingTouched));
        let apart = [press([0.0; 3], DVec3::Z, 5e3), press([9.0; 3], DVec3::Z, 5e3)];
        assert_eq!(learn_space(&[set(&apart[..1])], 1), Err(TrainingError::NoPlaces));
        let alike = vec![apart[0].clone(); 180];
        assert_eq!(learn_space(&[set(&alike)], 1), Err(TrainingError::Alike));
        let few = MapError::TooFew { found: 2, expected: 10 };
        let config = SurfaceConfig::default();
        let error = map_surface(&set(&apart), &space(), &config, None).unwrap_err();
        assert_eq!(error, TrainingError::Map(few));
    }

    #[test]
    fn a_surface_has_more_touches_unless_a_number_is_stated() {
        assert_eq!(mesh_touches(None, None), [1_000, 2_400]);
        assert_eq!(mesh_touches(Some(60), None), [60, 60]);
        assert_eq!(mesh_touches(Some(60), Some(90)), [60, 90]);
        assert_eq!(mesh_touches(None, Some(5_000)), [1_000, 5_000]);
    }
}
