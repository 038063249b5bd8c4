//! Stored forms of calibrations.

use bincode::{Decode, Encode};
use palpate_core::convention::{PoseConvention, PoseDirection, PositionUnit, QuaternionOrder};
use palpate_core::pose::Pose;
use palpate_core::sensor::line::{Goodness, Line};
use palpate_core::sensor::response_curve::{ResponseCurve, ResponseCurves};
use palpate_core::sensor::spread_fit::SpreadFit;
use palpate_core::sensor::{
    Calibration, CoveringEdge, Estimate, ImageOrder, Passport, TaxelResponse, TaxelState,
};
use uuid::Uuid;

use super::{StoredCalibration, StoredLines, StoredPassport, StoredSpread};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, code, coded, read, write};

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

/// Schema 2: lines, a passport, or both.
#[derive(Encode, Decode)]
struct CalibrationRecordV2 {
    sensor: IdV1,
    number: u32,
    lines: Option<LinesV2>,
    passport: Option<PassportV2>,
}

#[derive(Encode, Decode)]
struct LinesV2 {
    since: u32,
    /// Slope and offset.
    target: [f64; 2],
    /// R² and residual, as measured and corrected.
    goodness: [f64; 4],
    n_presses: u32,
    taxels: Vec<TaxelV1>,
    spread: Option<SpreadV1>,
    created_at_ms: u64,
}

/// Schema 3: lines may have curves.
#[derive(Encode, Decode)]
struct CalibrationRecordV3 {
    sensor: IdV1,
    number: u32,
    lines: Option<LinesV2>,
    curves: Option<CurvesV3>,
    passport: Option<PassportV2>,
}

/// Knots (depth, pressure) of the common curve and of the taxels' own; none for a taxel that is
/// not used.
#[derive(Encode, Decode)]
struct CurvesV3 {
    target: Vec<[f64; 2]>,
    taxels: Vec<Vec<[f64; 2]>>,
}

#[derive(Encode, Decode)]
struct PassportV2 {
    since: u32,
    pascals: f64,
    /// Indices in [`UNITS`], [`QUATERNIONS`] and [`DIRECTIONS`].
    convention: [u8; 3],
    /// Transposed, rows reversed, columns reversed.
    image_order: [bool; 3],
    /// Position, then quaternion x, y, z, w.
    sent_from_true: ([f64; 3], [f64; 4]),
    dead: Vec<u32>,
    /// Value and deviation of the gain, the stiffening and the point spread.
    measured: [[f64; 2]; 3],
    margin: Option<f64>,
    /// Index in [`EDGES`].
    edge: u8,
    is_edge_known: bool,
    looseness: f64,
    touched: String,
    object: Option<IdV1>,
    n_touches: u32,
    residual: [f64; 2],
    undetermined: Vec<String>,
    created_at_ms: u64,
}

const UNITS: [PositionUnit; 3] = PositionUnit::ALL;
const QUATERNIONS: [QuaternionOrder; 2] = [QuaternionOrder::Xyzw, QuaternionOrder::Wxyz];
const DIRECTIONS: [PoseDirection; 2] =
    [PoseDirection::SessionFromSensor, PoseDirection::SensorFromSession];
const EDGES: [CoveringEdge; 3] =
    [CoveringEdge::Continues, CoveringEdge::ConservesForce, CoveringEdge::LosesForce];

impl Record for StoredCalibration {
    const KIND: Kind = Kind::Calibration;
    const SCHEMA: u16 = 3;

