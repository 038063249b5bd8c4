//! Images as the object would give them: the fit of tool centre, response and spread.
//!
//! Every touch is pressed again by the simulator at its corrected pose, and its image compared
//! with the measured one, taxel by taxel. Equation C4. Images are row-major, pascal.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::{Coupling, CoveringEdge, SensorDescription, SensorParameters};
use palpate_core::stop::Stop;
use palpate_core::units::{DEG, MM};
use palpate_sim::press::{Load, PressSimulator};

use crate::solve::{Parameter, Solution, solve};
use crate::surface::{TOOL_OFFSET, TOOL_TILT, moved};

/// Relative deviation of a pressure from the model, as a share of the touch's largest. Chosen:
/// gains of data sheets deviate by 7 %, hysteresis by 5 %.
const MODEL: f64 = 0.08;

/// Prior deviations of the logarithm of the gain, of the stiffening and of the logarithm of the
/// spread. Chosen: the family of a data sheet (`SensorRanges::data_sheet`), a little wider.
const GAIN: f64 = 0.7;
const STIFFENING: f64 = 0.6;
const SPREAD: f64 = 0.5;

/// Places of the parameters in a vector: offset (m), tilt and roll (rad), logarithm of the gain,
/// stiffening, logarithm of the spread, and the object's motion.
pub(crate) const TOOL: std::ops::Range<usize> = 0..6;
pub(crate) const LN_GAIN: usize = 6;
pub(crate) const STIFFEN: usize = 7;
pub(crate) const LN_SPREAD: usize = 8;
pub(crate) const OBJECT: std::ops::Range<usize> = 9..15;
/// Number of parameters.
pub(crate) const N: usize = 15;

/// End of the covering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Extent beyond the array, metres; `None` when it is farther than the spread reaches.
    pub margin: Option<f64>,
    /// Effect of the end.
    pub effect: CoveringEdge,
}

/// Measured images and the poses at which they were taken.
pub(crate) struct Images<'a> {
    pub(crate) simulator: &'a PressSimulator,
    pub(crate) stop: &'a Stop,
    /// `session_from_sensor` as sent, in the convention found.
    pub(crate) poses: Vec<Pose>,
    /// One image a touch; `None` for missing or dead taxels.
    pub(crate) measured: Vec<Vec<Option<f64>>>,
    /// The object's place before it is moved.
    pub(crate) object_from_session: Pose,
    /// Whether the object's pose is unknown.
    pub(crate) may_move: bool,
    /// The covering's end.
    pub(crate) edge: Edge,
}

