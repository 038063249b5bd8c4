//! Training of surfaces: an appearance space for all objects, and a thinned map of each.
//!
//! The space is learnt once from all objects together; each map depends on its own readings and
//! the space alone. Two touches less than [`SAME_PLACE`] apart that face the same way count as
//! touches of one place: how they differ is what the space must ignore.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{TrainError, TrainingSet, check_shapes};
use crate::model::MapError;
use crate::patch::touches;
use crate::reading::Reading;
use crate::rng::{Purpose, Stream};
use crate::surface::appearance::{
    AppearanceSpace, N_AXES, StoredFeature, project, raw_descriptor, raw_feature, stored,
};
use crate::surface::map::{SurfaceLayout, SurfaceMap, SurfacePatch};
use crate::surface::thinning::farthest_first;
use crate::surface::touch::{Touch, observe_touch};
use crate::units::MM;
use crate::vocabulary::discriminant::find_discriminants;

/// Touches nearer than this are of one place, metres.
pub const SAME_PLACE: f64 = 3.0 * MM;

/// Normals of touches of one place agree at least so well (cosine).
const SAME_FACING: f64 = 0.85;

/// The space is learnt from at most so many pairs of touches of one place.
const PLACES_MAX: usize = 6_000;

/// So many features say how touches anywhere look.
const ANYWHERE: usize = 2_000;

/// Normals scatter at least and at most so far, rad.
const NORMAL_DEVIATION: std::ops::RangeInclusive<f32> = 0.08..=0.6;

/// How surfaces are trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceConfig {
    /// How many touches a map keeps.
    pub patches_max: usize,
    /// How maps are laid out.
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
/// [`TrainError`] when nothing was touched, images differ in shape, or no two touches are of
/// one place.
pub fn learn_space(sets: &[TrainingSet<'_>], seed: u64) -> Result<AppearanceSpace, TrainError> {
    let touched: Vec<Vec<&Reading>> = sets
        .iter()
        .map(|set| set.readings.iter().filter(|r| touches(r, set.sensor)).collect())
        .collect();
    let Some(set) = sets.iter().zip(&touched).find(|(_, readings)| !readings.is_empty()) else {
        return Err(TrainError::NothingTouched);
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
    let mut pairs: Vec<Vec<Vec<f64>>> = Vec::new();
    for (readings, features) in touched.iter().zip(&features) {
        let of_place = |[a, b]: [usize; 2]| vec![features[a].clone(), features[b].clone()];
        pairs.extend(same_places(readings).into_iter().map(of_place));
    }
    let mut stream = Stream::new(seed, Purpose::Clustering, 1);
    let pairs = super::subsample(&pairs, PLACES_MAX, &mut stream);
    let mut projection = find_discriminants(&pairs, N_AXES, 0.02)
        .ok_or(TrainError::Map(MapError::TooFew { found: pairs.len(), expected: 2 }))?;
    // Of two touches each is half their difference from their mean: halved, they differ by 1.
    projection.axes.iter_mut().flatten().for_each(|value| *value *= 0.5);
    let all: Vec<StoredFeature> =
        features.iter().flatten().map(|raw| stored(&project(&projection, raw))).collect();
    let anywhere = super::subsample(&all, ANYWHERE, &mut stream);
    Ok(AppearanceSpace::new(grid, projection, anywhere))
}

/// Pairs of readings that touched one place: each reading with its nearest neighbour.
fn same_places(readings: &[&Reading]) -> Vec<[usize; 2]> {
    let place = |reading: &&Reading| {
        let pose = reading.session_from_sensor();
        (pose.translation, pose.turn(DVec3::NEG_Z))
    };
    let places: Vec<(DVec3, DVec3)> = readings.iter().map(place).collect();
    let nearest = |(index, (position, normal)): (usize, &(DVec3, DVec3))| {
        let mut best = (SAME_PLACE * SAME_PLACE, None);
        for (other, (place, facing)) in places.iter().enumerate() {
            let distance = position.distance_squared(*place);
            if other != index && distance < best.0 && normal.dot(*facing) > SAME_FACING {
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
/// [`TrainError`] when images do not fit the space or too few readings touched.
pub fn map_surface(
    set: &TrainingSet<'_>,
    space: &AppearanceSpace,
    config: &SurfaceConfig,
    origin_in_training: Option<DVec3>,
) -> Result<SurfaceMap, TrainError> {
    let touches: Vec<Touch> =
        set.readings.iter().filter_map(|r| observe_touch(r, set.sensor, space)).collect();
    let found = touches.len();
    if found < crate::model::MIN_PATCHES {
        return Err(MapError::TooFew { found, expected: crate::model::MIN_PATCHES }.into());
    }
    let centroid = || touches.iter().map(|t| t.position).sum::<DVec3>() / found as f64;
    let origin = origin_in_training.unwrap_or_else(centroid);
    let places: Vec<(Vec3, Vec3)> =
        touches.iter().map(|t| ((t.position - origin).as_vec3(), t.normal.as_vec3())).collect();
    let kept = farthest_first(&places, config.patches_max.min(usize::from(u16::MAX)));
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

/// How far normals scatter about one touch: the deviation among its near neighbours.
fn normal_deviation(index: usize, places: &[(Vec3, Vec3)]) -> f32 {
    let (position, normal) = places[index];
    let reach = SAME_PLACE as f32;
    // As if one neighbour 0.15 rad off were known: few neighbours say little.
    let (mut squares, mut weight) = (0.15f32.powi(2), 1.0);
    for (other, facing) in places {
        let cosine = normal.dot(*facing);
        if position.distance_squared(*other) < reach * reach && cosine > 0.5 && cosine < 1.0 - 1e-6
        {
            squares += 2.0 * (1.0 - cosine);
            weight += 1.0;
        }
    }
    (squares / weight).sqrt().clamp(*NORMAL_DEVIATION.start(), *NORMAL_DEVIATION.end())
}
