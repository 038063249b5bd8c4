//! A simulated robot that touches a mesh somewhere in its session frame. It is guided to the
//! surface, as by a camera or by next touches of the server, and knows only its own poses and
//! pressures.
//!
//! The object's pose and the touches come from a seed and the number of the trial, from random
//! streams that training never uses.

use std::f64::consts::{PI, SQRT_2};
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use glam::{DQuat, DVec3};
use palpate_client::schemas::{self, MeshUnit, NextTouch, PosePrior, SensorPreset, TouchWorkspace};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::{MM, Shown};
use palpate_sim::controller::{Landing, RecenterConfig, touch_recentered};
use palpate_sim::mesh::{Mesh, MeshFile, MeshFormat, other_content};
use palpate_sim::press::PressSimulator;
use palpate_sim::rig::{INDENTATION, PlanarPose};
use palpate_sim::sampler::{SampleError, SamplerConfig, touch_anywhere};

use crate::output;

/// Maximum distance of the object from the session frame's origin, along each axis.
const PLACE_MAX: f64 = 200.0 * MM;

/// A press as sent to the server.
pub(crate) struct Press {
    /// `session_from_sensor`; `None` if the robot does not know it.
    pub(crate) pose: Option<schemas::Pose>,
    /// Pressures, Pa.
    pub(crate) image: Vec<Option<f64>>,
    /// Distance travelled without contact, in metres, if the press touched nothing.
    pub(crate) missed: Option<f64>,
}

/// Maximum distance of the object from the camera's estimate, along each axis.
const SEEN_WITHIN: f64 = 8.0 * MM;
/// Maximum rotation of the object from the camera's estimate, rad.
const SEEN_WITHIN_ANGLE: f64 = 0.2;

/// A robot's way of touching.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Approach {
    /// Anywhere, along the surface's normal.
    Anywhere,
    /// Straight down on an object that lies flat.
    StraightDown,
    /// Along a ray that the server proposes, from outside; an off-centre contact is centred.
    AsTold,
}

/// A robot in front of one object.
pub(crate) struct Robot {
    simulator: Arc<PressSimulator>,
    config: SamplerConfig,
    approach: Approach,
    knows_poses: bool,
    session_from_mesh: Pose,
    touches: Stream,
    seen: Stream,
}

impl Robot {
    /// A robot guided by the server. `seed` and `trial` decide its object's pose.
    pub(crate) fn new(simulator: Arc<PressSimulator>, seed: u64, trial: u64) -> Self {
        Self::approaching(simulator, Approach::AsTold, seed, trial)
    }

    /// A robot that touches by `approach`.
    pub(crate) fn approaching(
        simulator: Arc<PressSimulator>,
        approach: Approach,
        seed: u64,
        trial: u64,
    ) -> Self {
        let mut place = Stream::new(seed, Purpose::ObjectPose, trial);
        let rotation = place.rotation();
        let mut along = || place.uniform(-PLACE_MAX, PLACE_MAX);
        let translation = DVec3::new(along(), along(), along());
        Self {
            config: SamplerConfig::for_simulator(&simulator),
            simulator,
            approach,
            knows_poses: true,
            session_from_mesh: Pose::from_parts(rotation, translation),
            touches: Stream::new(seed, Purpose::SensorNoise, trial),
            seen: place,
        }
    }

    /// The same robot without knowledge of its sensor's pose.
    pub(crate) fn without_poses(self) -> Self {
        Self { knows_poses: false, ..self }
    }

    /// Whether the robot asks the server where to touch.
    pub(crate) fn wants_to_be_told(&self) -> bool {
        self.approach == Approach::AsTold
    }

    /// Presses along a ray; `None` if it felt something but found no stable contact.
    pub(crate) fn touch_along(&mut self, told: &NextTouch) -> anyhow::Result<Option<Press>> {
        let begin = Pose::new(told.pose.position, told.pose.orientation)?;
        let noise_level = self.simulator.config().noise_level;
        let mut config = RecenterConfig::for_sensor(self.simulator.sensor(), noise_level);
        config.contact.approach_max = told.reach_m;
        let mesh_from_sensor = self.session_from_mesh.inverse() * begin;
        let landing =
            touch_recentered(&self.simulator, mesh_from_sensor, &config, &mut self.touches);
        let (at, pressures, missed) = match landing {
            Landing::Converged { contact, .. } => {
                (contact.object_from_sensor, contact.pressures, None)
            }
            Landing::Missed { miss, .. } => {
                (miss.object_from_sensor, miss.pressures, Some(miss.travel))
            }
            Landing::NoConvergence | Landing::Unreachable => return Ok(None),
        };
        let image = pressures.into_iter().map(Some).collect();
        Ok(Some(Press { pose: Some(wire_pose(self.session_from_mesh * at)), image, missed }))
    }

