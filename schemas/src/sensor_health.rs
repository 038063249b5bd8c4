//! The health of a sensor on the wire: whether to commission it again, and why.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// A sensor's health, from the sessions that ended with its readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SensorHealth {
    /// The sensor's id.
    pub sensor: Uuid,
    /// The sensor's name.
    pub name: String,
    /// The verdict.
    pub state: HealthState,
    /// The verdict in words.
    pub summary: String,
    /// Reasons for the verdict, the severest first; at most 32.
    pub reasons: Vec<HealthReason>,
    /// Number of reasons.
    pub n_reasons: u32,
    /// Number of the calibration that days must have to count; null if the sensor has none.
    pub calibration: Option<u32>,
    /// First day that counts, such as `2026-11-25` (UTC); null if there is none.
    pub first_day: Option<String>,
    /// Last day that counts; null if there is none.
    pub last_day: Option<String>,
    /// Number of days that count, at most 30.
    pub n_days: u32,
    /// Number of sessions of these days.
    pub n_sessions: u32,
    /// Number of their presses with an image.
    pub n_presses: u32,
    /// Number of those that met nothing.
    pub n_quiet: u32,
    /// The taxels at rest; null before the first press that met nothing.
    pub rest: Option<SensorRest>,
    /// Taxels that never answer while those beside them do, as indices into the image (row-major
    /// in the sensor's frame).
    pub dead: Vec<u32>,
    /// Taxels that always have the same value while those beside them do not.
    pub stuck: Vec<u32>,
    /// The tool centre according to recognised sessions; null before the first one.
    pub tool_center: Option<ToolCenterError>,
    /// Number of sessions, of any sensor, that ended and are not counted yet.
    pub n_waiting: u32,
}

/// State of a sensor.
#[derive(
    Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, PartialOrd, Ord, Hash, ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum HealthState {
    /// Too little is known to judge.
    Unknown,
    /// Nothing speaks for commissioning again.
    Good,
    /// Something has changed, within what recognition tolerates.
    Watch,
    /// Commission the sensor again.
    Commission,
}

/// A reason for a verdict.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct HealthReason {
    /// Kind of the reason, for programs; stable between releases.
    pub code: HealthCode,
    /// The state that it alone would give.
    pub state: HealthState,
    /// Index of the taxel concerned; null for the whole sensor.
    pub taxel: Option<u32>,
    /// The axis of the sensor frame concerned, `x`, `y` or `z`; null for taxels.
    pub axis: Option<String>,
    /// The value found: Pa, for `gain` a ratio, for `tool_center` metres.
    pub value: f64,
    /// The expected value; for `common_offset`, `offset`, `drift` and `tool_center` the largest
    /// expected size.
    pub expected: f64,
    /// What was found and what was expected.
    pub detail: String,
}

/// Kind of a reason.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum HealthCode {
    /// The taxel never answers while those beside it do.
    Dead,
    /// The taxel always has the same value while those beside it do not.
    Stuck,
    /// All taxels read the same without contact, and not 0.
    CommonOffset,
    /// The taxel reads something without contact.
    Offset,
    /// The taxel's reading without contact has changed since the first days.
    Drift,
    /// The taxel is noisier than described.
    Noise,
    /// The taxel answers more or less than in the first days, beside its neighbours.
    Gain,
    /// Recognised touches are all off along one axis of the sensor frame.
    ToolCenter,
}

/// Taxels at rest, row-major in the sensor's frame, in pascal. Null for a taxel without a value.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SensorRest {
    /// Number of presses of the newest days that met nothing.
    pub n_presses: u32,
    /// Value of each taxel of late: the mean of its values, in which each counts a tenth less than
    /// the next.
    pub pressures: Vec<Option<f64>>,
    /// Change of each since its mean of the first days; null until there are enough days.
    pub changes: Option<Vec<Option<f64>>>,
    /// Standard deviation of each taxel.
    pub noise: Vec<Option<f64>>,
    /// Noise of the sensor's description.
    pub described_noise: f64,
    /// Pressure above which a taxel counts as touched.
    pub contact_floor: f64,
}

/// Place of the sensor relative to the stated one, according to recognised sessions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ToolCenterError {
    /// x, y, z in the sensor's frame, in metres: where it is, less where it was stated.
    pub shift_m: [f64; 3],
    /// Standard deviation of each, in metres.
    pub deviation_m: [f64; 3],
    /// Number of sessions.
    pub n_sessions: u32,
    /// Number of their touches.
    pub n_touches: u32,
}
