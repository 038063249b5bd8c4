//! How an arm explores: its sizes, where it looks, how it chooses, and when it gives up.
//!
//! The dissertation gives none of the sizes; only the probability L has values (figure 4.11).

use glam::DVec3;
use palpate_core::units::{DEG, MM};

use super::perturb::Perturbation;
use super::scene::Bounds;
use crate::arm::ArmConfig;
use crate::controller::ContactConfig;
use crate::press::PressSimulator;

/// Whether the arm presses again where it has pressed before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PressAgain {
    /// Whenever a motion meets the object. As printed: the vertex behind the newest contact is
    /// the nearest to most targets, so one place is pressed again and again.
    AsPrinted,
    /// With probability 1/(1 + n)², where n of the last contacts lie within `radius` metres. The
    /// square is chosen: where nothing else is in reach the n-th press takes about n²
    /// attempts, of a millisecond each, so that the arm goes elsewhere if it can.
    Rarely {
        /// What counts as the same place, metres.
        radius: f64,
        /// How many of the last contacts count. Older ones are forgotten: an object that is
        /// smaller than what they cover, or that moves, can still be pressed.
        n_last: usize,
    },
}

/// How an arm explores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExploreConfig {
    /// The arm.
    pub arm: ArmConfig,
    /// Where the object may be: the sensor looks for it here.
    pub workspace: Bounds,
    /// The walls that the arm must not touch.
    pub room: Bounds,
    /// The probability L of the local strategy.
    pub local: f64,
    /// The longest step towards a target, metres.
    pub step: f64,
    /// The width of the cells that count contacts, metres.
    pub cell_width: f64,
    /// How far from an earlier contact the local strategy aims, metres.
    pub local_radius: f64,
    /// Whether it presses again where it has pressed before.
    pub press_again: PressAgain,
    /// How far the sensor draws back from a contact, metres.
    pub retreat: f64,
    /// How far the sensor turns towards its target in one step, radians.
    pub turn_max: f64,
    /// How the object moves after every reading; `None` for one that rests.
    pub perturbation: Option<Perturbation>,
    /// How often the planner may choose a target.
    pub iterations_max: usize,
    /// The controllers' bounds.
    pub contact: ContactConfig,
}

impl ExploreConfig {
    /// An arm of `n_links` around a workspace into which the object fits with room to spare:
    /// half as wide again as the object's largest dimension, and 60 mm more.
    #[must_use]
    pub fn for_simulator(simulator: &PressSimulator, n_links: usize) -> Self {
        let half_width = 30.0 * MM + 0.75 * simulator.mesh().largest_dimension();
        Self::around(simulator, half_width, n_links)
    }

    /// An arm of `n_links` around the cube that reaches `half_width` metres from the session
    /// frame's origin along each axis. Equally many local and global targets, steps of 10 mm.
    #[must_use]
    pub fn around(simulator: &PressSimulator, half_width: f64, n_links: usize) -> Self {
        let arm = ArmConfig::around(half_width, n_links);
        let noise_level = simulator.config().noise_level;
        Self {
            arm,
            workspace: Bounds::cube(half_width),
            room: room_of(&arm),
            local: 0.5,
            step: 10.0 * MM,
            cell_width: 20.0 * MM,
            local_radius: 20.0 * MM,
            // 30 contacts are chosen: about those of the 20 readings that `palpate explore` takes.
            press_again: PressAgain::Rarely { radius: array_half_width(simulator), n_last: 30 },
            retreat: 6.0 * MM,
            turn_max: 60.0 * DEG,
            perturbation: None,
            iterations_max: 200_000,
            contact: ContactConfig::for_sensor(simulator.sensor(), noise_level),
        }
    }
}

/// Half the width of the sensor's array, metres: presses nearer to each other than this feel
/// mostly the same patch.
fn array_half_width(simulator: &PressSimulator) -> f64 {
    let grid = simulator.sensor().grid();
    0.5 * grid.pitch * grid.rows.max(grid.cols) as f64
}

/// The box within which the arm can turn once about its shoulder.
fn room_of(arm: &ArmConfig) -> Bounds {
    let shoulder = arm.foot + DVec3::Z * arm.first_link_length;
    let reach = arm.link_length * (arm.n_links.max(2) - 1) as f64 + arm.sensor_mount;
    let around = DVec3::splat(reach + 50.0 * MM);
    Bounds { low: shoulder - around, high: shoulder + around }
}
