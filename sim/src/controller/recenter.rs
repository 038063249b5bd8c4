//! Re-centring: lifts the sensor after the first contact, centres it there and touches again.
//!
//! A sensor that approaches from afar often meets the object with a corner. The position of
//! the first contact on the array gives the shift with which the next approach along the same
//! direction meets the object in the middle. A press that misses is evidence too: its result
//! is the length of free air that the sensor crossed. Frames and limits as in `controller`.
//! Not here: the choice of rays (`sampler::rays`).

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;

use super::{Approached, Contact, ContactConfig, Outcome, advanced, approach, settle};
use crate::noise::NoiseLevel;
use crate::press::PressSimulator;

/// Rule for centring first contacts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recenter {
    /// Only contacts from which Press and Orient do not come to rest, or rest at low pressure.
    ///
    /// Centring every contact climbs to the corners and edges that are foremost along the
    /// ray: of 400 rays at a box of 60 × 30 × 20 mm, 262 come to rest with more than half of
    /// the target pressure without centring, 153 when all are centred and 302 by this rule;
    /// at a screwdriver 37, 167 and 207 (`sampler::rays`, seed 5, three shifts).
    WhenNeeded,
    /// Every contact that is off centre, before anything is pressed.
    Always,
}

/// Parameters for centring a first contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecenterConfig {
    /// The controllers' limits, also for every approach.
    pub contact: ContactConfig,
    /// Rule for centring first contacts.
    pub rule: Recenter,
    /// Maximum number of shifts; 0 presses wherever the sensor lands.
    pub shifts_max: usize,
    /// Distance from the array's middle within which a first contact is centred, metres.
    pub centered_within: f64,
    /// Mean pressure below which a rest counts as weak, pascal.
    pub weak_below: f64,
    /// Lift from the first contact before the shift, metres.
    pub lift: f64,
}

impl RecenterConfig {
    /// Three shifts when needed, centred to three quarters of a taxel, weak below half of the
    /// target. A lift of 20 mm clears slopes of up to 67° over the greatest shift, half the
    /// diagonal of an array of 12 mm.
    #[must_use]
    pub fn for_sensor(sensor: &SensorDescription, noise_level: NoiseLevel) -> Self {
        let contact = ContactConfig::for_sensor(sensor, noise_level);
        Self {
            contact,
            rule: Recenter::WhenNeeded,
            shifts_max: 3,
            centered_within: 0.75 * sensor.grid().pitch,
            weak_below: 0.5 * contact.target_pressure,
            lift: 20.0 * MM,
        }
    }
}

/// An approach that met nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Miss {
    /// The pose at its end.
    pub object_from_sensor: Pose,
    /// Length of the free path along the array's +z, metres.
    pub travel: f64,
    /// Pressures reported in free air, pascal, row-major in the sensor frame's order.
    pub pressures: Vec<f64>,
}

/// Result of a touch with re-centring.
#[derive(Clone, Debug, PartialEq)]
pub enum Landing {
    /// Press and Orient came to rest.
    Converged {
        /// The contact at rest.
        contact: Contact,
        /// Number of shifts before it.
        shifts: usize,
    },
    /// The last approach met nothing that the sensor feels.
    Missed {
        /// The last approach.
        miss: Miss,
        /// Number of shifts before it.
        shifts: usize,
    },
    /// Something was felt, but a limit was reached before the controllers came to rest.
    NoConvergence,
    /// The carrier of the sensor could not follow a command.
    Unreachable,
}

/// Touches along the +z of `object_from_sensor` and centres the first contact as the rule
/// says; noise from `stream`. Of several weak rests it returns the one with the most
/// pressure.
///
/// The sensor follows every command, as if nothing carried it.
#[must_use]
pub fn touch_recentered(
    simulator: &PressSimulator,
    object_from_sensor: Pose,
    config: &RecenterConfig,
    stream: &mut Stream,
) -> Landing {
    touch_recentered_carried(simulator, object_from_sensor, config, stream, &mut |_| true)
}

/// Like [`touch_recentered`], but with a sensor that an arm carries.
///
/// `carry` receives every commanded `object_from_sensor` and returns whether the sensor got
/// there; the first command that fails ends the touch, with the best rest so far if there is
/// one. The rest's pose is one that `carry` got to, not always the last.
#[must_use]
pub fn touch_recentered_carried(
    simulator: &PressSimulator,
    object_from_sensor: Pose,
    config: &RecenterConfig,
    stream: &mut Stream,
    carry: &mut dyn FnMut(Pose) -> bool,
) -> Landing {
    let mut start = object_from_sensor;
    let mut shifts = 0;
    let mut weak: Option<Landing> = None;
    loop {
        let felt = match approach(simulator, start, &config.contact, stream) {
            Approached::Felt(felt) => felt,
            Approached::Ended { travel } => {
                let end = advanced(start, travel);
                return if let Some(weak) = weak {
                    weak
                } else if !carry(end) {
                    Landing::Unreachable
                } else {
                    let pressures = simulator.pressures(&simulator.free_press(), stream);
                    let miss = Miss { object_from_sensor: end, travel, pressures };
                    Landing::Missed { miss, shifts }
                };
            }
        };
        if !carry(felt.object_from_sensor) {
            return weak.unwrap_or(Landing::Unreachable);
        }
        let threshold = config.contact.contact_threshold;
        let offset = contact_offset(simulator.sensor(), &felt.pressures, threshold);
        let is_last = shifts == config.shifts_max || offset.length() <= config.centered_within;
        if is_last || config.rule == Recenter::WhenNeeded {
            let first = felt.object_from_sensor;
            let outcome = settle(simulator, first, &config.contact, stream, carry);
            if outcome == Outcome::Unreachable {
                return weak.unwrap_or(Landing::Unreachable);
            }
            weak = stronger(weak, outcome, shifts);
            let is_strong = weak.as_ref().is_some_and(|found| mean(found) >= config.weak_below);
            if is_last || is_strong {
                return weak.unwrap_or(Landing::NoConvergence);
            }
        }
        let lifted = advanced(felt.object_from_sensor, -config.lift);
        start = lifted * Pose::from_parts(DQuat::IDENTITY, offset);
        shifts += 1;
        if !(carry(lifted) && carry(start)) {
            return weak.unwrap_or(Landing::Unreachable);
        }
    }
}

/// The one of two rests with more pressure.
fn stronger(found: Option<Landing>, outcome: Outcome, shifts: usize) -> Option<Landing> {
    let Outcome::Converged(contact) = outcome else { return found };
    let landing = Landing::Converged { contact, shifts };
    match found {
        Some(found) if mean(&found) >= mean(&landing) => Some(found),
        _ => Some(landing),
    }
}

/// The mean pressure at rest, pascal; 0 without a rest.
fn mean(landing: &Landing) -> f64 {
    match landing {
        Landing::Converged { contact, .. } => contact.strength(),
        Landing::Missed { .. } | Landing::NoConvergence | Landing::Unreachable => 0.0,
    }
}

/// Position of a contact on the array: the centre of the pressure above `threshold` (Pa), in
/// the plane of the sensor frame, metres; the frame's origin when no taxel is above.
///
/// `pressures` in Pa, row-major in the sensor frame's order.
#[must_use]
pub fn contact_offset(sensor: &SensorDescription, pressures: &[f64], threshold: f64) -> DVec3 {
    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
    for (index, pressure) in pressures.iter().enumerate() {
        let excess = (pressure - threshold).max(0.0);
        sum += excess * sensor.taxel(index).position.with_z(0.0);
        weight += excess;
    }
    if weight > 0.0 { sum / weight } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests;
