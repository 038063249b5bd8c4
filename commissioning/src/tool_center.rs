//! The tool centre of a fit: its correction, deviations and verdict.

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::sensor::Estimate;
use palpate_core::units::{DEG, MM};

use crate::estimate::Verdict;
use crate::images::{N, tool};
use crate::surface::{TOOL_OFFSET, TOOL_TILT};

/// Least deviations of a tool centre that are stated: offset (m) and tilt (rad). Fitted: median
/// errors of `palpate experiment commissioning --seed 1`.
const OFFSET_FLOOR: f64 = 0.25 * MM;
const TILT_FLOOR: f64 = 0.6 * DEG;

/// Tool centres below this offset (m) and tilt (rad) need no correction. Chosen: twice the
/// position error of recognition at its best, and the angle at which controllers stop.
const OFFSET_NEEDED: f64 = 1.0 * MM;
const TILT_NEEDED: f64 = 2.0 * DEG;

/// Deviations from which a correction is certain enough. Chosen: six numbers are looked at.
const CERTAIN: f64 = 3.0;

/// Share of a prior's deviation above which a number is not determined.
const OPEN: f64 = 0.5;

/// Residual above which the touches are not understood, so that no tool centre follows from them.
/// Fitted: sensors of a data sheet's family leave 0.03 to 0.08 (`palpate experiment commissioning
/// --seed 1`), a wrong place of the object twice as much.
pub const RESIDUAL_MAX: f64 = 0.12;

/// What holds for the sensor's tool centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolCenter {
    /// The correction: `sent_from_true` sensor. A pose as sent times it is the true pose.
    pub sent_from_true: Pose,
    /// Offset along the sensor's x, y and z as sent, metres.
    pub offset: [Estimate; 3],
    /// Rotation vector about the sensor's x, y and z as sent, radians.
    pub turn: [Estimate; 3],
    /// Whether it is right, wrong, or not determined by these touches.
    pub verdict: Verdict,
}

/// The tool centre of fitted parameters that leave this residual.
pub(crate) fn tool_center(found: &[f64; N], deviations: &[f64], residual: f64) -> ToolCenter {
    let estimate = |at: usize, floor: f64| Estimate {
        value: found[at],
        deviation: deviations[at].hypot(floor),
    };
    let offset: [Estimate; 3] = std::array::from_fn(|at| estimate(at, OFFSET_FLOOR));
    let turn: [Estimate; 3] = std::array::from_fn(|at| estimate(at + 3, TILT_FLOOR));
    let length = |of: &[Estimate; 3]| DVec3::from_array(of.map(|e| e.value)).length();
    let is_certain = |of: &[Estimate; 3]| of.iter().any(|e| e.value.abs() > CERTAIN * e.deviation);
    let is_off = |of: &[Estimate; 3], needed: f64| length(of) > needed && is_certain(of);
    let is_open = |of: &[Estimate; 3], prior: f64| of.iter().any(|e| e.deviation > OPEN * prior);
    let verdict = if residual > RESIDUAL_MAX {
        Verdict::Undetermined
    } else if is_off(&offset, OFFSET_NEEDED) || is_off(&turn, TILT_NEEDED) {
        Verdict::Wrong
    } else if is_open(&offset, TOOL_OFFSET) || is_open(&turn, TOOL_TILT) {
        Verdict::Undetermined
    } else {
        Verdict::Right
    };
    ToolCenter { sent_from_true: tool(found), offset, turn, verdict }
}
