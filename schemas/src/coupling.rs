//! What a sensor's description says beyond geometry and response: coupling, knowledge, ranges.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Coupling of the covering and the taxels, beyond the standard deviation of the spread. Every
/// field may be omitted. In trainings of `data_sheet`, a value other than its default is taken as
/// known, and a default as unknown.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Coupling {
    /// Shape of the lateral spread. Data sheets do not state it: omit it. Default: `gaussian`.
    #[serde(default)]
    pub kernel: SpreadKernel,
    /// Extent of the covering beyond the cells of the outermost taxels, in metres, 0 to 0.1; null
    /// if it is farther than any press spreads. Measure it with a ruler: 0 if the rubber ends where
    /// the array ends. Default: null.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 0.1)]
    pub margin: Option<f64>,
    /// Effect of the covering's end on forces near it. Press a flat plate on the whole array: the
    /// outermost taxels read as much as the others (`continues`), more (`conserves_force`) or less
    /// (`loses_force`). Default: `continues`.
    #[serde(default)]
    pub edge: CoveringEdge,
    /// Share of a taxel's pressure that each of its up to four neighbours reads in addition, 0 to
    /// 0.5. Sheets call it "cross-talk"; −20 dB is 0.1. Default: 0.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 0.5)]
    pub cross_talk: f64,
    /// Relative standard deviation of the taxels' gains, 0 to 0.5. Sheets call it "uniformity" or
    /// "part-to-part repeatability". Default: 0.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 0.5)]
    pub gain_spread: f64,
    /// Largest relative deviation of a press through hysteresis, 0 to 0.5. Half of the "hysteresis"
    /// of the sheet, which is the whole width of the loop. Default: 0.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 0.5)]
    pub hysteresis: f64,
}

/// Shape of the lateral spread of a press; its standard deviation is `point_spread`.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum SpreadKernel {
    /// A Gaussian, as of a soft layer.
    #[default]
    Gaussian,
    /// A double exponential along each axis, as of a skin under tension: sharper, longer tails.
    Exponential,
}

/// Effect of the end of the covering on forces near it.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum CoveringEdge {
    /// The covering acts as if it went on: an even press reads the same in every taxel.
    #[default]
    Continues,
    /// All force reaches the remaining covering: taxels at the edge read more.
    ConservesForce,
    /// Force that would spread beyond the edge is lost: taxels at the edge read less.
    LosesForce,
}

/// Trust in a sensor's description, which decides how meshes are pressed in trainings.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum SensorKnowledge {
    /// The numbers were measured on this sensor, or describe a simulated one: meshes are pressed
    /// exactly as described. A real sensor that differs is recognised worse and gets too much "none
    /// of these".
    Measured,
    /// The numbers come from a data sheet: grid, range and noise are right; spread, edge, stiffness
    /// and cross-talk may differ. Meshes are pressed with many sensors drawn from `ranges`, and the
    /// probabilities are calibrated with sensors that the training has not seen.
    #[default]
    DataSheet,
    /// Only the grid is right; the other numbers are guesses. As `data_sheet`, with ranges about
    /// twice as wide: recognition needs more touches.
    Unknown,
    /// Touches of a known object measured the sensor on its robot: meshes are pressed with sensors
    /// drawn from what its passport leaves open. The default of trainings with a sensor that has a
    /// passport; sensors cannot be created with it.
    Commissioned,
}

impl SensorKnowledge {
    /// Name of the level on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::DataSheet => "data_sheet",
            Self::Unknown => "unknown",
            Self::Commissioned => "commissioned",
        }
    }
}

/// What a description of `data_sheet` or `unknown` leaves open: trainings from meshes draw sensors
/// from these ranges. A range in the request takes the place of the default, which is stated for
/// `data_sheet`; that of `unknown` is about twice as wide.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorRanges {
    /// Factor on `point_spread`. Default: 0.3 to 1.4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread_factor: Option<NumberRange>,
    /// Shapes of the spread. Default: that of `coupling`, or all if it is `gaussian`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 2)]
    pub kernels: Option<Vec<SpreadKernel>>,
    /// Extent of the covering beyond the array, in metres. Default: that of `coupling`, or 0 to 4
    /// pitches if it is null.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<NumberRange>,
    /// Effects of the covering's end. Default: that of `coupling`, or all if it is `continues`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 3)]
    pub edges: Option<Vec<CoveringEdge>>,
    /// Cross-talk of neighbours. Default: that of `coupling`, or 0 to 0.15 if it is 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cross_talk: Option<NumberRange>,
    /// Factor on the pressures of `force_curve`: below 1 for a softer covering. Default: 0.5 to 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<NumberRange>,
    /// Stiffening: 1 makes the covering twice as stiff at full indentation as at first touch.
    /// Default: 0 to 1.5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffening: Option<NumberRange>,
}

/// A range of numbers.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NumberRange {
    /// Smallest value.
    pub low: f64,
    /// Largest value; at least `low`.
    pub high: f64,
}
