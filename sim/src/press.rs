//! The imaging model: the image of a sensor that is pressed into an object.
//!
//! The sensor is an orthographic camera in its own covering: the depth to which the object
//! penetrates is sampled at several points per taxel, blurred by the point spread, and
//! converted to pressures. Source: section 2.5.1. The sensor frame's z = 0 is the covering's
//! free surface and +z points at the object, so penetrating points lie at z < 0. Another
//! physics of the covering can replace the blur (`physics`). Not here: moving the sensor
//! (`controller`).

pub(crate) mod bvh;
mod covering;
mod heights;
mod imaging;
mod physics;

use std::sync::Arc;

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::Stream;
use palpate_core::sensor::{ImageOrder, SensorDescription, SensorParameters};
use palpate_core::units::MM;

use crate::mesh::Mesh;
use crate::noise::{Electronics, NoiseLevel};
use crate::sampler::surface::Surface;
use bvh::Bvh;
use covering::Covering;
pub use heights::HeightMap;
use imaging::Imaging;
pub use physics::{Base, CoveringConfig, Physics};

/// Distance from the free surface of the covering to the back of the housing, metres: an
/// object in front of it collides, one behind it is on the other side of the hand.
pub const HOUSING_DEPTH: f64 = 10.0 * MM;

/// Resolution and physics of a simulated press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressConfig {
    /// Sample points along each side of a taxel.
    pub sub_samples: usize,
    /// Width of covering drawn beyond the array on each side, in taxels.
    pub padding: usize,
    /// Noise added to the sensor's own.
    pub noise_level: NoiseLevel,
    /// Physics of the covering.
    pub physics: Physics,
}

impl PressConfig {
    /// Points at most 1 mm apart, and padding of 2.3 point spreads and at least 4 taxels. For
    /// the DigiTacts sensors these are 2 points and 4 taxels, within 1 % of the limit of fine
    /// sampling.
    #[must_use]
    pub fn for_sensor(sensor: &SensorDescription) -> Self {
        let pitch = sensor.grid().pitch;
        let per_pitch = |length: f64| (length / pitch - 1e-9).ceil() as usize;
        let sub_samples = ((pitch / (1.0 * MM) - 1e-9).ceil() as usize).clamp(1, 4);
        let padding = per_pitch(2.3 * sensor.parameters().point_spread).clamp(4, 64);
        let physics = Physics::PointSpread;
        Self { sub_samples, padding, noise_level: NoiseLevel::NONE, physics }
    }
}

/// An object and the sensor that touches it; reusable, also from many threads.
#[derive(Clone, Debug)]
pub struct PressSimulator {
    mesh: Mesh,
    surface: Surface,
    bvh: Bvh,
    sensor: SensorDescription,
    row_major_sensor: SensorDescription,
    imaging: Imaging,
    /// Shared by clones; `None` for the point spread.
    covering: Option<Arc<Covering>>,
    electronics: Electronics,
    config: PressConfig,
}

/// Effect of a press on the taxels, row-major in the sensor frame's order.
#[derive(Clone, Debug, PartialEq)]
pub enum Load {
    /// Blurred displacements, metres, from [`Physics::PointSpread`].
    Displacements(Vec<f64>),
    /// Mean pressures on the taxels times their gains, pascal, from [`Physics::ElasticCovering`].
    Pressures(Vec<f64>),
}

/// One press without noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Press {
    /// The deepest point of the object under the array, metres below the covering's free
    /// surface. Above the covering's thickness when the sensor is pushed too far, negative
    /// without contact.
    pub max_penetration: f64,
    /// Effect on the taxels.
    pub load: Load,
}

impl PressSimulator {
    /// A simulator with [`PressConfig::for_sensor`].
    ///
    /// A closed mesh that is wound inside out is turned first.
    #[must_use]
    pub fn new(mesh: Mesh, sensor: SensorDescription) -> Self {
        let config = PressConfig::for_sensor(&sensor);
        Self::with_config(mesh, sensor, config)
    }

    /// A simulator with the given configuration.
    #[must_use]
    pub fn with_config(mesh: Mesh, sensor: SensorDescription, config: PressConfig) -> Self {
        let inside_out = mesh.signed_volume() < 0.0 && mesh.is_watertight();
        let mesh = if inside_out { mesh.inside_out() } else { mesh };
        let row_major_sensor = in_row_major_order(&sensor);
        let imaging = Imaging::new(&sensor, config.sub_samples, config.padding);
        let (covering, electronics) = match &config.physics {
            Physics::PointSpread => (None, Electronics::of(&sensor)),
            Physics::ElasticCovering(covering) => {
                let cells = (config.sub_samples, config.padding);
                let elastic = Covering::new(&sensor, &imaging, cells, covering);
                (Some(Arc::new(elastic)), covering.electronics(&sensor))
            }
        };
        let bvh = Bvh::new(&mesh);
        let surface = Surface::new(&mesh);
        Self {
            mesh,
            surface,
            bvh,
            sensor,
            row_major_sensor,
            imaging,
            covering,
            electronics,
            config,
        }
    }

