//! Blind exploration: an arm that knows only its workspace finds an object and touches it.
//!
//! Source: sections 4.2.1 and 4.4.1.1. A tree of free configurations grows towards targets
//! drawn by a global or a local strategy; when the sensor meets something on the way, the
//! contact controllers take over. Readings have the `session_from_sensor` of the arm's
//! kinematics. A seed determines everything; the number of iterations is bounded. Not here:
//! touches chosen by a belief about the object.

mod cells;
mod config;
mod coverage;
mod perturb;
mod scene;
mod tree;

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};

use crate::arm::{Arm, ArmError, Configuration, InverseConfig, Target};
use crate::controller::{Landing, advanced, touch_recentered_carried};
use crate::mesh::Mesh;
use crate::press::PressSimulator;
use cells::ContactCells;
pub use config::{ExploreConfig, PressAgain};
pub use coverage::covered_share;
pub use perturb::Perturbation;
pub use scene::Bounds;
use scene::{Motion, Scene};
pub use tree::{Tree, Vertex};

/// Counters of the planner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Targets chosen.
    pub iterations: usize,
    /// Targets chosen by the local strategy.
    pub local_iterations: usize,
    /// Targets that no configuration of the arm came nearer to.
    pub inverse_failures: usize,
    /// Motions stopped because a part other than the covering would have collided.
    pub collisions: usize,
    /// Contacts of the sensor with the object.
    pub contacts: usize,
    /// Motions that met the object at a place pressed before, and were not followed by a press.
    pub left_alone: usize,
    /// Contacts at which the controllers gave up.
    pub rejected: usize,
    /// Rejected contacts at which the arm could not follow the controllers.
    pub unreachable: usize,
    /// Contacts that yielded a reading.
    pub readings: usize,
    /// Vertices of the tree.
    pub vertices: usize,
}

/// A contact: where the sensor met the object, and where the controllers came to rest.
#[derive(Clone, Copy, Debug)]
struct Pressed {
    met: DVec3,
    rested: Option<DVec3>,
}

impl Pressed {
    fn is_near(&self, place: DVec3, radius: f64) -> bool {
        let is_near = |at: DVec3| at.distance_squared(place) <= radius * radius;
        is_near(self.met) || self.rested.is_some_and(is_near)
    }
}

/// A reading with its ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Touch {
    /// The reading, with `session_from_sensor`.
    pub reading: Reading,
    /// Pose of the object, unknown to the planner.
    pub session_from_object: Pose,
    /// Number of rounds of Press and Orient.
    pub rounds: usize,
    /// The arm's configuration.
    pub configuration: Configuration,
}

/// Result of an exploration.
#[derive(Clone, Debug, PartialEq)]
pub struct Exploration {
    /// The readings, in order; fewer than requested when the iterations did not suffice or
    /// the caller stopped the exploration.
    pub touches: Vec<Touch>,
    /// The planner's counters.
    pub statistics: Statistics,
    /// The planner's tree.
    pub tree: Tree,
}

/// Explores an object at `session_from_object` until `n` readings are taken.
///
/// `progress` is called with every reading, and now and then without one; it may stop the
/// exploration.
///
/// # Errors
/// [`ArmError`] when `config.arm` is not an arm.
pub fn explore(
    simulator: &PressSimulator,
    session_from_object: Pose,
    n: usize,
    seed: u64,
    config: &ExploreConfig,
    progress: &mut dyn FnMut(&Statistics, Option<&Touch>) -> ControlFlow<()>,
) -> Result<Exploration, ArmError> {
    const SILENT_ITERATIONS: usize = 256;
    let mut explorer = Explorer::new(simulator, session_from_object, seed, config)?;
    let mut touches = Vec::with_capacity(n.min(10_000));
    while touches.len() < n && explorer.statistics.iterations < config.iterations_max {
        let touch = explorer.iterate();
        let is_due = explorer.statistics.iterations.is_multiple_of(SILENT_ITERATIONS);
        let goes_on = if touch.is_some() || is_due {
            progress(&explorer.statistics(), touch.as_ref())
        } else {
            ControlFlow::Continue(())
        };
        touches.extend(touch);
        if goes_on.is_break() {
            break;
        }
    }
    Ok(Exploration { touches, statistics: explorer.statistics(), tree: explorer.tree })
}

/// The arm, its findings so far, and the object, whose pose the planner does not know.
#[derive(Clone, Debug)]
pub struct Explorer<'a> {
    simulator: &'a PressSimulator,
    config: ExploreConfig,
    arm: Arm,
    session_from_object: Pose,
    tree: Tree,
    cells: ContactCells,
    pressed: Vec<Pressed>,
    statistics: Statistics,
    targets: Stream,
    moves: Stream,
    seed: u64,
}

