//! Contact control: Approach, then Press and Orient in turn until neither has a command.
//!
//! Source: section 4.2.2, figure 4.3 and algorithm 1, with the corrections in
//! `docs/equations.md`: Press also stops on the raw depth, and every motion is bounded. Poses
//! are `object_from_sensor`; the sensor moves along its own z and turns about its origin. Not
//! here: choosing where to touch (`sampler`).

mod orient;
mod recenter;

use palpate_core::pose::Pose;
use palpate_core::rng::Stream;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::{DEG, MM};

use crate::noise::NoiseLevel;
use crate::press::{HeightMap, Press, PressSimulator};
pub use orient::turn_to_surface;
pub use recenter::{
    Landing, Miss, Recenter, RecenterConfig, contact_offset, touch_recentered,
    touch_recentered_carried,
};

/// Rule by which Press and Orient both count as idle; without noise the two rules agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Idle {
    /// Orient has no command on the reading at which Press came to rest.
    OneReading,
    /// Each controller takes a reading of its own, and both in succession have no command. As
    /// printed; under noise a touch takes longer and may never end.
    Consecutive,
}

/// Thresholds at which the controllers act, and limits at which they give up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactConfig {
    /// Longest approach along +z, metres.
    pub approach_max: f64,
    /// Pressure above which a taxel is in contact, pascal.
    pub contact_threshold: f64,
    /// Mean pressure at which Press stops, pascal.
    pub target_pressure: f64,
    /// Tolerance of the mean pressure about its target, pascal.
    pub pressure_tolerance: f64,
    /// Raw depth at which Press always stops, metres.
    pub penetration_max: f64,
    /// Maximum total path of Press, forth and back, metres.
    pub travel_max: f64,
    /// Fraction of the angle to the surface's normal that one Orient command turns.
    pub orient_step: f64,
    /// Angle to the surface's normal below which Orient has no command, radians.
    pub orient_tolerance: f64,
    /// Maximum number of rounds of Press and Orient.
    pub rounds_max: usize,
    /// Largest distance of the sensor from its first contact, metres.
    pub walk_max: f64,
    /// The rule that ends the rounds.
    pub idle: Idle,
}

impl ContactConfig {
    /// A quarter of the sensing range as the target, 90 % of the covering as the depth, 14 mm
    /// of travel and Orient's fraction 0.3 as printed. The contact threshold lies above the
    /// noise.
    #[must_use]
    pub fn for_sensor(sensor: &SensorDescription, noise_level: NoiseLevel) -> Self {
        let parameters = sensor.parameters();
        let saturation = parameters.saturation;
        let noise = (5.0 * parameters.noise).max(parameters.quantisation);
        Self {
            approach_max: 20.0 * MM,
            contact_threshold: noise.max(0.03 * saturation) + noise_level.half_width(saturation),
            target_pressure: 0.25 * saturation,
            pressure_tolerance: 0.0125 * saturation,
            penetration_max: 0.9 * parameters.covering_thickness,
            travel_max: 14.0 * MM,
            orient_step: 0.3,
            orient_tolerance: 2.0 * DEG,
            rounds_max: 30,
            walk_max: 20.0 * MM,
            idle: Idle::OneReading,
        }
    }
}

/// A press at which the controllers came to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// The sensor's pose at rest.
    pub object_from_sensor: Pose,
    /// The press at that pose, without noise.
    pub press: Press,
    /// The reported pressures, pascal, row-major in the sensor frame's order.
    pub pressures: Vec<f64>,
    /// Number of rounds of Press and Orient.
    pub rounds: usize,
    /// Number of moves of Press and turns of Orient.
    pub commands: usize,
}

impl Contact {
    /// The mean pressure, pascal.
    #[must_use]
    pub fn strength(&self) -> f64 {
        self.pressures.iter().sum::<f64>() / self.pressures.len() as f64
    }
}

/// Result of a touch.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Press and Orient both have no command.
    Converged(Contact),
    /// Approach met nothing that the sensor feels.
    Missed,
    /// A limit was reached before the controllers came to rest, or the contact was lost.
    NoConvergence,
    /// The carrier of the sensor could not follow a command.
    Unreachable,
}