    /// The same object and sensor with another noise level.
    #[must_use]
    pub fn with_noise(self, noise_level: NoiseLevel) -> Self {
        let config = PressConfig { noise_level, ..self.config };
        Self { config, ..self }
    }

    /// The object, in metres, wound outward if it is closed.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The sensor.
    #[must_use]
    pub fn sensor(&self) -> &SensorDescription {
        &self.sensor
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &PressConfig {
        &self.config
    }

    pub(crate) fn surface(&self) -> &Surface {
        &self.surface
    }

    /// The object's surface seen by the sensor from `object_from_sensor`, up to `reach`
    /// metres in front of the covering: enough for every press up to that distance.
    #[must_use]
    pub fn heights(&self, object_from_sensor: Pose, reach: f64) -> HeightMap {
        heights::draw(&self.bvh, &self.imaging, object_from_sensor, reach)
    }

    /// The press after moving `travel` metres along +z from the pose of `heights`.
    #[must_use]
    pub fn press_at(&self, heights: &HeightMap, travel: f64) -> Press {
        let load = match &self.covering {
            None => {
                let thickness = self.sensor.parameters().covering_thickness;
                Load::Displacements(self.imaging.displacements(heights, travel, thickness))
            }
            Some(covering) => Load::Pressures(covering.taxel_pressures(heights, travel)),
        };
        Press { max_penetration: travel - heights.lowest(), load }
    }

    /// The press of a sensor at `object_from_sensor`.
    #[must_use]
    pub fn press(&self, object_from_sensor: Pose) -> Press {
        self.press_at(&self.heights(object_from_sensor, 0.0), 0.0)
    }

    /// The press in free air.
    #[must_use]
    pub fn free_press(&self) -> Press {
        let none = vec![0.0; self.sensor.grid().n_taxels()];
        let load = match self.config.physics {
            Physics::PointSpread => Load::Displacements(none),
            Physics::ElasticCovering(_) => Load::Pressures(none),
        };
        Press { max_penetration: f64::NEG_INFINITY, load }
    }

    /// The pressures that the sensor reports for a press: pascal, row-major in the sensor
    /// frame's order, noise drawn from `stream`.
    #[must_use]
    pub fn pressures(&self, press: &Press, stream: &mut Stream) -> Vec<f64> {
        let level = self.config.noise_level;
        let mut report = |pressure| self.electronics.reported(pressure, level, stream);
        match &press.load {
            Load::Displacements(displacements) => {
                let curve = &self.sensor.parameters().force_curve;
                displacements.iter().map(|d| report(curve.pressure(*d))).collect()
            }
            Load::Pressures(pressures) => pressures.iter().map(|p| report(*p)).collect(),
        }
    }

    /// The reading of sensor `id` at `object_from_sensor`; its session frame is the object's.
    #[must_use]
    pub fn read(&self, id: SensorId, object_from_sensor: Pose, stream: &mut Stream) -> Reading {
        let pressures = self.pressures(&self.press(object_from_sensor), stream);
        self.reading(id, object_from_sensor, &pressures)
    }

    /// Makes a reading of pressures (Pa, row-major in the sensor frame's order) at a pose.
    ///
    /// # Panics
    /// When the pressures are not those of this simulator's sensor.
    #[must_use]
    pub fn reading(&self, id: SensorId, pose: Pose, pressures: &[f64]) -> Reading {
        let pressures: Vec<Option<f64>> = pressures.iter().copied().map(Some).collect();
        Reading::new(id, &self.row_major_sensor, &pressures, pose)
            .expect("a simulated image has the sensor's shape and finite pressures")
    }

    /// Whether the open segment between two points (metres) is free of the object.
    #[must_use]
    pub fn is_clear_between(&self, from_in_object: DVec3, to_in_object: DVec3) -> bool {
        !self.bvh.hits_segment(from_in_object, to_in_object)
    }

    /// Whether the object's surface is nearer than `radius` (metres) to the segment between
    /// two points (metres).
    #[must_use]
    pub fn is_near_segment(&self, from_in_object: DVec3, to_in_object: DVec3, radius: f64) -> bool {
        self.bvh.is_near_segment(from_in_object, to_in_object, radius)
    }
}

/// The same sensor with a driver that sends values in the sensor frame's own order.
pub(crate) fn in_row_major_order(sensor: &SensorDescription) -> SensorDescription {
    let parameters = sensor.parameters().clone();
    let row_major = SensorParameters { image_order: ImageOrder::default(), ..parameters };
    SensorDescription::new(row_major).expect("the order of an image has no bad values")
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};
    use palpate_core::rng::Purpose;

