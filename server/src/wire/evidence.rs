//! Conversion of the basis of stated probabilities.

use palpate_recogniser::model::CalibrationBasis;
use palpate_schemas::{Method, UncalibratedReason};

/// The reason for which a calibration is missing; `None` when it was learnt.
pub(crate) fn reason(basis: CalibrationBasis) -> Option<UncalibratedReason> {
    match basis {
        CalibrationBasis::HeldBack { .. } | CalibrationBasis::Sessions { .. } => None,
        CalibrationBasis::OneObject => Some(UncalibratedReason::OneObject),
        CalibrationBasis::FewReadings => Some(UncalibratedReason::FewReadings),
    }
}

/// The reason for which a method's probabilities are not calibrated; `None` when they are.
/// `basis` is that of the version's surfaces, if it has any.
pub(crate) fn reason_of(
    method: Method,
    basis: Option<CalibrationBasis>,
) -> Option<UncalibratedReason> {
    match method {
        Method::Surface => basis.and_then(reason),
        // Training fits its exponent on held-out readings.
        Method::Appearance => None,
        Method::Sva
        | Method::SvaLiteral
        | Method::Geometric
        | Method::GeometricHistogram
        | Method::GeometricParticles
        | Method::AppearanceLiteral => Some(UncalibratedReason::Method),
    }
}

/// Number of objects behind a calibration; 0 when there is none or it is unknown.
pub(crate) fn n_objects(basis: CalibrationBasis) -> usize {
    match basis {
        CalibrationBasis::HeldBack { objects } | CalibrationBasis::Sessions { objects, .. } => {
            objects
        }
        CalibrationBasis::OneObject | CalibrationBasis::FewReadings => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibration_depends_on_method_and_version() {
        let learnt = Some(CalibrationBasis::HeldBack { objects: 3 });
        let alone = Some(CalibrationBasis::OneObject);
        assert_eq!(reason_of(Method::Surface, learnt), None);
        assert_eq!(reason_of(Method::Surface, alone), Some(UncalibratedReason::OneObject));
        assert_eq!(reason_of(Method::Sva, learnt), Some(UncalibratedReason::Method));
        assert_eq!(reason_of(Method::Appearance, None), None);
    }
}