    /// A ball that contains the object, as a camera would report it.
    pub(crate) fn workspace(&self) -> TouchWorkspace {
        let (low, high) = self.simulator.mesh().bounds();
        let center = self.session_from_mesh * (0.5 * (low + high));
        let radius = 0.5 * low.distance(high) + SEEN_WITHIN;
        TouchWorkspace { center: center.to_array(), radius }
    }

    /// Touches the object once, at a random place.
    pub(crate) fn touch(&mut self) -> Result<Press, SampleError> {
        let reading = match self.approach {
            Approach::Anywhere | Approach::AsTold => {
                touch_anywhere(&self.simulator, SensorId(0), &self.config, &mut self.touches)?
            }
            Approach::StraightDown => self.press_down(),
        };
        // The simulator's session frame is the mesh frame.
        let session_from_sensor = self.session_from_mesh * reading.sent_pose();
        let image = reading.values();
        let pose = self.knows_poses.then(|| wire_pose(session_from_sensor));
        Ok(Press { pose, image, missed: None })
    }

    /// Presses straight down at a random place over the object.
    fn press_down(&mut self) -> Reading {
        let (low, high) = self.simulator.mesh().bounds();
        let at = PlanarPose {
            x: self.touches.uniform(low.x, high.x),
            y: self.touches.uniform(low.y, high.y),
            angle: self.touches.uniform(-PI, PI),
        };
        let below_top = INDENTATION * self.simulator.sensor().parameters().covering_thickness;
        let mesh_from_sensor = at.object_from_sensor(below_top - high.z);
        self.simulator.read(SensorId(0), mesh_from_sensor, &mut self.touches)
    }

    /// A camera's rough estimate of the object frame, as a session's prior.
    pub(crate) fn pose_prior(&mut self, origin_in_mesh: [f64; 3]) -> PosePrior {
        let session_from_object = self.session_from_object(origin_in_mesh);
        let mut along = |reach: f64| self.seen.uniform(-reach, reach);
        let off = DVec3::new(along(SEEN_WITHIN), along(SEEN_WITHIN), along(SEEN_WITHIN));
        match self.approach {
            Approach::StraightDown => {
                let turn = along(PI);
                // The pressed face is the highest of the object.
                let height = self.simulator.mesh().bounds().1.z - origin_in_mesh[2];
                let object_from_plane =
                    Pose::from_parts(DQuat::from_rotation_z(turn), off.with_z(height));
                PosePrior::Planar {
                    plane: Some(wire_pose(session_from_object * object_from_plane)),
                    // The plane's origin was moved by at most this length.
                    half_extent: Some(SEEN_WITHIN * SQRT_2),
                    center: None,
                    angle: None,
                    half_angle: None,
                }
            }
            Approach::Anywhere | Approach::AsTold => {
                let axis = self.seen.direction();
                let turn = DQuat::from_axis_angle(axis, self.seen.uniform(0.0, SEEN_WITHIN_ANGLE));
                PosePrior::Bounded {
                    pose: wire_pose(Pose::from_parts(
                        turn * session_from_object.rotation,
                        session_from_object.translation + off,
                    )),
                    half_extents: [1.1 * SEEN_WITHIN; 3],
                    half_angle: 1.1 * SEEN_WITHIN_ANGLE,
                }
            }
        }
    }

    /// Pose of the object frame, whose origin is at `origin_in_mesh`, metres.
    pub(crate) fn session_from_object(&self, origin_in_mesh: [f64; 3]) -> Pose {
        let mesh_from_object = Pose { translation: origin_in_mesh.into(), ..Pose::IDENTITY };
        self.session_from_mesh * mesh_from_object
    }
}

