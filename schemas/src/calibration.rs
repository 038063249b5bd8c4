//! Sensor calibrations on the wire: indentations in, fits and their quality out.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::ForceKnot;

/// Indentations to calibrate a sensor with.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrateSensor {
    /// Presses at the centre of every taxel, each to at least two depths, better five.
    #[schema(min_items = 8, max_items = 100_000)]
    pub response: Vec<ResponsePress>,
    /// Presses on a fine grid, for fitting the point spread.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<SpreadPresses>,
    /// Form of the responses. Default: `lines`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub form: Option<ResponseForm>,
}

/// Form of the responses of taxels.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ResponseForm {
    /// A line for each taxel, and a common one.
    #[default]
    Lines,
    /// A rising curve through the mean pressures at the pressed depths for each taxel, and a common
    /// one. For sensors that stiffen; it also gives their force curve.
    Curves,
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
    /// Displacement of the covering's surface, in metres; 0 for a reading at rest.
    #[schema(example = 0.0004)]
    pub depth: f64,
    /// The image in pascal, as the driver sends it; null for a taxel without a value.
    #[schema(max_items = 16_384)]
    pub pressures: Vec<Option<f64>>,
}

/// Presses on a fine grid around a taxel.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SpreadPresses {
    /// Diameter of the flat round indenter, in metres.
    #[schema(example = 0.001)]
    pub indenter_diameter: f64,
    /// Thickness of the pressed covering, in metres. Default: the sensor's own.
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
    /// Where the indenter's axis meets the covering, along +x in the sensor's frame, in metres.
    #[schema(example = 0.0012)]
    pub x: f64,
    /// Where the indenter's axis meets the covering, along +y in the sensor's frame, in metres.
    #[schema(example = 0.0009)]
    pub y: f64,
    /// Displacement of the covering's surface, in metres.
    #[schema(example = 0.00127)]
    pub depth: f64,
    /// The image in pascal, as the driver sends it; null for a taxel without a value.
    #[schema(max_items = 16_384)]
    pub pressures: Vec<Option<f64>>,
}

/// Selects a calibration of a sensor.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct CalibrationQuery {
    /// Number of the calibration, from 1. Default: the newest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub number: Option<u32>,
}

/// A calibration of a sensor. It applies to readings received after it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SensorCalibration {
    /// The sensor.
    pub sensor: Uuid,
    /// Number of the calibration, from 1 per sensor.
    pub number: u32,
    /// Number of the calibration whose passport applies after these lines; null if there is none.
    #[serde(default)]
    pub passport: Option<u32>,
    /// Form of the responses.
    pub form: ResponseForm,
    /// The response line to which every usable taxel is corrected; with curves the line through the
    /// same points, which is not used.
    pub target: ResponseLine,
    /// The response curve to which every usable taxel is corrected, by depth; null with lines. It
    /// is straight between its knots and goes on straight beyond them.
    pub curve: Option<Vec<ResponseKnot>>,
    /// The force curve for the description of a sensor with this response: the pressures of `curve`
    /// above that at rest. A small indenter shows its shape alone, so displacements are scaled such
    /// that it meets the described curve at the deepest knot. Null with lines, and if the responses
    /// give no force curve.
    pub force_curve: Option<Vec<ForceKnot>>,
    /// Fit of the measured responses to the target.
    pub before: ResponseGoodness,
    /// Fit of the corrected responses to the target; with curves, each press is corrected by curves
    /// that do not know its depth.
    pub after: ResponseGoodness,
    /// Number of presses in the fit.
    pub n_presses: u32,
    /// Every taxel, row by row in the sensor's frame.
    pub taxels: Vec<TaxelCalibration>,
    /// Number of unusable taxels. Their values are interpolated from their neighbours.
    pub n_unusable: u32,
    /// The fitted point spread; null if it was not measured.
    pub spread: Option<SpreadCalibration>,
    /// When the calibration was created.
    #[schema(format = DateTime)]
    pub created_at: String,
}

/// Linear response: pressure over depth of indentation.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ResponseLine {
    /// Slope in pascal per metre.
    pub slope: f64,
    /// Pressure without indentation, in pascal.
    pub offset: f64,
}

/// A knot of a response curve.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ResponseKnot {
    /// Depth of indentation in metres.
    pub depth: f64,
    /// Pressure in pascal.
    pub pressure: f64,
}

/// Quality of a fit.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ResponseGoodness {
    /// Coefficient of determination; 1 is a perfect fit.
    pub r_squared: f64,
    /// Root mean square residual, in pascal.
    pub residual: f64,
}

/// Response of one taxel.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct TaxelCalibration {
    /// Row of the taxel, from 0.
    pub row: u32,
    /// Column of the taxel, from 0.
    pub col: u32,
    /// Slope in pascal per metre of its own indentation.
    pub slope: f64,
    /// Pressure without indentation, in pascal.
    pub offset: f64,
    /// Coefficient of determination of its line.
    pub r_squared: f64,
    /// Its response curve, by depth; null with lines, and if it is not usable.
    pub curve: Option<Vec<ResponseKnot>>,
    /// State of the taxel.
    pub state: TaxelState,
    /// The taxel to whose presses this one responds; null unless it is cross-wired.
    pub answers: Option<TaxelPlace>,
}

/// State of a taxel.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum TaxelState {
    /// Responds to its own presses.
    Ok,
    /// Responds to no press.
    Dead,
    /// Responds more to the presses of another taxel.
    CrossWired,
}

/// A taxel, by row and column in the sensor's frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct TaxelPlace {
    /// Row of the taxel, from 0.
    pub row: u32,
    /// Column of the taxel, from 0.
    pub col: u32,
}

/// A fitted point spread. The sensor's description does not change: to use the fit, create a sensor
/// with it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SpreadCalibration {
    /// Standard deviation of the Gaussian, in metres.
    pub sigma: f64,
    /// The standard deviation in element widths (the sensor's pitch).
    pub sigma_in_widths: f64,
    /// Standard deviation in the sensor's description, in metres.
    pub described: f64,
    /// Standard deviation that equation 2.5 gives for the covering, in metres.
    pub published: f64,
    /// Mean cosine of measured and modelled images; 1 is perfect.
    pub cosine: f64,
    /// Mean Pearson correlation of measured and modelled images.
    pub pearson: f64,
    /// Number of presses in the fit.
    pub n_presses: u32,
}