impl Images<'_> {
    /// Fits the parameters at `free` indices from `start`.
    pub(crate) fn fit(&self, start: &[f64; N], free: &[usize], rounds: usize) -> Solution {
        let is_free = |at: &&usize| self.may_move || !OBJECT.contains(at);
        let free: Vec<usize> = free.iter().filter(is_free).copied().collect();
        let whole = |values: &[f64]| {
            let mut all = *start;
            free.iter().zip(values).for_each(|(at, value)| all[*at] = *value);
            all
        };
        let parameters: Vec<Parameter> = free.iter().map(|at| parameter(*at)).collect();
        let first: Vec<f64> = free.iter().map(|at| start[*at]).collect();
        let group = self.simulator.sensor().grid().n_taxels();
        let residuals = |values: &[f64]| self.residuals(&whole(values));
        let found = solve(&parameters, &first, group, rounds, &residuals);
        let mut deviations = vec![0.0; N];
        free.iter().zip(&found.deviations).for_each(|(at, d)| deviations[*at] = *d);
        Solution { values: whole(&found.values).to_vec(), deviations, ..found }
    }

    /// Misfits of every taxel of every touch in units of their deviation; 0 for missing ones.
    pub(crate) fn residuals(&self, values: &[f64; N]) -> Vec<f64> {
        self.stop.check();
        let parameters = self.simulator.sensor().parameters();
        let electronics = parameters.noise.powi(2) + parameters.quantisation.powi(2) / 12.0;
        let mut all = Vec::with_capacity(self.measured.len() * parameters.grid.n_taxels());
        for (image, modelled) in self.measured.iter().zip(self.modelled(values)) {
            let largest = image.iter().flatten().copied().fold(0.0, f64::max);
            let scale = largest.max(0.05 * parameters.saturation);
            let deviation = (electronics + (MODEL * scale).powi(2)).sqrt();
            let residual = |(measured, modelled): (&Option<f64>, f64)| {
                measured.map_or(0.0, |measured| (measured - modelled) / deviation)
            };
            all.extend(image.iter().zip(modelled).map(residual));
        }
        all
    }

    /// The images that the parameters predict.
    pub(crate) fn modelled(&self, values: &[f64; N]) -> Vec<Vec<f64>> {
        let pressed = self.pressed(values);
        self.object_from_sensors(values)
            .iter()
            .map(|pose| response(&pressed, *pose, values))
            .collect()
    }

    /// The corrected poses of all touches.
    pub(crate) fn object_from_sensors(&self, values: &[f64; N]) -> Vec<Pose> {
        let object_from_session = self.object_from_session(values);
        let tool = tool(values);
        self.poses.iter().map(|pose| object_from_session * *pose * tool).collect()
    }

    /// The object's place.
    pub(crate) fn object_from_session(&self, values: &[f64; N]) -> Pose {
        let (low, high) = self.simulator.mesh().bounds();
        moved(self.object_from_session, 0.5 * (low + high), &values[OBJECT])
    }

    /// The simulator with the covering that the parameters state.
    pub(crate) fn pressed(&self, values: &[f64; N]) -> PressSimulator {
        let sensor = with_covering(self.simulator.sensor(), values[LN_SPREAD], self.edge);
        // No gains are drawn: a taxel's gain is no parameter of the fit.
        self.simulator.with_sensor(sensor, &mut Stream::new(0, Purpose::Commissioning, 2))
    }
}

/// The image of a press at a pose. Equation C4.
pub(crate) fn response(pressed: &PressSimulator, pose: Pose, values: &[f64; N]) -> Vec<f64> {
    let parameters = pressed.sensor().parameters();
    let (thickness, stiffening) = (parameters.covering_thickness, values[STIFFEN].max(-0.9));
    let pressure = |displacement: f64| {
        let share = (1.0 + stiffening * displacement / thickness) / (1.0 + stiffening);
        let felt = values[LN_GAIN].exp() * share * parameters.force_curve.pressure(displacement);
        felt.min(parameters.saturation)
    };
    match pressed.press(pose).load {
        Load::Displacements(displacements) => displacements.into_iter().map(pressure).collect(),
        Load::Pressures(pressures) => pressures,
    }
}

/// A description with another spread and edge, and no gains or hysteresis.
pub(crate) fn with_covering(
    sensor: &SensorDescription,
    ln_spread: f64,
    edge: Edge,
) -> SensorDescription {
    let known = sensor.parameters().clone();
    let coupling = Coupling {
        margin: edge.margin,
        edge: edge.effect,
        gain_spread: 0.0,
        hysteresis: 0.0,
        ..known.coupling
    };
    let point_spread =
        (known.point_spread * ln_spread.clamp(-3.0, 2.0).exp()).clamp(0.05 * MM, 50.0 * MM);
    let parameters = SensorParameters { point_spread, coupling, ..known };
    SensorDescription::new(parameters).unwrap_or_else(|_| sensor.clone())
}

/// The correction of the tool centre: `sent_from_true` sensor.
pub(crate) fn tool(values: &[f64; N]) -> Pose {
    let turn = DQuat::from_scaled_axis(DVec3::new(values[3], values[4], values[5]));
    Pose::from_parts(turn, DVec3::new(values[0], values[1], values[2]))
}

fn parameter(at: usize) -> Parameter {
    match at {
        0..3 => Parameter { prior: TOOL_OFFSET, step: 0.2 * MM },
        3..6 => Parameter { prior: TOOL_TILT, step: 0.6 * DEG },
        LN_GAIN => Parameter { prior: GAIN, step: 0.01 },
        STIFFEN => Parameter { prior: STIFFENING, step: 0.05 },
        LN_SPREAD => Parameter { prior: SPREAD, step: 0.03 },
        9..12 => Parameter { prior: 50.0 * MM, step: 0.2 * MM },
        _ => Parameter { prior: 1.0, step: 0.5 * DEG },
    }
}
