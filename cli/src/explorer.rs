//! A simulated arm before one object: a plan, all of it from a seed, and the readings on the wire.

use std::ops::ControlFlow;
use std::path::Path;

use anyhow::Context as _;
use glam::DVec3;
use palpate_client::schemas::{Reading, SensorPreset};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_load::wire::on_the_wire;
use palpate_sim::arm::Arm;
use palpate_sim::explore::{Exploration, ExploreConfig, Perturbation, Statistics, Touch, explore};
use palpate_sim::mesh::Mesh;
use palpate_sim::noise::NoiseLevel;
use palpate_sim::press::{PressConfig, PressSimulator};
use palpate_sim::render::{View, arm_png};

use crate::robot::described;

/// Maximum distance of the object's centre from the centre of the workspace, along each axis.
const PLACE_MAX: f64 = 20.0 * MM;

/// Plan of an exploration.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// Mesh of the object, in metres.
    pub(crate) mesh: Mesh,
    /// Sensor of the arm.
    pub(crate) sensor: SensorPreset,
    /// Noise as a fraction of the sensing range.
    pub(crate) noise: f64,
    /// Number of readings wanted.
    pub(crate) readings: usize,
    /// The probability of the local strategy.
    pub(crate) local: f64,
    /// Number of links of the arm.
    pub(crate) links: usize,
    /// Seed of all random choices.
    pub(crate) seed: u64,
    /// Whether the object moves when touched.
    pub(crate) perturb: bool,
    /// Maximum number of targets that the planner chooses.
    pub(crate) iterations: usize,
}

impl Plan {
    /// Explores. `taken` receives every reading as it is taken, and from time to time `None`; it
    /// may stop the exploration.
    pub(crate) fn explore(
        &self,
        taken: &mut dyn FnMut(Option<Reading>) -> ControlFlow<()>,
    ) -> anyhow::Result<Exploration> {
        let simulator = self.simulator()?;
        let config = self.config(&simulator);
        let mut seq = 0;
        let mut progress = |_: &Statistics, touch: Option<&Touch>| match touch {
            Some(touch) => {
                seq += 1;
                taken(Some(self.to_wire(touch, seq - 1)))
            }
            None => taken(None),
        };
        let place = self.session_from_mesh();
        Ok(explore(&simulator, place, self.readings, self.seed, &config, &mut progress)?)
    }

    fn simulator(&self) -> anyhow::Result<PressSimulator> {
        let noise_level = NoiseLevel::new(self.noise).context("noise is not within 0 to 2")?;
        let sensor = described(self.sensor);
        let config = PressConfig { noise_level, ..PressConfig::for_sensor(&sensor) };
        Ok(PressSimulator::with_config(self.mesh.clone(), sensor, config))
    }

    fn config(&self, simulator: &PressSimulator) -> ExploreConfig {
        ExploreConfig {
            local: self.local,
            perturbation: self.perturb.then(|| Perturbation::printed(&self.mesh)),
            iterations_max: self.iterations,
            ..ExploreConfig::for_simulator(simulator, self.links)
        }
    }

    /// Pose of the object: random orientation, its centre near that of the workspace.
    fn session_from_mesh(&self) -> Pose {
        let mut place = Stream::new(self.seed, Purpose::ObjectPose, 0);
        let turned = Pose::from_parts(place.rotation(), DVec3::ZERO);
        let mut along = || place.uniform(-PLACE_MAX, PLACE_MAX);
        let middle_in_session = DVec3::new(along(), along(), along());
        let (low, high) = self.mesh.bounds();
        let offset = turned * (0.5 * (low + high));
        Pose::from_parts(turned.rotation, middle_in_session - offset)
    }

    /// A touch in the wire format. Its robot is named after the seed, so that a reading sent twice
    /// counts once.
    fn to_wire(&self, touch: &Touch, seq: u64) -> Reading {
        Reading {
            robot: Some(format!("explorer-{}", self.seed)),
            seq: Some(seq),
            ..on_the_wire(&touch.reading, self.sensor.name())
        }
    }
}

