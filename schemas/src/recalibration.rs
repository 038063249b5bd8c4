//! Recalibration of catalogues on the wire: requests, and reports of before and after.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// Request to recalibrate a version from ended sessions whose true object is known.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RecalibrateCatalogue {
    /// Version to recalibrate. Default: the current one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub version: Option<u32>,
    /// Sessions to use: ended ones of this catalogue with the method `surface`, a known truth and at
    /// least 3 readings. Default: the newest 300 of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 20, max_items = 300)]
    pub sessions: Option<Vec<Uuid>>,
    /// Id or name of a sensor: only sessions whose first 16 readings are all of this sensor. Default:
    /// sessions of any sensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "digitacts-6x6")]
    pub sensor: Option<String>,
    /// Whether to make the new version current, if it is better on sessions that its calibration
    /// does not know and the recalibrated version is still the current one. Default: true.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activate: Option<bool>,
}

/// Report of a recalibration.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct RecalibrationReport {
    /// The version that was recalibrated. To undo the recalibration, make it current again.
    pub from_version: u32,
    /// Number of sessions used.
    pub n_sessions: u32,
    /// Number of those that touched an object of the version.
    pub n_known: u32,
    /// Number of objects that they touched.
    pub n_objects: u32,
    /// Number of sessions whose readings could not be used, such as those of removed sensors.
    pub n_left_out: u32,
    /// Whether the calibration is better than before on sessions that it does not know: the fall
    /// of their loss is at least 0.01 and twice its standard error. If not, the version did not
    /// become current.
    pub is_better: bool,
    /// Mean fall of the sessions' `log_loss`.
    pub gain: f64,
    /// Standard error of `gain`.
    pub gain_error: f64,
    /// What the calibration says, and what it is worth, before.
    pub before: RecalibrationSide,
    /// The same after. Its figures are those of calibrations fitted to one half of the sessions and
    /// judged on the other, so that no session is judged by what it was fitted to.
    pub after: RecalibrationSide,
    /// Duration of the recalibration, in seconds.
    pub seconds: f64,
}

/// A calibration, and its beliefs about ended sessions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct RecalibrationSide {
    /// Width of the sensor: factor of the usual deviations of a touch from the surface. 1 if it was
    /// never recalibrated.
    pub sensor_width: f64,
    /// Excess of the stop rule: the risk of a stop is at least this times (1 − p)^0.45.
    pub stop_excess: f64,
    /// Temperature and evidence of "none of these" after one touch, two, and three or more.
    #[schema(min_items = 3, max_items = 3)]
    pub stages: Vec<RecalibrationStage>,
    /// Share of sessions of known objects whose last belief named the object.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub accuracy: f64,
    /// Mean `unknown` at the end of sessions of known objects.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub unknown_of_known: f64,
    /// Mean `unknown` at the end of sessions of unknown objects. Sessions of known objects are also
    /// replayed without their object in the catalogue, and then count here.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub unknown_of_unknown: f64,
    /// Mean −ln of the probability of the truth after each touch, when "none of these" is as probable
    /// as all objects together.
    pub log_loss: f64,
    /// Mean difference between the probability of the likeliest answer and the share of right
    /// answers with about this probability, for the same prior.
    #[schema(minimum = 0.0, maximum = 1.0)]
    pub calibration_error: f64,
    /// Stops at risks of 0.05 and 0.01, for the same prior.
    #[schema(min_items = 2, max_items = 2)]
    pub stops: Vec<RecalibrationStops>,
}

/// Calibration after one touch, two, or three or more.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct RecalibrationStage {
    /// Temperature by which evidence is divided.
    pub temperature: f64,
    /// Evidence of "none of these" (ln) before any touch.
    pub unknown: f64,
    /// Increase of it with every touch.
    pub unknown_per_touch: f64,
}

/// What the stop rule did at an accepted risk.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct RecalibrationStops {
    /// The accepted risk.
    pub risk: f64,
    /// Number of trials: replays with and without the object in the catalogue.
    pub n_trials: u32,
    /// Number of trials that stopped.
    pub n_stopped: u32,
    /// Number of those that stopped with a wrong answer.
    pub n_wrong: u32,
    /// Mean number of touches until a stop; null without any.
    pub touches: Option<f64>,
}