impl<'a> Explorer<'a> {
    /// An arm in its initial configuration before an object at `session_from_object`.
    ///
    /// # Errors
    /// [`ArmError`] when `config.arm` is not an arm.
    pub fn new(
        simulator: &'a PressSimulator,
        session_from_object: Pose,
        seed: u64,
        config: &ExploreConfig,
    ) -> Result<Self, ArmError> {
        let arm = Arm::new(config.arm)?;
        let initial = arm.initial();
        let position = arm.forward(&initial).session_from_sensor.translation;
        Ok(Self {
            simulator,
            config: *config,
            tree: Tree::new(initial, position),
            arm,
            session_from_object,
            cells: ContactCells::new(config.cell_width),
            pressed: Vec::new(),
            statistics: Statistics::default(),
            targets: Stream::new(seed, Purpose::Exploration, 0),
            moves: Stream::new(seed, Purpose::Perturbation, 0),
            seed,
        })
    }

    /// The counters so far.
    #[must_use]
    pub fn statistics(&self) -> Statistics {
        Statistics { vertices: self.tree.vertices().len(), ..self.statistics }
    }

    /// The tree so far.
    #[must_use]
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// The arm.
    #[must_use]
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// Chooses a target and takes one step towards it; the reading, if the step led to one.
    pub fn iterate(&mut self) -> Option<Touch> {
        self.statistics.iterations += 1;
        let target = self.draw_target();
        let scene =
            Scene::new(&self.arm, self.simulator, self.session_from_object, self.config.room);
        let vertex = self.tree.nearest_open(target, |from, to| scene.is_free(from, to))?;
        let from = &self.tree.vertices()[vertex].configuration;
        let step = step_towards(&self.arm, from, target, &self.config);
        let mut inverse = |target: Target| {
            self.arm.inverse(&target, from, &InverseConfig::COARSE, &mut self.targets)
        };
        // Close to the limit of its reach the arm cannot turn the sensor freely.
        let facing = Target::Facing { position: step.position, direction: step.direction };
        let Some(to) = inverse(facing).or_else(|| inverse(Target::Position(step.position))) else {
            self.statistics.inverse_failures += 1;
            return None;
        };
        match scene.motion(from, &to) {
            Motion::Blocked => {
                self.statistics.collisions += 1;
                None
            }
            Motion::Arrived => {
                self.add(to, vertex);
                None
            }
            Motion::Sensed { free, touching } => {
                let last_free = if free == *from { vertex } else { self.add(free, vertex) };
                let place = self.arm.forward(&touching).session_from_sensor.translation;
                if self.leaves_alone(place) {
                    self.statistics.left_alone += 1;
                    return None;
                }
                self.touch(last_free, touching)
            }
        }
    }

    /// A target of the global or the local strategy, chosen at random.
    fn draw_target(&mut self) -> DVec3 {
        let is_local = self.targets.uniform(0.0, 1.0) < self.config.local;
        let contact = if is_local { self.cells.draw(&mut self.targets) } else { None };
        if let Some(contact) = contact {
            self.statistics.local_iterations += 1;
            // The cube root makes the density in the ball uniform.
            let radius = self.config.local_radius * self.targets.uniform(0.0, 1.0).cbrt();
            let target = contact + radius * self.targets.direction();
            return target.clamp(self.config.workspace.low, self.config.workspace.high);
        }
        let Bounds { low, high } = self.config.workspace;
        let mut along = |axis: usize| self.targets.uniform(low[axis], high[axis]);
        DVec3::new(along(0), along(1), along(2))
    }

    fn add(&mut self, configuration: Configuration, parent: usize) -> usize {
        let position = self.arm.forward(&configuration).session_from_sensor.translation;
        self.tree.add(configuration, position, parent)
    }

    /// Whether the arm does not press at `place` (metres, session frame) since it pressed
    /// there before.
    fn leaves_alone(&mut self, place: DVec3) -> bool {
        let PressAgain::Rarely { radius, n_last } = self.config.press_again else { return false };
        let last = self.pressed.iter().rev().take(n_last);
        let n_contacts = last.filter(|contact| contact.is_near(place, radius)).count();
        let probability = (1.0 + n_contacts as f64).powi(-2);
        self.targets.uniform(0.0, 1.0) >= probability
    }

