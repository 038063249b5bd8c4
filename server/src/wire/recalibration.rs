//! Conversion of recalibrations, and of the requests that jobs store.

use palpate_recogniser::belief::recalibrate::Recalibration;
use palpate_recogniser::belief::{Quality, Stops};
use palpate_recogniser::model::{CalibrationBasis, EvidenceCalibration, EvidenceStage};
use palpate_schemas as wire;
use palpate_schemas::{RecalibrateCatalogue, ShadowVersion, StartTraining};
use serde::{Deserialize, Serialize};

use super::count;

/// The request of a job, as it is stored.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(untagged)]
pub(crate) enum JobRequest {
    /// A recalibration, with its sessions.
    Recalibration {
        /// The request.
        recalibration: RecalibrateCatalogue,
    },
    /// A comparison, with its sessions.
    Shadow {
        /// The version that is tried.
        version: u32,
        /// The request.
        shadow: ShadowVersion,
    },
    /// A training, with its defaults.
    Training(Box<StartTraining>),
}

impl JobRequest {
    /// Whether it needs a version of the job's catalogue.
    pub(crate) fn needs(&self, version: u32) -> bool {
        let wanted = Some(version);
        match self {
            Self::Recalibration { recalibration } => recalibration.version == wanted,
            Self::Shadow { version, shadow } => {
                Some(*version) == wanted || shadow.against == wanted
            }
            Self::Training(training) => training.extend == wanted,
        }
    }
}

/// The number of sessions that a recalibration used and did not use.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Used {
    pub(crate) n_known: usize,
    pub(crate) n_left_out: usize,
}

/// The report of a recalibration of a version, which had the calibration `before`.
pub(crate) fn report(
    found: &Recalibration,
    before: &EvidenceCalibration,
    from_version: u32,
    used: Used,
    seconds: f64,
) -> wire::RecalibrationReport {
    let (n_sessions, n_objects) = match found.calibration.basis {
        CalibrationBasis::Sessions { sessions, objects } => (sessions, objects),
        CalibrationBasis::HeldBack { .. }
        | CalibrationBasis::OneObject
        | CalibrationBasis::FewReadings => (0, 0),
    };
    wire::RecalibrationReport {
        from_version,
        n_sessions: count(n_sessions),
        n_known: count(used.n_known),
        n_objects: count(n_objects),
        n_left_out: count(used.n_left_out),
        is_better: found.is_better(),
        gain: found.gain,
        gain_error: found.gain_error,
        before: side(before, &found.before),
        after: side(&found.calibration, &found.after),
        seconds,
    }
}

fn side(calibration: &EvidenceCalibration, quality: &Quality) -> wire::RecalibrationSide {
    let Quality {
        accuracy,
        unknown_of_known,
        unknown_of_unknown,
        log_loss,
        calibration_error,
        stops,
    } = quality;
    wire::RecalibrationSide {
        sensor_width: calibration.width,
        stop_excess: calibration.stop.excess,
        stages: calibration.stages.iter().map(stage).collect(),
        accuracy: *accuracy,
        unknown_of_known: *unknown_of_known,
        unknown_of_unknown: *unknown_of_unknown,
        log_loss: *log_loss,
        calibration_error: *calibration_error,
        stops: stops.iter().map(stops_of).collect(),
    }
}

fn stage(stage: &EvidenceStage) -> wire::RecalibrationStage {
    wire::RecalibrationStage {
        temperature: stage.temperature,
        unknown: stage.unknown,
        unknown_per_touch: stage.unknown_per_touch,
    }
}

fn stops_of(stops: &Stops) -> wire::RecalibrationStops {
    wire::RecalibrationStops {
        risk: stops.risk,
        n_trials: count(stops.n_trials),
        n_stopped: count(stops.n_stopped),
        n_wrong: count(stops.n_wrong),
        touches: (stops.n_stopped > 0).then_some(stops.touches),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stored_request_is_told_by_its_field() {
        let recalibration = RecalibrateCatalogue { version: Some(4), ..Default::default() };
        let stored = JobRequest::Recalibration { recalibration };
        let stored = serde_json::to_string(&stored).unwrap();
        assert_eq!(stored, r#"{"recalibration":{"version":4}}"#);
        let read = |text: &str| serde_json::from_str::<JobRequest>(text).unwrap();
        assert!(matches!(read(&stored), JobRequest::Recalibration { .. }));
        assert!(read(&stored).needs(4) && !read(&stored).needs(3));
        let shadow = ShadowVersion { against: Some(3), ..Default::default() };
        let stored = serde_json::to_string(&JobRequest::Shadow { version: 4, shadow }).unwrap();
        assert_eq!(stored, r#"{"version":4,"shadow":{"against":3}}"#);
        assert!(matches!(read(&stored), JobRequest::Shadow { .. }));
        assert!(read(&stored).needs(4) && read(&stored).needs(3) && !read(&stored).needs(2));
        let training = read(r#"{"seed":1,"extend":2}"#);
        assert!(matches!(training, JobRequest::Training(_)));
        assert!(training.needs(2) && !training.needs(1));
    }
}