    fn to_payload(&self) -> Vec<u8> {
        let curves = self.lines.as_ref().and_then(|lines| lines.calibration.curves());
        write(&CalibrationRecordV3 {
            sensor: self.sensor.into_bytes(),
            number: self.number,
            lines: self.lines.as_ref().map(LinesV2::of),
            curves: curves.map(CurvesV3::of),
            passport: self.passport.as_ref().map(PassportV2::of),
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let CalibrationRecordV3 { sensor, number, lines, curves, passport } = read(payload)?;
        let curves = curves.map(CurvesV3::value).transpose()?;
        Ok(Self {
            sensor: Uuid::from_bytes(sensor),
            number,
            lines: lines.map(|lines| lines.value(curves)).transpose()?,
            passport: passport.map(PassportV2::value).transpose()?,
        })
    }

    fn from_older(schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        match schema {
            1 => {
                let CalibrationRecordV1 {
                    sensor,
                    number,
                    target,
                    goodness,
                    n_presses,
                    taxels,
                    spread,
                    created_at_ms,
                } = read(payload)?;
                let since = number;
                let lines =
                    LinesV2 { since, target, goodness, n_presses, taxels, spread, created_at_ms };
                let (sensor, lines) = (Uuid::from_bytes(sensor), Some(lines.value(None)?));
                Ok(Self { sensor, number, lines, passport: None })
            }
            2 => {
                let CalibrationRecordV2 { sensor, number, lines, passport } = read(payload)?;
                Ok(Self {
                    sensor: Uuid::from_bytes(sensor),
                    number,
                    lines: lines.map(|lines| lines.value(None)).transpose()?,
                    passport: passport.map(PassportV2::value).transpose()?,
                })
            }
            _ => Err(RecordError::Schema { found: schema, known: Self::SCHEMA }),
        }
    }
}

impl LinesV2 {
    fn of(lines: &StoredLines) -> Self {
        let (before, after) = (lines.before, lines.after);
        let target = lines.calibration.target();
        Self {
            since: lines.since,
            target: [target.slope, target.offset],
            goodness: [before.r_squared, before.residual, after.r_squared, after.residual],
            n_presses: lines.n_presses,
            taxels: lines.calibration.taxels().iter().map(taxel_to_stored).collect(),
            spread: lines.spread.as_ref().map(spread_to_stored),
            created_at_ms: lines.created_at_ms,
        }
    }

    fn value(self, curves: Option<ResponseCurves>) -> Result<StoredLines, RecordError> {
        let [slope, offset] = self.target;
        let taxels = self.taxels.into_iter().map(taxel_from_stored).collect();
        let lines = Calibration::new(Line { slope, offset }, taxels)?;
        let [r_before, before, r_after, after] = self.goodness;
        Ok(StoredLines {
            since: self.since,
            calibration: match curves {
                Some(curves) => lines.with_curves(curves)?,
                None => lines,
            },
            before: Goodness { r_squared: r_before, residual: before },
            after: Goodness { r_squared: r_after, residual: after },
            n_presses: self.n_presses,
            spread: self.spread.map(spread_from_stored),
            created_at_ms: self.created_at_ms,
        })
    }
}

impl CurvesV3 {
    fn of(curves: &ResponseCurves) -> Self {
        let knots = |curve: &ResponseCurve| curve.knots().iter().map(|&(d, p)| [d, p]).collect();
        let own = |curve: &Option<ResponseCurve>| curve.as_ref().map(knots).unwrap_or_default();
        Self { target: knots(&curves.target), taxels: curves.taxels.iter().map(own).collect() }
    }

    fn value(self) -> Result<ResponseCurves, RecordError> {
        let curve = |knots: Vec<[f64; 2]>| {
            ResponseCurve::new(knots.into_iter().map(|[d, p]| (d, p)).collect())
        };
        let own = |knots: Vec<[f64; 2]>| match knots.is_empty() {
            true => Ok(None),
            false => curve(knots).map(Some),
        };
        let taxels: Result<Vec<_>, _> = self.taxels.into_iter().map(own).collect();
        Ok(ResponseCurves { target: curve(self.target)?, taxels: taxels? })
    }
}

impl PassportV2 {
    fn of(stored: &StoredPassport) -> Self {
        let passport = &stored.passport;
        let PoseConvention { unit, quaternion, direction } = passport.convention;
        let order = passport.image_order;
        let tool = passport.sent_from_true;
        let measured = [passport.gain, passport.stiffening, passport.point_spread];
        Self {
            since: stored.since,
            pascals: passport.pascals,
            convention: [
                code(&UNITS, &unit),
                code(&QUATERNIONS, &quaternion),
                code(&DIRECTIONS, &direction),
            ],
            image_order: [order.transposed, order.rows_reversed, order.cols_reversed],
            sent_from_true: (tool.translation.to_array(), tool.rotation.to_array()),
            // A sensor has at most 128 × 128 taxels.
            dead: passport.dead.iter().map(|taxel| *taxel as u32).collect(),
            measured: measured.map(|estimate| [estimate.value, estimate.deviation]),
            margin: passport.margin,
            edge: code(&EDGES, &passport.edge),
            is_edge_known: passport.is_edge_known,
            looseness: passport.looseness,
            touched: stored.touched.clone(),
            object: stored.object.map(Uuid::into_bytes),
            n_touches: stored.n_touches,
            residual: [stored.residual.0, stored.residual.1],
            undetermined: stored.undetermined.clone(),
            created_at_ms: stored.created_at_ms,
        }
    }

    fn value(self) -> Result<StoredPassport, RecordError> {
        let [unit, quaternion, direction] = self.convention;
        let [transposed, rows_reversed, cols_reversed] = self.image_order;
        let (position, rotation) = self.sent_from_true;
        let [gain, stiffening, point_spread] =
            self.measured.map(|[value, deviation]| Estimate { value, deviation });
        let passport = Passport {
            pascals: self.pascals,
            convention: PoseConvention {
                unit: coded(&UNITS, "unit", unit)?,
                quaternion: coded(&QUATERNIONS, "quaternion", quaternion)?,
                direction: coded(&DIRECTIONS, "direction", direction)?,
            },
            image_order: ImageOrder { transposed, rows_reversed, cols_reversed },
            sent_from_true: Pose::stored(position, rotation)?,
            dead: self.dead.into_iter().map(|taxel| taxel as usize).collect(),
            gain,
            stiffening,
            point_spread,
            margin: self.margin,
            edge: coded(&EDGES, "edge", self.edge)?,
            is_edge_known: self.is_edge_known,
            looseness: self.looseness,
        };
        passport.check()?;
        Ok(StoredPassport {
            since: self.since,
            passport,
            touched: self.touched,
            object: self.object.map(Uuid::from_bytes),
            n_touches: self.n_touches,
            residual: (self.residual[0], self.residual[1]),
            undetermined: self.undetermined,
            created_at_ms: self.created_at_ms,
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