    use super::*;
    use crate::mesh::tests_support::{cuboid, sphere};

    /// A sensor that looks down (-z of the object) from `height` above the object's origin.
    fn looking_down(height: f64) -> Pose {
        let rotation = DQuat::from_rotation_x(std::f64::consts::PI);
        Pose::from_parts(rotation, DVec3::new(0.0, 0.0, height))
    }

    fn displacements(press: &Press) -> &[f64] {
        match &press.load {
            Load::Displacements(displacements) => displacements,
            Load::Pressures(_) => panic!("the point spread gives displacements"),
        }
    }

    #[test]
    fn a_plate_pressed_one_millimetre_displaces_every_taxel_by_one() {
        let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
        for name in SensorDescription::PRESET_NAMES {
            let sensor = SensorDescription::preset_named(name).unwrap();
            let simulator = PressSimulator::new(plate.clone(), sensor);
            let press = simulator.press(looking_down(4.0 * MM)); // the top is at 5 mm
            assert!((press.max_penetration - 1.0 * MM).abs() < 1e-9);
            for displacement in displacements(&press) {
                assert!((displacement - 1.0 * MM).abs() < 1e-9, "{name}: {displacement}");
            }
        }
    }

    #[test]
    fn free_air_gives_an_image_of_zeros() {
        let simulator =
            PressSimulator::new(cuboid(DVec3::splat(0.02)), SensorDescription::digitacts_6x6());
        let press = simulator.press(looking_down(20.0 * MM));
        assert!(press.max_penetration < 0.0);
        assert!(displacements(&press).iter().all(|d| d.abs() < 1e-15));
    }

    #[test]
    fn heights_of_a_sphere_follow_the_formula() {
        // A sphere of radius 30 mm; the sensor's origin is 29 mm above its centre, so the
        // surface above (x, y) is at z = 29 − √(30² − x² − y²) mm in front of the covering.
        let simulator =
            PressSimulator::new(sphere(30.0 * MM, 160), SensorDescription::digitacts_6x6());
        let heights = simulator.heights(looking_down(29.0 * MM), 14.0 * MM);
        assert!((heights.lowest() + 1.0 * MM).abs() < 0.02 * MM, "{}", heights.lowest());
        for (x, y, z) in heights.points() {
            let expected = 29.0 * MM - (0.03f64.powi(2) - x * x - y * y).sqrt();
            // The mesh lies inside the sphere by the sagitta of its edges, below 0.02 mm.
            assert!((z - expected).abs() < 0.05 * MM, "at {x}, {y}: {z} for {expected}");
        }
    }

    #[test]
    fn images_of_deep_presses_are_clamped_to_the_covering() {
        let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
        let simulator = PressSimulator::new(plate, SensorDescription::digitacts_6x6());
        let press = simulator.press(looking_down(0.0));
        assert!((press.max_penetration - 5.0 * MM).abs() < 1e-9);
        assert!(displacements(&press).iter().all(|d| (d - 2.54 * MM).abs() < 1e-9));
    }

    #[test]
    fn an_image_follows_the_object_along_columns_and_rows() {
        // A post under the taxels of large x: columns rise with x, and it is at small y.
        let post = cuboid(DVec3::new(3.0 * MM, 3.0 * MM, 10.0 * MM));
        let simulator = PressSimulator::new(post, SensorDescription::digitacts_6x6());
        // Looking down turns y over: the sensor's y is the object's −y.
        let pose = Pose::from_parts(
            DQuat::from_rotation_x(std::f64::consts::PI),
            DVec3::new(-4.0 * MM, -2.0 * MM, 4.0 * MM),
        );
        let press = simulator.press(pose); // the post is at x = +4, y = −2 in the sensor
        let strongest =
            (0..36).max_by(|&a, &b| displacements(&press)[a].total_cmp(&displacements(&press)[b]));
        // Columns at −5 −3 −1 1 3 5: x = 4 lies between 4 and 5; rows: y = −2 between 1 and 2.
        let (row, col) = (strongest.unwrap() / 6, strongest.unwrap() % 6);
        assert!((1..=2).contains(&row) && (4..=5).contains(&col), "row {row}, column {col}");
    }

    #[test]
    fn equal_streams_give_equal_readings() {
        let sensor = SensorDescription::digitacts_6x6();
        let simulator = PressSimulator::new(sphere(20.0 * MM, 40), sensor);
        let read = |index| {
            let mut stream = Stream::new(5, Purpose::SensorNoise, index);
            simulator.read(SensorId(1), looking_down(19.0 * MM), &mut stream)
        };
        assert_eq!(read(0), read(0));
        assert_ne!(read(0), read(1));
    }

    #[test]
    fn a_closed_mesh_that_is_inside_out_is_turned() {
        let mesh = cuboid(DVec3::splat(0.02)).inside_out();
        let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
        assert!(simulator.mesh().signed_volume() > 0.0);
    }
}
