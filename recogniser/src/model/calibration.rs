//! Calibration of a model: map from ln evidence to probability (equations R13 and R18), the stop
//! rule (R24) and the width of the sensor (R4b).

use palpate_core::belief::answer::StopRule;

/// Temperature, b and c of each stage of the default calibration. 7.24 is 13, fitted when each of
/// ten objects weighed 1 instead of a tenth, less 2.5 ln 10.
const DEFAULT_STAGES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [1.2, 0.0, 0.0], [2.5, 7.24, 8.5]];

/// What a model's beliefs are calibrated by. Evidence after one, two, and three or more touches
/// differs in kind (equation R17), so each stage has a map of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvidenceCalibration {
    /// Stages after one, two, and three or more touches.
    pub stages: [EvidenceStage; 3],
    /// The width of the sensor: factor of the usual deviations of a touch (equation R4b). 1 unless
    /// it was fitted to sessions.
    pub width: f64,
    /// The stop rule of sessions.
    pub stop: StopRule,
    /// The data it was learnt on.
    pub basis: CalibrationBasis,
}

/// The data a calibration was learnt on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CalibrationBasis {
    /// Readings held back from training.
    HeldBack {
        /// Number of objects with such readings; 0 for an old version that does not record it.
        objects: usize,
    },
    /// Sessions whose true object is known.
    Sessions {
        /// Number of sessions.
        sessions: usize,
        /// Number of objects of the catalogue that they touched.
        objects: usize,
    },
    /// No data: a single object leaves no touches of an unknown object.
    OneObject,
    /// No data: no object has enough readings to hold some back.
    FewReadings,
}

/// Map from ln evidence to probability at one stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvidenceStage {
    /// τ_k, the temperature by which evidence is divided; above 1 it reduces confidence.
    pub temperature: f64,
    /// b_k: ln evidence of "none of these" before any touch.
    pub unknown: f64,
    /// c_k: increase of it per touch, by weight.
    pub unknown_per_touch: f64,
}

impl EvidenceStage {
    /// ln evidence of "none of these" after this many touches by weight, before the correction of
    /// equation R13.
    #[must_use]
    pub fn log_unknown(&self, n_touches: f64) -> f64 {
        self.unknown + self.unknown_per_touch * n_touches
    }
}

impl Default for EvidenceCalibration {
    /// The calibration of catalogues that hold nothing back, fitted to simulated touches of the ten
    /// built-in objects by one sensor.
    fn default() -> Self {
        let stages = DEFAULT_STAGES.map(|[temperature, unknown, unknown_per_touch]| {
            EvidenceStage { temperature, unknown, unknown_per_touch }
        });
        let (width, stop, basis) = (1.0, StopRule::default(), CalibrationBasis::FewReadings);
        Self { stages, width, stop, basis }
    }
}
