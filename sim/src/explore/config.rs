//! Configuration of an exploration: the arm, the workspace, the strategies and the limits.
//!
//! The dissertation gives none of the sizes; only the probability L has values (figure 4.11).

use glam::DVec3;
use palpate_core::units::{DEG, MM};

use super::perturb::Perturbation;
use super::scene::Bounds;
use crate::arm::ArmConfig;
use crate::controller::RecenterConfig;
use crate::press::PressSimulator;

/// Whether the arm presses where it has pressed before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PressAgain {
    /// At every contact. As printed: the vertex behind the newest contact is the nearest to
    /// most targets, so one place is pressed again and again.
    AsPrinted,
    /// With probability 1/(1 + n)², where n of the last contacts lie within `radius` metres.
    /// The square is chosen: if nothing else is in reach, the n-th press takes about n²
    /// attempts of one millisecond, so the arm goes elsewhere if it can.
    Rarely {
        /// Radius of a place, metres.
        radius: f64,
        /// Number of recent contacts that count. Older ones are forgotten, so that an object
        /// smaller than the area they cover, or one that moves, can still be pressed.
        n_last: usize,
    },
}

/// Configuration of an exploration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExploreConfig {
    /// The arm.
    pub arm: ArmConfig,
    /// The region in which the sensor searches for the object.
    pub workspace: Bounds,
    /// The walls that the arm must not touch.
    pub room: Bounds,
    /// The probability L of the local strategy.
    pub local: f64,
    /// Longest step towards a target, metres.
    pub step: f64,
    /// Width of the cells that count contacts, metres.
    pub cell_width: f64,
    /// Largest distance of a local target from an earlier contact, metres.
    pub local_radius: f64,
    /// Whether the arm presses where it has pressed before.
    pub press_again: PressAgain,
    /// Distance that the sensor retracts from a contact, metres.
    pub retreat: f64,
    /// Largest turn of the sensor towards its target in one step, radians.
    pub turn_max: f64,
    /// Motion of the object after every reading; `None` for an object at rest.
    pub perturbation: Option<Perturbation>,
    /// Maximum number of targets.
    pub iterations_max: usize,
    /// The controllers' limits, and the centring of contacts that rest weakly; the default has
    /// no shifts, as printed.
    pub touch: RecenterConfig,
}

impl ExploreConfig {
    /// An arm of `n_links` around a workspace that is 60 mm wider than 1.5 times the object's
    /// largest dimension.
    #[must_use]
    pub fn for_simulator(simulator: &PressSimulator, n_links: usize) -> Self {
        let half_width = 30.0 * MM + 0.75 * simulator.mesh().largest_dimension();
        Self::around(simulator, half_width, n_links)
    }

    /// An arm of `n_links` around the cube that reaches `half_width` metres from the session
    /// frame's origin along each axis. Local and global targets are equally likely, steps are
    /// 10 mm.
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
            touch: RecenterConfig {
                shifts_max: 0,
                ..RecenterConfig::for_sensor(simulator.sensor(), noise_level)
            },
        }
    }
}

/// Half the width of the sensor's array, metres; presses nearer to each other than this feel
/// mostly the same patch.
fn array_half_width(simulator: &PressSimulator) -> f64 {
    let grid = simulator.sensor().grid();
    0.5 * grid.pitch * grid.rows.max(grid.cols) as f64
}

/// The box in which the arm can turn once about its shoulder.
fn room_of(arm: &ArmConfig) -> Bounds {
    let shoulder = arm.foot + DVec3::Z * arm.first_link_length;
    let reach = arm.link_length * (arm.n_links.max(2) - 1) as f64 + arm.sensor_mount;
    let around = DVec3::splat(reach + 50.0 * MM);
    Bounds { low: shoulder - around, high: shoulder + around }
}
