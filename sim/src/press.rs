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
mod facets;
mod heights;
mod imaging;
mod physics;

use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::Stream;
use palpate_core::sensor::{ImageOrder, SensorDescription, SensorParameters};
use palpate_core::units::MM;

use crate::mesh::Mesh;
use crate::noise::{Electronics, NoiseLevel, taxel_gains};
use crate::surface::{Surface, SurfacePoint};
use bvh::Bvh;
use covering::Covering;
use facets::Facets;
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
    /// Points at most 1 mm apart, and padding of 2.3 point spreads and at least 4 taxels, or as
    /// far as the covering reaches. For the DigiTacts sensors these are 2 points and 4 taxels,
    /// within 1 % of the limit of fine sampling.
    #[must_use]
    pub fn for_sensor(sensor: &SensorDescription) -> Self {
        let pitch = sensor.grid().pitch;
        let per_pitch = |length: f64| (length / pitch - 1e-9).ceil() as usize;
        let sub_samples = ((pitch / (1.0 * MM) - 1e-9).ceil() as usize).clamp(1, 4);
        let padding = match sensor.parameters().coupling.margin {
            None => per_pitch(2.3 * sensor.parameters().point_spread).clamp(4, 64),
            Some(margin) => per_pitch(margin).min(64),
        };
        let physics = Physics::PointSpread;
        Self { sub_samples, padding, noise_level: NoiseLevel::NONE, physics }
    }
}

/// An object and the sensor that touches it; reusable, also from many threads.
#[derive(Clone, Debug)]
pub struct PressSimulator {
    /// The object, shared by clones and by other sensors that press it.
    object: Arc<Pressed>,
    sensor: SensorDescription,
    row_major_sensor: SensorDescription,
    imaging: Imaging,
    /// Shared by clones; `None` for the point spread.
    covering: Option<Arc<Covering>>,
    /// Shared by clones; `None` for taxels on a grid.
    facets: Option<Arc<Facets>>,
    electronics: Electronics,
    /// Gain of each taxel, row-major; none when all are 1.
    gains: Vec<f64>,
    config: PressConfig,
}

/// An object that is pressed, and what finds its surface.
#[derive(Debug)]
struct Pressed {
    mesh: Mesh,
    surface: Surface,
    bvh: Bvh,
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

    /// A simulator with the given configuration. All taxels have the gain 1;
    /// [`PressSimulator::with_sensor`] draws gains.
    ///
    /// # Panics
    /// For an elastic covering over a list of taxels: its physics needs rows and columns.
    #[must_use]
    pub fn with_config(mesh: Mesh, sensor: SensorDescription, config: PressConfig) -> Self {
        let inside_out = mesh.signed_volume() < 0.0 && mesh.is_watertight();
        let mesh = if inside_out { mesh.inside_out() } else { mesh };
        let (bvh, surface) = (Bvh::new(&mesh), Surface::new(&mesh));
        Self::of_object(Arc::new(Pressed { mesh, surface, bvh }), sensor, config)
    }

    fn of_object(object: Arc<Pressed>, sensor: SensorDescription, config: PressConfig) -> Self {
        let is_elastic = matches!(config.physics, Physics::ElasticCovering(_));
        assert!(
            !is_elastic || sensor.listed().is_none(),
            "an elastic covering needs rows and columns"
        );
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
        let facets = sensor.layout().map(|layout| Arc::new(Facets::new(&sensor, layout)));
        let gains = Vec::new();
        Self {
            object,
            sensor,
            row_major_sensor,
            imaging,
            covering,
            facets,
            electronics,
            gains,
            config,
        }
    }

    /// The same object under another sensor, in the physics of the point spread. The gains of its
    /// taxels are drawn from `stream`.
    #[must_use]
    pub fn with_sensor(&self, sensor: SensorDescription, stream: &mut Stream) -> Self {
        let noise_level = self.config.noise_level;
        let config = PressConfig { noise_level, ..PressConfig::for_sensor(&sensor) };
        let spread = sensor.parameters().coupling.gain_spread;
        let n_taxels = sensor.n_taxels();
        let pressed = Self::of_object(Arc::clone(&self.object), sensor, config);
        if spread <= 0.0 {
            return pressed;
        }
        Self { gains: taxel_gains(n_taxels, spread, stream), ..pressed }
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
        &self.object.mesh
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
        &self.object.surface
    }

    /// The object's surface seen by the sensor from `object_from_sensor`, up to `reach`
    /// metres in front of the covering: enough for every press up to that distance.
    #[must_use]
    pub fn heights(&self, object_from_sensor: Pose, reach: f64) -> HeightMap {
        let bvh = &self.object.bvh;
        match &self.facets {
            None => heights::draw(bvh, &self.imaging, object_from_sensor, reach),
            Some(facets) => {
                let lowest = facets.lowest(bvh, object_from_sensor, reach);
                HeightMap::of_lowest(lowest, reach, object_from_sensor)
            }
        }
    }

    /// The press after moving `travel` metres along +z from the pose of `heights`.
    #[must_use]
    pub fn press_at(&self, heights: &HeightMap, travel: f64) -> Press {
        let load = match (&self.covering, &self.facets) {
            (None, None) => {
                let thickness = self.sensor.parameters().covering_thickness;
                Load::Displacements(self.imaging.displacements(heights, travel, thickness))
            }
            (None, Some(facets)) => {
                let onwards = Pose::from_parts(DQuat::IDENTITY, travel * DVec3::Z);
                let pressed_from = heights.seen_from() * onwards;
                Load::Displacements(facets.displacements(&self.object.bvh, pressed_from))
            }
            (Some(covering), _) => Load::Pressures(covering.taxel_pressures(heights, travel)),
        };
        Press { max_penetration: travel - heights.lowest(), load }
    }

