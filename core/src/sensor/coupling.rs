//! Coupling of a covering and its taxels: what a point on the surface does to each taxel.
//!
//! Section 2.5.1 models it by one Gaussian over a covering without an end. Real arrays also
//! differ in the shape of the spread, in what happens where the covering ends, and in
//! electrical cross-talk. The default is the dissertation's model. Lengths in metres.

use super::SensorError;
use super::description::within;
use crate::units::MM;

/// Largest extent of a covering beyond the array, metres. Chosen: twice the largest spread.
pub const MARGIN_MAX: f64 = 100.0 * MM;

/// Largest cross-talk: beyond it, four neighbours outweigh the taxel twofold.
pub const CROSS_TALK_MAX: f64 = 0.5;

/// Shape of the lateral spread. Its standard deviation is the sensor's `point_spread`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpreadKernel {
    /// A Gaussian (equation 2.2), as of a soft layer.
    #[default]
    Gaussian,
    /// A double exponential along each axis: a sharper peak and longer tails, as of a skin
    /// that carries tension.
    Exponential,
}

/// Effect of the end of the covering on forces near it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CoveringEdge {
    /// The covering acts as if it went on: an even press reads the same in every taxel.
    #[default]
    Continues,
    /// All force reaches the remaining covering: taxels at the edge read more.
    ConservesForce,
    /// Force that would spread beyond the edge is lost: taxels at the edge read less.
    LosesForce,
}

impl SpreadKernel {
    /// Every shape.
    pub const ALL: [Self; 2] = [Self::Gaussian, Self::Exponential];
}

impl CoveringEdge {
    /// Every edge.
    pub const ALL: [Self; 3] = [Self::Continues, Self::ConservesForce, Self::LosesForce];
}

/// Coupling of the covering and the taxels, beyond the standard deviation of the spread.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coupling {
    /// Shape of the lateral spread.
    pub kernel: SpreadKernel,
    /// Extent of the covering beyond the outermost taxels' cells, metres; `None` when it is
    /// farther than any spread reaches.
    pub margin: Option<f64>,
    /// Effect of the covering's end.
    pub edge: CoveringEdge,
    /// Share of a taxel's pressure that each of its up to four neighbours reads in addition.
    pub cross_talk: f64,
    /// Relative standard deviation of the taxels' gains that a calibration leaves.
    pub gain_spread: f64,
    /// Largest relative deviation of a press's pressures through hysteresis.
    pub hysteresis: f64,
}

impl Coupling {
    /// Checks every number.
    ///
    /// # Errors
    /// [`SensorError::Range`] names the first parameter that is out of range.
    pub(super) fn check(&self) -> Result<(), SensorError> {
        within("margin", self.margin.unwrap_or(0.0), 0.0, MARGIN_MAX)?;
        within("cross_talk", self.cross_talk, 0.0, CROSS_TALK_MAX)?;
        within("gain_spread", self.gain_spread, 0.0, 0.5)?;
        within("hysteresis", self.hysteresis, 0.0, 0.5)
    }
}
