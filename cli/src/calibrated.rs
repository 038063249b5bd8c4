//! Text about whether probabilities were calibrated.

use palpate_client::schemas::{Method, TrainingReport, UncalibratedReason};

/// Text with the reason for uncalibrated probabilities, and the remedy.
pub(crate) fn words(reason: UncalibratedReason) -> &'static str {
    match reason {
        UncalibratedReason::OneObject => {
            "the catalogue has one object; train another one beside it"
        }
        UncalibratedReason::FewReadings => {
            "no object has 100 readings, of which a tenth is held back; take more"
        }
        UncalibratedReason::Method => "the method has no calibration",
    }
}

/// A note for readers of uncalibrated probabilities.
pub(crate) fn note(reason: UncalibratedReason) -> String {
    format!("probabilities and the risk of stopping are not calibrated: {}", words(reason))
}

/// Reason for which a method's probabilities over a version are not calibrated; `None` if they
/// are, or if the version does not say.
pub(crate) fn reason_of(
    method: Option<Method>,
    report: &TrainingReport,
) -> Option<UncalibratedReason> {
    match method.unwrap_or_default() {
        Method::Surface => report.uncalibrated_reason,
        Method::Appearance => None,
        _ => Some(UncalibratedReason::Method),
    }
}
