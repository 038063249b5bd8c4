//! Conversion between a calibration that was fitted to sessions and its block.
//!
//! The block replaces the calibration of the block `surface`, so that a recalibrated version has all
//! blocks of the version before it, and this one.

use palpate_core::belief::answer::StopRule;
use palpate_recogniser::model::{CalibrationBasis, EvidenceCalibration, EvidenceStage};

use super::reader::Reader;
use super::writer::{put_counts, put_floats};
use super::{CodecError, FORM, count};

/// Name of the block.
pub const CALIBRATION_BLOCK: &str = "calibration";
/// Maximum numbers of sessions and objects behind a calibration.
const BASIS_MAX: u32 = 1 << 20;
/// Least and largest width of a sensor.
const WIDTH: std::ops::RangeInclusive<f64> = 0.1..=10.0;

/// The block of a calibration; `None` for one that was not fitted to sessions.
#[must_use]
pub fn to_block(calibration: &EvidenceCalibration) -> Option<Vec<u8>> {
    let CalibrationBasis::Sessions { sessions, objects } = calibration.basis else { return None };
    let mut block = Vec::new();
    put_counts(&mut block, &[FORM, count(sessions), count(objects)]);
    for stage in &calibration.stages {
        put_floats(&mut block, &[stage.temperature, stage.unknown, stage.unknown_per_touch]);
    }
    put_floats(&mut block, &[calibration.width, calibration.stop.excess]);
    Some(block)
}

/// The calibration of a block.
///
/// # Errors
/// [`CodecError`] of a block that no calibration has.
pub(super) fn from_block(block: &[u8]) -> Result<EvidenceCalibration, CodecError> {
    let mut reader = Reader::new(block)?;
    let sessions = reader.count("sessions of the calibration", 1, BASIS_MAX)?;
    let objects = reader.count("objects of the calibration", 1, BASIS_MAX)?;
    let numbers = reader.floats("calibration", 11)?;
    reader.end()?;
    let stage = |n: usize| EvidenceStage {
        temperature: numbers[3 * n],
        unknown: numbers[3 * n + 1],
        unknown_per_touch: numbers[3 * n + 2],
    };
    let (width, excess) = (numbers[9], numbers[10]);
    let calibration = EvidenceCalibration {
        stages: [stage(0), stage(1), stage(2)],
        width,
        stop: StopRule { excess },
        basis: CalibrationBasis::Sessions { sessions, objects },
    };
    let is_usable = calibration.stages.iter().all(|stage| stage.temperature > 0.0)
        && WIDTH.contains(&width)
        && excess > 0.0;
    if is_usable { Ok(calibration) } else { Err(CodecError::Surface) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fitted() -> EvidenceCalibration {
        let stop = StopRule { excess: 0.25 };
        let basis = CalibrationBasis::Sessions { sessions: 40, objects: 3 };
        EvidenceCalibration { width: 1.4, stop, basis, ..EvidenceCalibration::default() }
    }

    #[test]
    fn a_calibration_of_sessions_survives_its_block() {
        let block = to_block(&fitted()).unwrap();
        assert_eq!(from_block(&block), Ok(fitted()));
        assert_eq!(to_block(&EvidenceCalibration::default()), None);
    }

    #[test]
    fn a_stored_calibration_stays_readable() {
        let golden = include_str!("../../tests/store/golden/calibration_block_v1.txt").trim();
        let byte = |at: usize| u8::from_str_radix(&golden[at..at + 2], 16).unwrap();
        let stored: Vec<u8> = (0..golden.len()).step_by(2).map(byte).collect();
        assert_eq!(from_block(&stored), Ok(fitted()));
        assert_eq!(to_block(&fitted()), Some(stored), "a new form needs a new golden file");
    }

    #[test]
    fn an_impossible_calibration_is_refused() {
        let refused = |change: fn(&mut EvidenceCalibration)| {
            let mut calibration = fitted();
            change(&mut calibration);
            from_block(&to_block(&calibration).unwrap()).unwrap_err()
        };
        assert_eq!(refused(|it| it.width = 0.0), CodecError::Surface);
        assert_eq!(refused(|it| it.stop.excess = -1.0), CodecError::Surface);
        assert_eq!(refused(|it| it.stages[1].temperature = 0.0), CodecError::Surface);
        let infinite = refused(|it| it.stages[2].unknown = f64::INFINITY);
        assert!(matches!(infinite, CodecError::Finite { field: "calibration", .. }));
        let mut long = to_block(&fitted()).unwrap();
        long.push(0);
        assert!(matches!(from_block(&long), Err(CodecError::Length { .. })));
    }
}