/// Draws the arm at its last touch, the object at that time, and all touches.
pub(crate) fn write_picture(
    path: &Path,
    plan: &Plan,
    explored: &Exploration,
) -> anyhow::Result<()> {
    let last = explored.touches.last().context("there is no touch to draw")?;
    let simulator = plan.simulator()?;
    let arm = Arm::new(plan.config(&simulator).arm)?;
    let capsules = arm.capsules(&arm.forward(&last.configuration));
    let mesh = plan.mesh.moved_by(last.session_from_object);
    let poses: Vec<Pose> =
        explored.touches.iter().map(|touch| touch.reading.session_from_sensor()).collect();
    let png = arm_png(&capsules, &mesh, &poses, View::default(), 900);
    std::fs::write(path, png).with_context(|| format!("cannot write {}", path.display()))
}

/// Parses a noise level.
pub(crate) fn parse_noise(text: &str) -> Result<f64, String> {
    let level = text.parse::<f64>().ok().filter(|level| NoiseLevel::new(*level).is_some());
    level.ok_or_else(|| "expected a number from 0 to 2".to_owned())
}

#[cfg(test)]
mod tests {
    use palpate_sim::shapes;

    use super::*;

    fn plan(seed: u64) -> Plan {
        Plan {
            mesh: shapes::example("mug").unwrap(),
            sensor: SensorPreset::Digitacts6x6,
            noise: 0.0,
            readings: 4,
            local: 0.5,
            links: 8,
            seed,
            perturb: false,
            iterations: 20_000,
        }
    }

    fn readings(plan: &Plan) -> Vec<Reading> {
        let mut readings = Vec::new();
        plan.explore(&mut |reading| {
            readings.extend(reading);
            ControlFlow::Continue(())
        })
        .unwrap();
        readings
    }

    #[test]
    fn a_seed_decides_the_readings_and_their_numbers() {
        let first = readings(&plan(7));
        assert_eq!(first, readings(&plan(7)));
        assert_ne!(first[0].pose, readings(&plan(8))[0].pose);
        let seqs: Vec<_> = first.iter().map(|reading| reading.seq).collect();
        assert_eq!(seqs, [Some(0), Some(1), Some(2), Some(3)]);
        assert!(first.iter().all(|reading| reading.robot.as_deref() == Some("explorer-7")));
    }

    fn explored(plan: &Plan) -> Exploration {
        plan.explore(&mut |_| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn strategy_links_noise_and_object_moves_follow_the_plan() {
        let rested = explored(&plan(7));
        let place = rested.touches[0].session_from_object;
        assert!(rested.touches.iter().all(|touch| touch.session_from_object == place));
        assert_eq!(rested.touches[0].configuration.angles().len(), 2 * 8);

        let global = explored(&Plan { local: 0.0, ..plan(7) }).statistics;
        assert_eq!(global.local_iterations, 0);
        let local = explored(&Plan { local: 1.0, ..plan(7) }).statistics;
        assert!(local.local_iterations > 0 && local.local_iterations < local.iterations);

        let longer = explored(&Plan { links: 12, readings: 1, ..plan(7) });
        assert_eq!(longer.touches[0].configuration.angles().len(), 2 * 12);

        let moved = explored(&Plan { perturb: true, ..plan(7) });
        let (before, after) = (&moved.touches[0], &moved.touches[1]);
        assert_eq!(before.session_from_object, place, "it lies where it lay until it is touched");
        assert_ne!(before.session_from_object, after.session_from_object);

        let noisy = explored(&Plan { noise: 0.2, ..plan(7) });
        assert_ne!(noisy.touches[0].reading.image(), rested.touches[0].reading.image());
        let few = explored(&Plan { iterations: 2, ..plan(7) });
        assert_eq!((few.statistics.iterations, few.touches.len()), (2, 0));
    }

    #[test]
    fn the_object_lies_in_the_middle_of_the_workspace() {
        let shifted = plan(7).mesh.translated(DVec3::splat(5.0));
        let plan = Plan { mesh: shifted, ..plan(7) };
        let (low, high) = plan.mesh.moved_by(plan.session_from_mesh()).bounds();
        // The centre of a rotated box is near, but not at, the centre of its bounds.
        assert!((0.5 * (low + high)).abs().max_element() < 40.0 * MM);
        assert_eq!(readings(&plan).len(), 4);
    }
}
