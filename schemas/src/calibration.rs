//! Calibrations of sensors on the wire: indentations in, fits with their goodness out.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

/// Indentations of a sensor, to fit its calibration to.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrateSensor {
    /// Presses at the centre of every taxel, each to two depths or more, best to five.
    #[schema(min_items = 8, max_items = 100_000)]
    pub response: Vec<ResponsePress>,
    /// Presses on a fine grid, to fit the point spread to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<SpreadPresses>,
}

/// One press at the centre of a taxel with a small indenter.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ResponsePress {
    /// The taxel's row in the sensor's frame (along +y), from 0.
    #[schema(example = 2)]
    pub row: u32,
    /// The taxel's column in the sensor's frame (along +x), from 0.
    #[schema(example = 3)]
    pub col: u32,
    /// How deep the covering's surface was displaced, in metres.
    #[schema(example = 0.0004)]
    pub depth: f64,
    /// The image as the driver sends it, in pascal; null for a taxel without a value.
    pub pressures: Vec<Option<f64>>,
}

/// Presses on a fine grid around a taxel.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SpreadPresses {
    /// Diameter of the flat round indenter, in metres.
    #[schema(example = 0.001)]
    pub indenter_diameter: f64,
    /// Thickness of the covering that was pressed, in metres; the sensor's own if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.00254)]
    pub covering_thickness: Option<f64>,
    /// The presses.
    #[schema(min_items = 1, max_items = 20_000)]
    pub presses: Vec<SpreadPress>,
}

/// One press of the fine grid.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SpreadPress {
    /// Where the indenter's axis met the covering, along +x in the sensor's frame, in metres.
    #[schema(example = 0.0012)]
    pub x: f64,
    /// The same along +y.
    #[schema(example = 0.0009)]
    pub y: f64,
    /// How deep the covering's surface was displaced, in metres.
    #[schema(example = 0.00127)]
    pub depth: f64,
    /// The image as the driver sends it, in pascal; null for a taxel without a value.
    pub pressures: Vec<Option<f64>>,
}

/// Which calibration of a sensor is wanted.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct CalibrationQuery {
    /// Its number, from 1; the newest if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub number: Option<u32>,
}

/// A calibration of a sensor. It applies to readings that come after it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SensorCalibration {
    /// The sensor.
    pub sensor: Uuid,
    /// Its number among the sensor's calibrations, from 1.
    pub number: u32,
    /// The line that every usable taxel is corrected to.
    pub target: ResponseLine,
    /// How the usable taxels' responses lie on the target line as measured.
    pub before: ResponseGoodness,
    /// How they lie on it after the correction.
    pub after: ResponseGoodness,
    /// How many presses the responses were fitted to.
    pub n_presses: u32,
    /// Every taxel, row by row in the sensor's frame.
    pub taxels: Vec<TaxelCalibration>,
    /// How many taxels cannot be used; their neighbours stand in for them.
    pub n_unusable: u32,
    /// The point spread; null when it was not measured.
    pub spread: Option<SpreadCalibration>,
    /// When it was made.
    #[schema(format = DateTime)]
    pub created_at: String,
}

/// Pressure over depth of indentation.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ResponseLine {
    /// Pascal a metre.
    pub slope: f64,
    /// Pascal without indentation.
    pub offset: f64,
}

/// How well responses lie on a line.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ResponseGoodness {
    /// Coefficient of determination; 1 is perfect.
    pub r_squared: f64,
    /// Root mean square of the residuals, in pascal.
    pub residual: f64,
}

/// How one taxel responds.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct TaxelCalibration {
    /// Its row, from 0.
    pub row: u32,
    /// Its column, from 0.
    pub col: u32,
    /// Pascal a metre of its own indentation.
    pub slope: f64,
    /// Pascal without indentation.
    pub offset: f64,
    /// Coefficient of determination of its line.
    pub r_squared: f64,
    /// Whether it can be used.
    pub state: TaxelState,
    /// The taxel whose presses it answers; null unless it is cross-wired.
    pub answers: Option<TaxelPlace>,
}

/// What a taxel does when it is pressed.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum TaxelState {
    /// It responds to what presses it.
    Ok,
    /// It responds to nothing.
    Dead,
    /// It responds more to what presses another taxel.
    CrossWired,
}

/// A taxel, by row and column in the sensor's frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct TaxelPlace {
    /// Its row, from 0.
    pub row: u32,
    /// Its column, from 0.
    pub col: u32,
}

/// A fitted point spread. The sensor's description does not change: to use it, add a sensor
/// with it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SpreadCalibration {
    /// Standard deviation of the Gaussian, in metres.
    pub sigma: f64,
    /// The same in element widths (the sensor's pitch).
    pub sigma_in_widths: f64,
    /// What the sensor's description says, in metres.
    pub described: f64,
    /// What equation 2.5 says of the covering, in metres.
    pub published: f64,
    /// Mean cosine of measured and modelled images; 1 is perfect.
    pub cosine: f64,
    /// Mean Pearson correlation of the same.
    pub pearson: f64,
    /// How many presses it was fitted to.
    pub n_presses: u32,
}