/// Touches the object from `object_from_sensor` along the sensor's +z; noise from `stream`.
///
/// The sensor follows every command, as if nothing carried it.
#[must_use]
pub fn touch(
    simulator: &PressSimulator,
    object_from_sensor: Pose,
    config: &ContactConfig,
    stream: &mut Stream,
) -> Outcome {
    touch_carried(simulator, object_from_sensor, config, stream, &mut |_| true)
}

/// Like [`touch`], but with a sensor that an arm carries.
///
/// `carry` receives every commanded `object_from_sensor` and returns whether the sensor got
/// there; the first command that fails ends the touch.
#[must_use]
pub fn touch_carried(
    simulator: &PressSimulator,
    object_from_sensor: Pose,
    config: &ContactConfig,
    stream: &mut Stream,
    carry: &mut dyn FnMut(Pose) -> bool,
) -> Outcome {
    match approach(simulator, object_from_sensor, config, stream) {
        Approached::Felt(felt) if !carry(felt.object_from_sensor) => Outcome::Unreachable,
        Approached::Felt(felt) => settle(simulator, felt.object_from_sensor, config, stream, carry),
        Approached::Ended { .. } => Outcome::Missed,
    }
}

/// Alternates Press and Orient from the first contact.
fn settle(
    simulator: &PressSimulator,
    first_contact: Pose,
    config: &ContactConfig,
    stream: &mut Stream,
    carry: &mut dyn FnMut(Pose) -> bool,
) -> Outcome {
    let mut object_from_sensor = first_contact;
    let mut travel_left = config.travel_max;
    let mut orient_was_idle = false;
    let mut commands = 0;
    for round in 1..=config.rounds_max {
        let Some(pressed) = press(simulator, object_from_sensor, config, travel_left, stream)
        else {
            return Outcome::NoConvergence;
        };
        object_from_sensor = advanced(object_from_sensor, pressed.travel);
        travel_left -= pressed.travelled;
        commands += pressed.moves;
        if object_from_sensor.distance_to(&first_contact) > config.walk_max {
            return Outcome::NoConvergence;
        }
        if !carry(object_from_sensor) {
            return Outcome::Unreachable;
        }
        let (felt, press_was_idle) = match config.idle {
            Idle::OneReading => (pressed.pressures.clone(), true),
            Idle::Consecutive => {
                (simulator.pressures(&pressed.press, stream), pressed.travelled <= 0.0)
            }
        };
        let command = orient::command(simulator.sensor(), &felt, config);
        let at_rest = press_was_idle && (orient_was_idle || command.is_none());
        if at_rest {
            return Outcome::Converged(Contact {
                object_from_sensor,
                pressures: pressed.pressures,
                press: pressed.press,
                rounds: round,
                commands,
            });
        }
        orient_was_idle = command.is_none();
        if let Some(rotation) = command {
            commands += 1;
            let turned = object_from_sensor.rotation * rotation;
            object_from_sensor = Pose::from_parts(turned, object_from_sensor.translation);
            if !carry(object_from_sensor) {
                return Outcome::Unreachable;
            }
        }
    }
    Outcome::NoConvergence
}

/// A pose moved by `travel` metres along its own z.
pub(crate) fn advanced(object_from_sensor: Pose, travel: f64) -> Pose {
    object_from_sensor * Pose::from_parts(glam::DQuat::IDENTITY, glam::DVec3::Z * travel)
}

/// Result of a guarded move.
enum Approached {
    /// A taxel is above the contact threshold.
    Felt(FirstContact),
    /// Nothing was felt on the whole path, metres along +z.
    Ended { travel: f64 },
}

/// The first contact of an approach.
struct FirstContact {
    object_from_sensor: Pose,
    /// The reported pressures, pascal, row-major in the sensor frame's order.
    pressures: Vec<f64>,
}

/// Approach: a guarded move until a taxel is above the contact threshold.
///
/// The path through free air is one move; a sensor that starts inside the object backs out
/// first. The move ends without contact if nothing is ahead, or at the limit of the raw
/// depth.
fn approach(
    simulator: &PressSimulator,
    object_from_sensor: Pose,
    config: &ContactConfig,
    stream: &mut Stream,
) -> Approached {
    let heights = simulator.heights(object_from_sensor, config.approach_max);
    let lowest = heights.lowest();
    if !lowest.is_finite() {
        return Approached::Ended { travel: config.approach_max };
    }
    let n_steps = 20;
    let step = config.penetration_max / f64::from(n_steps);
    for count in 1..=n_steps {
        let travel = lowest + step * f64::from(count);
        let press = simulator.press_at(&heights, travel);
        let pressures = simulator.pressures(&press, stream);
        if pressures.iter().any(|pressure| *pressure > config.contact_threshold) {
            let object_from_sensor = advanced(object_from_sensor, travel);
            return Approached::Felt(FirstContact { object_from_sensor, pressures });
        }
    }
    Approached::Ended { travel: lowest + config.penetration_max }
}

