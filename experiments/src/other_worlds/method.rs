//! How a catalogue of `other-worlds` is trained.

use clap::ValueEnum;
use palpate_core::sensor::SensorKnowledge;
use serde::Serialize;

/// Knowledge of the sensor in training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub enum Method {
    /// The sensor is as described.
    AsDescribed,
    /// The description is a data sheet.
    DataSheet,
    /// Only the grid is known.
    Unknown,
    /// The sensor was commissioned in each world.
    Commissioned,
}

impl Method {
    /// Its name in rows and keys.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::AsDescribed => "as_described",
            Self::DataSheet => "data_sheet",
            Self::Unknown => "unknown",
            Self::Commissioned => "commissioned",
        }
    }

    /// Trust in the description; `None` when it is measured in each world.
    pub(super) fn knowledge(self) -> Option<SensorKnowledge> {
        match self {
            Self::AsDescribed => Some(SensorKnowledge::Measured),
            Self::DataSheet => Some(SensorKnowledge::DataSheet),
            Self::Unknown => Some(SensorKnowledge::Unknown),
            Self::Commissioned => None,
        }
    }
}
