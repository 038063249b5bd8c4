//! Whether stated probabilities were calibrated, in words.

use palpate_client::schemas::{Method, TrainingReport, UncalibratedReason};

/// Why probabilities are not calibrated, and what helps.
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

/// A sentence for those who read probabilities that are not calibrated.
pub(crate) fn note(reason: UncalibratedReason) -> String {
    format!("probabilities and the risk of stopping are not calibrated: {}", words(reason))
}

/// Why what a method answers over a version is not calibrated; nothing when it is, or the
/// version does not say.
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