/// Reads a mesh file in `unit`, or millimetres, if the file does not record its own.
pub(crate) fn read_mesh(path: &Path, unit: Option<MeshUnit>) -> anyhow::Result<MeshFile> {
    let (format, bytes) = read_mesh_file(path)?;
    let unit = unit.or(Some(MeshUnit::Mm).filter(|_| !format.knows_its_unit()));
    Mesh::read(format, &bytes, unit.map(MeshUnit::metres))
        .with_context(|| format!("{} is not a mesh that can be touched", path.display()))
}

/// Text on the interpretation of a mesh file: the resulting size, and what is remarkable.
pub(crate) fn read_as(file: &MeshFile) -> String {
    let units = [MeshUnit::M, MeshUnit::Mm, MeshUnit::Cm, MeshUnit::In];
    let named = units.iter().find(|unit| (unit.metres() / file.unit - 1.0).abs() < 1e-9);
    let unit = named.map_or(format!("{} mm", Shown(file.unit / MM)), output::word);
    let [x, y, z] = (file.mesh.extent() / MM).to_array();
    let mut text = format!("mesh read as {unit}: {x:.1} × {y:.1} × {z:.1} mm");
    for remark in &file.remarks {
        text += &format!("\nwarning: {remark}");
    }
    text
}

/// The bytes of a mesh file and its format, from its extension or, failing that, its content.
pub(crate) fn read_mesh_file(path: &Path) -> anyhow::Result<(MeshFormat, Vec<u8>)> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let format = MeshFormat::from_extension(extension).or(MeshFormat::from_content(&bytes));
    let format = format.with_context(|| match other_content(&bytes) {
        Some(found) => format!("{} is {found}", path.display()),
        None => {
            format!("{} is not named .stl, .obj, .ply, .off, .glb or .3mf", path.display())
        }
    })?;
    Ok((format, bytes))
}

/// Name of a format on the wire.
pub(crate) fn wire_format(format: MeshFormat) -> schemas::MeshFormat {
    match format {
        MeshFormat::Stl => schemas::MeshFormat::Stl,
        MeshFormat::Obj => schemas::MeshFormat::Obj,
        MeshFormat::Ply => schemas::MeshFormat::Ply,
        MeshFormat::Off => schemas::MeshFormat::Off,
        MeshFormat::Glb => schemas::MeshFormat::Glb,
        MeshFormat::ThreeMf => schemas::MeshFormat::ThreeMf,
    }
}

/// A pose on the wire.
pub(crate) fn wire_pose(pose: Pose) -> schemas::Pose {
    schemas::Pose { position: pose.translation.to_array(), orientation: pose.rotation.to_array() }
}

/// The preset's description, for the simulation.
pub(crate) fn described(preset: SensorPreset) -> SensorDescription {
    SensorDescription::preset_named(preset.name()).expect("the wire's presets are core's")
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::SensorDescription;
    use palpate_sim::shapes;

    use super::*;

    fn robot(trial: u64) -> Robot {
        let mesh = shapes::example("hammer").unwrap();
        let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
        Robot::new(Arc::new(simulator), 7, trial)
    }

    #[test]
    fn a_trial_is_always_the_same_and_another_one_is_not() {
        let first = |trial| robot(trial).touch().unwrap();
        assert_eq!(first(1).pose, first(1).pose);
        assert_eq!(first(1).image, first(1).image);
        assert_ne!(first(1).pose, first(2).pose);
    }

    #[test]
    fn a_robot_without_poses_touches_alike() {
        let (mut with, mut without) = (robot(2), robot(2).without_poses());
        let (with, without) = (with.touch().unwrap(), without.touch().unwrap());
        assert_eq!((with.image, without.pose), (without.image, None));
        assert!(with.pose.is_some());
    }

    #[test]
    fn touches_lie_on_the_object_where_it_was_put() {
        let mut robot = robot(3);
        let centre = robot.session_from_object([0.0; 3]).translation;
        for _ in 0..5 {
            let press = robot.touch().unwrap();
            let distance = centre.distance(press.pose.unwrap().position.into());
            assert!(distance < 80.0 * MM, "{distance}");
            assert!(press.image.iter().flatten().any(|pressure| *pressure > 0.0));
        }
    }
}
