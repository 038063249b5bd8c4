//! The point of the surface that a touch lies on, between the patches of the map.

use glam::Vec3;
use palpate_core::exponential::exp;

use crate::model::SurfaceMap;
use crate::observe::inverse_pose::{InversePose, TouchOnMap};
use crate::observe::observation::{Observation, Says};
use crate::verify::density::{Kernel, Width};

/// Least cosine between the normals of a patch and the touch; other patches do not count for the
/// height of the surface.
const FACING_MIN: f32 = 0.3;

/// Least smoothing of the height, in spacings of patches: beyond it a patch hardly counts, since its
/// curved surface tells little so far away.
const SMOOTHING_SPACINGS: f32 = 0.4;

/// Least weight of a patch, so that the mean exists.
const WEIGHT_MIN: f32 = 1e-12;

/// Least weight of a patch in the height of the surface, so that the mean exists.
const HEIGHT_WEIGHT_MIN: f32 = 1e-6;

/// Point of a map's surface to which a touch belongs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    /// Vector from the surface to the touch, object frame, metres.
    pub(crate) offset: Vec3,
    /// The surface's normal.
    pub(crate) normal: Vec3,
    /// Scatter of normals, rad.
    pub(crate) normal_deviation: f32,
}

/// The mean of the patches that may explain the touch, projected onto the surface between them;
/// `None` away from the surface.
pub(crate) fn surface_point(
    kernel: &Kernel,
    map: &SurfaceMap,
    pose: &InversePose,
    touch: &Observation,
) -> Option<SurfacePoint> {
    let TouchOnMap { touch: at, near } = TouchOnMap::new(map, pose, touch);
    let (mut offset, mut normal, mut deviation, mut total) = (Vec3::ZERO, Vec3::ZERO, 0.0, 0.0);
    let (mut height, mut heights) = (0.0, 0.0);
    // As wide across as along, since this weight selects patches and does not measure height.
    let width = kernel.width(map, touch);
    let width = Width { across: width.along, ..width };
    let smoothing = kernel.refinement.smoothing.max(SMOOTHING_SPACINGS * map.spacing()).powi(2);
    for index in near.touches() {
        let facet = &map.facets()[usize::from(index)];
        let density = kernel.patch_density(width, facet, &at, touch);
        let weight = density * touch.appearance_ratio_of_pose(&facet.feature) + WEIGHT_MIN;
        let off = at.point - facet.position;
        let (above, outward) = facet.surface_at(off);
        normal += weight * outward;
        offset += weight * off;
        deviation += weight * facet.normal_deviation();
        total += weight;
        // The height above the surface about each patch, not above the mean of their positions.
        let agreement = match touch.says {
            Says::Position => 1.0,
            _ => facet.normal.dot(at.normal),
        };
        if agreement >= FACING_MIN {
            let flat = off.length_squared() - off.dot(facet.normal).powi(2);
            let weight = exp(-flat / smoothing) * agreement + HEIGHT_WEIGHT_MIN;
            height += weight * above;
            heights += weight;
        }
    }
    if total <= 0.0 || heights <= 0.0 {
        return None;
    }
    let normal = normal.normalize_or_zero();
    let offset = offset / total;
    let offset = offset + normal * (height / heights - offset.dot(normal));
    Some(SurfacePoint { offset, normal, normal_deviation: deviation / total })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::observe::touch::Touch;
    use crate::options::SurfaceOptions;
    use crate::test_support::{inverse, map_of, places, seen, some_pose};

    #[test]
    fn a_touch_above_a_plane_is_placed_as_high_as_it_is() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        let flat = |x: f64, y: f64, z: f64| Touch {
            position: DVec3::new(x, y, z) * 0.001,
            normal: DVec3::Z,
            direction: DVec3::X,
            ..places(1, 0).remove(0)
        };
        let grid = (0..400).map(|n| flat(f64::from(n % 20), f64::from(n / 20), 0.0));
        let map = map_of(&grid.collect::<Vec<_>>());
        let pose = some_pose(2);
        let place =
            surface_point(&kernel, &map, &inverse(&pose), &seen(&flat(9.3, 10.4, 0.8), &pose));
        let place = place.unwrap();
        assert!((place.offset.z - 0.000_8).abs() < 1e-6, "{}", place.offset);
        assert!(place.normal.distance(Vec3::Z) < 1e-5);
        // The touches nearest to the middle of the voxel, which may be 2.6 mm away.
        assert!(place.offset.truncate().length() < 0.002_6, "{}", place.offset);
        // A plane touched every millimetre has the least scatter: 0.05 rad both ways.
        assert!((place.normal_deviation - 0.05 * 2f32.sqrt()).abs() < 1e-4);
    }

    #[test]
    fn between_patches_far_apart_the_nearest_ones_tell_the_height() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        // Waves of 2 mm, 63 mm long, touched every 12 mm.
        let wave = |x: f64, y: f64| {
            let (height, slope) = ((100.0 * x).sin() * 0.002, (100.0 * x).cos() * 0.2);
            let normal = DVec3::new(-slope, 0.0, 1.0).normalize();
            let position = DVec3::new(x, y, height);
            Touch { position, normal, direction: DVec3::Y, ..places(1, 0).remove(0) }
        };
        let at = |n: u32| 0.012 * f64::from(n);
        let grid: Vec<Touch> = (0..100).map(|n| wave(at(n % 10), at(n / 10))).collect();
        let map = map_of(&grid);
        let pose = some_pose(2);
        for (x, y) in [(0.040, 0.052), (0.052, 0.064), (0.064, 0.039), (0.076, 0.040)] {
            let touch = wave(x, y);
            let place = surface_point(&kernel, &map, &inverse(&pose), &seen(&touch, &pose));
            let place = place.unwrap();
            let height = place.offset.dot(place.normal);
            assert!(height.abs() < 0.000_4, "{height} at {x}, {y}");
        }
    }

    #[test]
    fn a_touch_away_from_the_surface_has_no_point_on_it() {
        let kernel = Kernel::new(&SurfaceOptions::default());
        let pose = some_pose(0);
        let mut place = places(1, 1).remove(0);
        place.position *= 3.0;
        let (map, touch) = (map_of(&places(200, 0)), seen(&place, &pose));
        assert!(surface_point(&kernel, &map, &inverse(&pose), &touch).is_none());
    }
}
