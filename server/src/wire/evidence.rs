//! What stated probabilities rest on, for the wire.

use palpate_recogniser::model::CalibrationBasis;
use palpate_schemas::{Method, UncalibratedReason};

/// Why a calibration is none; nothing when it was learnt.
pub(crate) fn reason(basis: CalibrationBasis) -> Option<UncalibratedReason> {
    match basis {
        CalibrationBasis::HeldBack { .. } => None,
        CalibrationBasis::OneObject => Some(UncalibratedReason::OneObject),
        CalibrationBasis::FewReadings => Some(UncalibratedReason::FewReadings),
    }
}

/// Why what a method answers is not calibrated; nothing when it is. `basis` is that of the
/// version's surfaces, if it has any.
pub(crate) fn reason_of(
    method: Method,
    basis: Option<CalibrationBasis>,
) -> Option<UncalibratedReason> {
    match method {
        Method::Surface => basis.and_then(reason),
        // Training fits its exponent on readings that it holds back.
        Method::Appearance => None,
        Method::Sva
        | Method::SvaLiteral
        | Method::Geometric
        | Method::GeometricHistogram
        | Method::GeometricParticles
        | Method::AppearanceLiteral => Some(UncalibratedReason::Method),
    }
}

/// How many objects a calibration was learnt on; 0 when it was not, or nobody knows.
pub(crate) fn n_objects(basis: CalibrationBasis) -> usize {
    match basis {
        CalibrationBasis::HeldBack { objects } => objects,
        CalibrationBasis::OneObject | CalibrationBasis::FewReadings => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_belief_is_calibrated_by_its_method_and_its_version() {
        let learnt = Some(CalibrationBasis::HeldBack { objects: 3 });
        let alone = Some(CalibrationBasis::OneObject);
        assert_eq!(reason_of(Method::Surface, learnt), None);
        assert_eq!(reason_of(Method::Surface, alone), Some(UncalibratedReason::OneObject));
        assert_eq!(reason_of(Method::Sva, learnt), Some(UncalibratedReason::Method));
        assert_eq!(reason_of(Method::Appearance, None), None);
    }
}