/// The state in which Press came to rest.
struct Pressed {
    /// The sum of its moves, metres along +z.
    travel: f64,
    /// The sum of their lengths, metres.
    travelled: f64,
    /// Number of moves.
    moves: usize,
    press: Press,
    pressures: Vec<f64>,
}

/// Longest single move of Press and the range ahead that one height map serves, metres.
const PRESS_STEP_MAX: f64 = 0.8 * MM;
const PRESS_REACH: f64 = 3.0 * MM;
const PRESS_STEPS_MAX: usize = 30;

/// Press: moves along z until the mean pressure is at its target, a taxel is close to
/// saturation, or the raw depth is at its limit.
///
/// Each move is proportional to the error, scaled by the response to the last one. `None`
/// when the travel is used up or there is nothing to press.
fn press(
    simulator: &PressSimulator,
    object_from_sensor: Pose,
    config: &ContactConfig,
    travel_max: f64,
    stream: &mut Stream,
) -> Option<Pressed> {
    let parameters = simulator.sensor().parameters();
    let displacement_of = |pressure: f64| parameters.force_curve.displacement(pressure);
    let target = displacement_of(config.target_pressure);
    let depth_tolerance = 0.02 * parameters.covering_thickness;
    let mut heights = simulator.heights(object_from_sensor, PRESS_REACH);
    let (mut travel, mut travelled) = (0.0, 0.0);
    let mut slope = Slope::default();
    for moves in 0..PRESS_STEPS_MAX {
        redraw_if_beyond(simulator, object_from_sensor, &mut heights, travel);
        if !heights.lowest().is_finite() {
            return None;
        }
        let press = simulator.press_at(&heights, travel);
        let pressures = simulator.pressures(&press, stream);
        let mean = pressures.iter().sum::<f64>() / pressures.len() as f64;
        let room = config.penetration_max - press.max_penetration;
        let too_weak = mean < config.target_pressure - config.pressure_tolerance;
        let too_strong = mean > config.target_pressure + config.pressure_tolerance;
        let near_saturation =
            pressures.iter().any(|pressure| *pressure > 0.98 * parameters.saturation);
        let at_limit = room <= depth_tolerance || near_saturation;
        let idle = !too_strong && (!too_weak || at_limit) && room >= -depth_tolerance;
        if idle {
            return Some(Pressed { travel, travelled, moves, press, pressures });
        }
        let displacement = displacement_of(mean);
        let wanted = (target - displacement) / slope.after(travel, displacement);
        let step = wanted.clamp(-PRESS_STEP_MAX, PRESS_STEP_MAX).min(room);
        travel += step;
        travelled += step.abs();
        if travelled > travel_max {
            return None;
        }
    }
    None
}

fn redraw_if_beyond(
    simulator: &PressSimulator,
    object_from_sensor: Pose,
    heights: &mut HeightMap,
    travel: f64,
) {
    let needs_more = travel > heights.reach() || !heights.lowest().is_finite();
    if needs_more && heights.reach() <= PRESS_REACH {
        // Drawn once, for the longest possible press.
        *heights = simulator.heights(object_from_sensor, 14.0 * MM);
    }
}

/// Mean displacement per metre of travel, estimated from the last move.
#[derive(Default)]
struct Slope {
    last: Option<(f64, f64)>,
}

impl Slope {
    fn after(&mut self, travel: f64, displacement: f64) -> f64 {
        let estimate = match self.last {
            Some((before, was)) if (travel - before).abs() > 1e-6 => {
                (displacement - was) / (travel - before)
            }
            _ => 0.7,
        };
        self.last = Some((travel, displacement));
        estimate.clamp(0.15, 1.0)
    }
}

#[cfg(test)]
mod tests;