    /// Runs the contact controllers from where the covering meets the object.
    fn touch(&mut self, last_free: usize, touching: Configuration) -> Option<Touch> {
        let scene =
            Scene::new(&self.arm, self.simulator, self.session_from_object, self.config.room);
        let mut stream =
            Stream::new(self.seed, Purpose::Exploration, 1 + self.statistics.contacts as u64);
        self.statistics.contacts += 1;
        let met = self.arm.forward(&touching).session_from_sensor.translation;
        self.pressed.push(Pressed { met, rested: None });
        let start = scene.object_from_sensor(&touching);
        let mut at = touching;
        let mut visited: Vec<(Pose, Configuration)> = Vec::new();
        let mut carry = |object_from_sensor: Pose| {
            let target = Target::Pose(scene.session_from_object * object_from_sensor);
            let next = self.arm.inverse_near(&target, &at, &InverseConfig::EXACT);
            let Some(next) = next.filter(|next| scene.can_follow(&at, next)) else { return false };
            at = next.clone();
            visited.push((object_from_sensor, next));
            true
        };
        let rules = &self.config.touch;
        match touch_recentered_carried(self.simulator, start, rules, &mut stream, &mut carry) {
            Landing::Converged { contact, .. } => {
                // After shifts the arm may be past the best of several rests.
                let rests = |visit: &&(Pose, Configuration)| visit.0 == contact.object_from_sensor;
                let visit =
                    visited.iter().rfind(rests).expect("the sensor rests where the arm got to");
                let configuration = visit.1.clone();
                let pose = self.arm.forward(&configuration).session_from_sensor;
                let reading = self.simulator.reading(SensorId(0), pose, &contact.pressures);
                let session_from_object = self.session_from_object;
                let touch =
                    Touch { reading, session_from_object, rounds: contact.rounds, configuration };
                self.settle(last_free, &touch);
                Some(touch)
            }
            Landing::Unreachable => {
                self.statistics.unreachable += 1;
                None
            }
            Landing::Missed { .. } | Landing::NoConvergence => {
                self.statistics.rejected += 1;
                None
            }
        }
    }
}

/// One step of the sensor.
struct Step {
    /// Position of its origin, metres in the session frame.
    position: DVec3,
    /// Viewing direction there.
    direction: DVec3,
}

/// A step towards a target; the sensor turns to face it as far as permitted.
fn step_towards(arm: &Arm, from: &Configuration, target: DVec3, config: &ExploreConfig) -> Step {
    let pose = arm.forward(from).session_from_sensor;
    let way = target - pose.translation;
    let facing = pose.turn(DVec3::Z);
    let wanted = way.try_normalize().unwrap_or(facing);
    let full = DQuat::from_rotation_arc(facing, wanted);
    let angle = facing.angle_between(wanted);
    let share = if angle > config.turn_max { config.turn_max / angle } else { 1.0 };
    let direction = (DQuat::IDENTITY.slerp(full, share) * facing).normalize();
    let position = pose.translation + way.clamp_length_max(config.step);
    Step { position, direction }
}

impl Explorer<'_> {
    /// Records a reading, retracts the sensor, and moves the object if it is to move.
    fn settle(&mut self, last_free: usize, touch: &Touch) {
        self.statistics.readings += 1;
        let pose = touch.reading.session_from_sensor();
        self.cells.add(pose.translation);
        if let Some(pressed) = self.pressed.last_mut() {
            pressed.rested = Some(pose.translation);
        }
        let scene =
            Scene::new(&self.arm, self.simulator, self.session_from_object, self.config.room);
        let back = Target::Pose(advanced(pose, -self.config.retreat));
        let retreated = self.arm.inverse_near(&back, &touch.configuration, &InverseConfig::EXACT);
        let last = &self.tree.vertices()[last_free].configuration;
        if let Some(retreated) = retreated.filter(|back| scene.is_free(last, back)) {
            self.add(retreated, last_free);
        }
        if let Some(perturbation) = self.config.perturbation {
            self.perturb(perturbation, last_free);
        }
    }

    /// Moves the object, but neither out of the workspace nor into the arm's way back.
    fn perturb(&mut self, perturbation: Perturbation, at: usize) {
        const DRAWS_MAX: usize = 30;
        let middle = middle_of(self.simulator.mesh());
        for _ in 0..DRAWS_MAX {
            let moved = perturbation.drawn(self.session_from_object, middle, &mut self.moves);
            let extent = 0.5 * self.simulator.mesh().largest_dimension();
            if !self.config.workspace.holds(moved * middle, extent) {
                continue;
            }
            let scene = Scene::new(&self.arm, self.simulator, moved, self.config.room);
            self.tree.forget_checks();
            if self.tree.is_open(at, |from, to| scene.is_free(from, to)) {
                self.session_from_object = moved;
                return;
            }
        }
        // Wedged between the arm and the walls: it stays where it is.
        self.tree.forget_checks();
    }
}

fn middle_of(mesh: &Mesh) -> DVec3 {
    let (low, high) = mesh.bounds();
    0.5 * (low + high)
}

#[cfg(test)]
mod tests;