    /// The press of a sensor at `object_from_sensor`.
    #[must_use]
    pub fn press(&self, object_from_sensor: Pose) -> Press {
        self.press_at(&self.heights(object_from_sensor, 0.0), 0.0)
    }

    /// The cells of the covering at whose middles a press is sampled: rows (along +y), columns
    /// (along +x) and side, metres. They are centred on the array and reach as far beyond it as
    /// [`PressConfig::padding`].
    #[must_use]
    pub fn cells(&self) -> (usize, usize, f64) {
        (self.imaging.rows(), self.imaging.cols(), self.imaging.step())
    }

    /// The press of an object that indents each cell as given: metres, row-major as in
    /// [`PressSimulator::cells`]. Indentations may come from another model of contact.
    ///
    /// # Panics
    /// Unless there is an indentation for each cell.
    #[must_use]
    pub fn press_of(&self, indentations: &[f64]) -> Press {
        let (rows, cols, _) = self.cells();
        assert_eq!(indentations.len(), rows * cols, "each cell has an indentation");
        self.press_at(&heights::of_indentations(&self.imaging, indentations), 0.0)
    }

    /// The press in free air.
    #[must_use]
    pub fn free_press(&self) -> Press {
        let none = vec![0.0; self.sensor.n_taxels()];
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
        let mut pressures: Vec<f64> = match &press.load {
            Load::Displacements(displacements) => {
                let curve = &self.sensor.parameters().force_curve;
                displacements.iter().map(|d| curve.pressure(*d)).collect()
            }
            Load::Pressures(pressures) => pressures.clone(),
        };
        self.couple(&mut pressures, stream);
        let report = |pressure| self.electronics.reported(pressure, level, stream);
        pressures.into_iter().map(report).collect()
    }

    /// Gains, hysteresis and cross-talk of the taxels, in place.
    fn couple(&self, pressures: &mut [f64], stream: &mut Stream) {
        pressures.iter_mut().zip(&self.gains).for_each(|(pressure, gain)| *pressure *= gain);
        let coupling = &self.sensor.parameters().coupling;
        if coupling.hysteresis > 0.0 {
            let factor = 1.0 + stream.uniform(-coupling.hysteresis, coupling.hysteresis);
            pressures.iter_mut().for_each(|pressure| *pressure *= factor);
        }
        if coupling.cross_talk > 0.0 {
            let own = pressures.to_vec();
            for (at, pressure) in pressures.iter_mut().enumerate() {
                let heard: f64 = self.beside(at).into_iter().map(|taxel| own[taxel]).sum();
                *pressure += coupling.cross_talk * heard;
            }
        }
    }

    /// The taxels beside one: its neighbours in rows and columns, or of a layout those nearer than
    /// 1.2 pitches.
    fn beside(&self, at: usize) -> Vec<usize> {
        if let Some(layout) = self.sensor.layout() {
            let (taxels, near) = (layout.taxels(), 1.2 * layout.grid().pitch);
            let is_beside = |other: &usize| {
                *other != at && taxels[*other].position.distance(taxels[at].position) < near
            };
            return (0..taxels.len()).filter(is_beside).collect();
        }
        let (rows, cols) = (self.sensor.grid().rows, self.sensor.grid().cols);
        let (row, col) = (at / cols, at % cols);
        let beside = [
            (row > 0).then(|| at - cols),
            (row + 1 < rows).then_some(at + cols),
            (col > 0).then(|| at - 1),
            (col + 1 < cols).then_some(at + 1),
        ];
        beside.into_iter().flatten().collect()
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

    /// The point of the object's surface nearest to a point (metres), and the outward unit normal
    /// of its triangle.
    #[must_use]
    pub fn nearest(&self, point_in_object: DVec3) -> (DVec3, DVec3) {
        self.object.bvh.nearest(point_in_object)
    }

    /// A point drawn from the object's surface by area.
    pub fn draw_point(&self, stream: &mut Stream) -> SurfacePoint {
        self.object.surface.draw(None, stream)
    }

    /// Whether the open segment between two points (metres) is free of the object.
    #[must_use]
    pub fn is_clear_between(&self, from_in_object: DVec3, to_in_object: DVec3) -> bool {
        !self.object.bvh.hits_segment(from_in_object, to_in_object)
    }

    /// Whether the object's surface is nearer than `radius` (metres) to the segment between
    /// two points (metres).
    #[must_use]
    pub fn is_near_segment(&self, from_in_object: DVec3, to_in_object: DVec3, radius: f64) -> bool {
        self.object.bvh.is_near_segment(from_in_object, to_in_object, radius)
    }
}

/// The same sensor with a driver that sends values in the sensor frame's own order.
pub(crate) fn in_row_major_order(sensor: &SensorDescription) -> SensorDescription {
    let parameters = sensor.parameters().clone();
    let row_major = SensorParameters { image_order: ImageOrder::default(), ..parameters };
    SensorDescription::new(row_major).expect("the order of an image has no bad values")
}

#[cfg(test)]
mod tests;
