//! Stored forms of calibrations.

use bincode::{Decode, Encode};
use palpate_core::sensor::line::{Goodness, Line};
use palpate_core::sensor::spread_fit::SpreadFit;
use palpate_core::sensor::{Calibration, TaxelResponse, TaxelState};
use uuid::Uuid;

use super::{IdV1, Record, read, write};
use crate::calibration::{StoredCalibration, StoredSpread};
use crate::envelope::Kind;
use crate::error::RecordError;

#[derive(Encode, Decode)]
struct CalibrationRecordV1 {
    sensor: IdV1,
    number: u32,
    /// Slope and offset.
    target: [f64; 2],
    /// R² and residual, as measured and corrected.
    goodness: [f64; 4],
    n_presses: u32,
    taxels: Vec<TaxelV1>,
    spread: Option<SpreadV1>,
    created_at_ms: u64,
}

#[derive(Encode, Decode)]
struct TaxelV1 {
    slope: f64,
    offset: f64,
    r_squared: f64,
    state: StateV1,
}

#[derive(Encode, Decode)]
enum StateV1 {
    Ok,
    Dead,
    CrossWired { answers: u32 },
}

#[derive(Encode, Decode)]
struct SpreadV1 {
    sigma: f64,
    sigma_in_widths: f64,
    cosine: f64,
    pearson: f64,
    n_presses: u32,
    indenter_diameter: f64,
    covering_thickness: Option<f64>,
}

impl Record for StoredCalibration {
    const KIND: Kind = Kind::Calibration;

    fn to_payload(&self) -> Vec<u8> {
        let target = self.calibration.target();
        let (before, after) = (self.before, self.after);
        write(&CalibrationRecordV1 {
            sensor: self.sensor.into_bytes(),
            number: self.number,
            target: [target.slope, target.offset],
            goodness: [before.r_squared, before.residual, after.r_squared, after.residual],
            n_presses: self.n_presses,
            taxels: self.calibration.taxels().iter().map(taxel_to_stored).collect(),
            spread: self.spread.as_ref().map(spread_to_stored),
            created_at_ms: self.created_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: CalibrationRecordV1 = read(payload)?;
        let [slope, offset] = stored.target;
        let taxels = stored.taxels.into_iter().map(taxel_from_stored).collect();
        let [r_before, before, r_after, after] = stored.goodness;
        Ok(Self {
            sensor: Uuid::from_bytes(stored.sensor),
            number: stored.number,
            calibration: Calibration::new(Line { slope, offset }, taxels)?,
            before: Goodness { r_squared: r_before, residual: before },
            after: Goodness { r_squared: r_after, residual: after },
            n_presses: stored.n_presses,
            spread: stored.spread.map(spread_from_stored),
            created_at_ms: stored.created_at_ms,
        })
    }
}

fn taxel_to_stored(taxel: &TaxelResponse) -> TaxelV1 {
    let state = match taxel.state {
        TaxelState::Ok => StateV1::Ok,
        TaxelState::Dead => StateV1::Dead,
        // A sensor has at most 128 × 128 taxels.
        TaxelState::CrossWired { answers } => StateV1::CrossWired { answers: answers as u32 },
    };
    let Line { slope, offset } = taxel.line;
    TaxelV1 { slope, offset, r_squared: taxel.r_squared, state }
}

fn taxel_from_stored(taxel: TaxelV1) -> TaxelResponse {
    let state = match taxel.state {
        StateV1::Ok => TaxelState::Ok,
        StateV1::Dead => TaxelState::Dead,
        StateV1::CrossWired { answers } => TaxelState::CrossWired { answers: answers as usize },
    };
    let line = Line { slope: taxel.slope, offset: taxel.offset };
    TaxelResponse { line, r_squared: taxel.r_squared, state }
}

fn spread_to_stored(spread: &StoredSpread) -> SpreadV1 {
    let SpreadFit { sigma, sigma_in_widths, cosine, pearson } = spread.fit;
    SpreadV1 {
        sigma,
        sigma_in_widths,
        cosine,
        pearson,
        n_presses: spread.n_presses,
        indenter_diameter: spread.indenter_diameter,
        covering_thickness: spread.covering_thickness,
    }
}

fn spread_from_stored(stored: SpreadV1) -> StoredSpread {
    let SpreadV1 { sigma, sigma_in_widths, cosine, pearson, .. } = stored;
    StoredSpread {
        fit: SpreadFit { sigma, sigma_in_widths, cosine, pearson },
        n_presses: stored.n_presses,
        indenter_diameter: stored.indenter_diameter,
        covering_thickness: stored.covering_thickness,
    }
}
