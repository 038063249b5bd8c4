//! Refinement of a planar pose by Gauss–Newton on all presses at once.
//!
//! Every press is linear in its slip; the pose's change is the part of the slips that all
//! presses share. Deviations that a press's own amplitude, tilt and slip explain as well do
//! not pull at the pose. Source: elimination of nuisance parameters by a Schur complement.

use nalgebra::{Matrix3, Vector3};

use crate::mosaic::press_fit::{Placement, PressFit, PressPrior};
use palpate_core::units::{DEG, MM};

/// A press aligned with the map at a pose.
pub(super) struct PressAtPose {
    pub fitted: PressFit,
    pub place: Placement,
    pub prior: PressPrior,
    pub temper: f64,
}

/// A refined pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mode {
    /// x, y (m) and θ (rad).
    pub pose: [f64; 3],
    /// Their covariance.
    pub covariance: Matrix3<f64>,
}

impl Mode {
    /// A bin's own pose and spread.
    pub(super) fn unpolished(pose: [f64; 3], widths: [f64; 3]) -> Self {
        let variances = Vector3::from(widths).map(|width| width * width / 12.0);
        Self { pose, covariance: Matrix3::from_diagonal(&variances) }
    }

    /// Whether a bin belongs to this mode: it is within three of the mode's deviations and
    /// its own width.
    pub(super) fn holds(&self, center: &[f64; 3], widths: &[f64; 3]) -> bool {
        (0..3).all(|axis| {
            let off = center[axis] - self.pose[axis];
            let off = if axis == 2 { wrapped(off) } else { off };
            off.abs() <= 3.0 * self.covariance[(axis, axis)].sqrt() + widths[axis]
        })
    }
}

/// An angle brought into −π ..= π.
fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

/// The normal equations of a pose.
struct System {
    information: Matrix3<f64>,
    pull: Vector3<f64>,
    log_likelihood: f64,
}

const STEPS_MAX: usize = 6;

/// Climbs from `start` to the nearest local maximum. `fit_at` aligns a reading with the map.
pub(super) fn polish(
    start: [f64; 3],
    n_readings: usize,
    mut fit_at: impl FnMut(&[f64; 3], usize) -> PressAtPose,
) -> Mode {
    let mut pose = start;
    let mut system = linearise(&pose, n_readings, &mut fit_at);
    let mut damping = 1.0;
    for _step in 0..STEPS_MAX {
        let change = step(&system, damping);
        let tried = [pose[0] + change[0], pose[1] + change[1], pose[2] + change[2]];
        let next = linearise(&tried, n_readings, &mut fit_at);
        if next.log_likelihood < system.log_likelihood {
            damping *= 8.0;
            continue;
        }
        let settled = next.log_likelihood - system.log_likelihood < 0.01;
        (pose, system) = (tried, next);
        damping *= 0.25;
        if settled {
            break;
        }
    }
    let covariance = (system.information + stiffness(1.0)).try_inverse();
    let covariance = covariance.unwrap_or_else(Matrix3::zeros);
    Mode { pose, covariance }
}

/// Prior stiffness: 3 mm and 20 degrees about the start, over the square root of `damping`.
fn stiffness(damping: f64) -> Matrix3<f64> {
    let (place, angle) = ((3.0 * MM).powi(-2), (20.0 * DEG).powi(-2));
    damping * Matrix3::from_diagonal(&Vector3::new(place, place, angle))
}

fn step(system: &System, damping: f64) -> Vector3<f64> {
    let damped = system.information + stiffness(damping);
    damped.cholesky().map_or_else(Vector3::zeros, |factor| factor.solve(&system.pull))
}

fn linearise(
    pose: &[f64; 3],
    n_readings: usize,
    fit_at: &mut impl FnMut(&[f64; 3], usize) -> PressAtPose,
) -> System {
    let (sin, cos) = pose[2].sin_cos();
    let mut system =
        System { information: Matrix3::zeros(), pull: Vector3::zeros(), log_likelihood: 0.0 };
    for reading in 0..n_readings {
        let PressAtPose { fitted, place, prior, temper } = fit_at(pose, reading);
        system.log_likelihood += temper * fitted.log_likelihood;
        let covariance = fitted.covariance();
        let scale = [prior.shift, prior.shift, prior.turn].map(f64::recip);
        // The remaining information on the slip after the press's own is integrated out:
        // identity minus posterior covariance, in units of the prior.
        let left = Matrix3::from_fn(|row, col| {
            let unit = if row == col { 1.0 } else { 0.0 };
            (unit - f64::from(covariance[row + 3][col + 3])) * scale[row] * scale[col]
        });
        let slip = Vector3::from_fn(|row, _| f64::from(fitted.unknowns[row + 3]) * scale[row]);
        // Moving the object by dt moves the press by −R(−θ) dt on it; turning it by dθ moves
        // the press about the origin by −dθ, and turns it by as much.
        let [x, y] = place.center;
        let moves = Matrix3::new(-cos, -sin, y, sin, -cos, -x, 0.0, 0.0, -1.0);
        system.information += temper * moves.transpose() * left * moves;
        system.pull += temper * moves.transpose() * slip;
    }
    system
}
