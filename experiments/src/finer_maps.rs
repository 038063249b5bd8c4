//! Finer maps of an object than a catalogue has: of more touches, and of its mesh.
//!
//! The oracle columns repeat wrong sessions on them, to tell whether the map lost a session.

use glam::{DVec3, Vec3};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_recogniser::model::map::SurfaceLayout;
use palpate_recogniser::model::{AppearanceSpace, SurfaceMap, SurfacePatch};
use palpate_recogniser::train::{SurfaceConfig, map_surface};
use palpate_sim::press::PressSimulator;

use crate::objects::{self, TestObject};

/// Factor of the touches of the finer map. Chosen.
const FINER: usize = 4;

/// Points drawn from a mesh that is a map. Chosen: an object of 80 mm has one every 1.2 mm.
const MESH_POINTS: usize = 10_000;

/// Radius (m) over which a mesh's normals are averaged. Chosen: about that of a contact.
const CONTACT_RADIUS: f32 = 0.003;

/// Patches of a finer map whose pairs are tabled. Chosen: bounds memory.
const PAIRED_MAX: usize = 1_200;

/// Least cosine of a patch's normal with that of the mesh point whose appearance it gives. Chosen.
const FACING_MIN: f32 = 0.5;

/// The finer maps of an object.
pub struct FinerMaps {
    /// Of four times as many touches.
    pub touched: SurfaceMap,
    /// The mesh itself.
    pub mesh: SurfaceMap,
}

impl FinerMaps {
    /// The finer maps of an object that was learnt from this many readings with this seed; `None`
    /// if it cannot be touched that often.
    #[must_use]
    pub fn of(
        object: &TestObject,
        sensor: &SensorDescription,
        space: &AppearanceSpace,
        train_readings: usize,
        seed: u64,
    ) -> Option<Self> {
        let n = FINER * train_readings;
        let readings = objects::touch(object, sensor, n, seed).ok()?;
        let layout = SurfaceLayout { pair_patches_max: PAIRED_MAX, ..SurfaceLayout::default() };
        let config = SurfaceConfig { patches_max: n, layout };
        let set = TrainingSet { readings: &readings, sensor };
        let touched = map_surface(&set, space, &config, Some(DVec3::ZERO)).ok()?;
        let mesh = mesh_map(object, sensor, &touched, layout);
        Some(Self { touched, mesh })
    }
}

/// The map of a mesh: points of it with its normals, averaged over a contact, and with stretch and
/// appearance of the nearest of the `touched` patches.
fn mesh_map(
    object: &TestObject,
    sensor: &SensorDescription,
    touched: &SurfaceMap,
    layout: SurfaceLayout,
) -> SurfaceMap {
    let simulator = PressSimulator::new(object.mesh.clone(), sensor.clone());
    let mut stream = Stream::new(0, Purpose::Shape, 0);
    let mut points: Vec<(Vec3, Vec3)> = (0..MESH_POINTS)
        .map(|_| simulator.draw_point(&mut stream))
        .map(|drawn| (drawn.point.as_vec3(), drawn.normal.as_vec3()))
        .collect();
    points.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
    let patch = |at: usize| {
        let (position, normal) = points[at];
        let is_near = |x: f32| (x - position.x).abs() < CONTACT_RADIUS;
        let before = points[..at].iter().rev().take_while(|other| is_near(other.0.x));
        let after = points[at..].iter().take_while(|other| is_near(other.0.x));
        let about = before.chain(after).filter(|other| {
            other.0.distance(position) < CONTACT_RADIUS && other.1.dot(normal) > 0.0
        });
        let normal = about.map(|other| other.1).sum::<Vec3>().normalize();
        let like = touched.patches().iter().min_by(|a, b| {
            let apart = |patch: &SurfacePatch| {
                let turned = patch.normal.dot(normal) < FACING_MIN;
                patch.position.distance(position) + if turned { 1.0 } else { 0.0 }
            };
            apart(a).total_cmp(&apart(b))
        })?;
        let across = normal.cross(like.direction).normalize_or(normal.any_orthonormal_vector());
        Some(SurfacePatch { position, normal, direction: across.cross(normal), ..*like })
    };
    let patches: Vec<SurfacePatch> = (0..points.len()).filter_map(patch).collect();
    // Pairs are tabled among the first patches, which must lie anywhere.
    let mut drawn: Vec<usize> = (0..patches.len()).collect();
    for at in 0..drawn.len() {
        drawn.swap(at, at + stream.index(patches.len() - at));
    }
    let patches = drawn.into_iter().map(|at| patches[at]).collect();
    SurfaceMap::new(DVec3::ZERO, patches, layout)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_of_a_mesh_lies_on_it_and_faces_outwards() {
        let mut objects = objects::generated(&["mug"], 0.08).unwrap();
        let object = objects.remove(0);
        let sensor = SensorDescription::digitacts_6x6();
        let readings = objects::touch(&object, &sensor, 60, 3).unwrap();
        let set = TrainingSet { readings: &readings, sensor: &sensor };
        let space = palpate_recogniser::train::learn_space(&[set], 3).unwrap();
        let layout = SurfaceLayout { pair_patches_max: 50, ..SurfaceLayout::default() };
        let config = SurfaceConfig { patches_max: 60, layout };
        let set = TrainingSet { readings: &readings, sensor: &sensor };
        let touched = map_surface(&set, &space, &config, Some(DVec3::ZERO)).unwrap();
        let map = mesh_map(&object, &sensor, &touched, layout);
        assert_eq!(map.patches().len(), MESH_POINTS);
        let simulator = PressSimulator::new(object.mesh.clone(), sensor);
        for patch in map.patches().iter().step_by(100) {
            let (nearest, normal) = simulator.nearest(patch.position.as_dvec3());
            assert!(nearest.as_vec3().distance(patch.position) < 1e-6);
            assert!(normal.as_vec3().dot(patch.normal) > 0.0);
            assert!(patch.direction.dot(patch.normal).abs() < 1e-5);
        }
    }
}
