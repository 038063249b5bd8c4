//! Calibrations of sensors: numbered from 1 for each sensor, added and never changed.
//!
//! A calibration has the response lines of the taxels, a passport, or both: an addition of one
//! keeps the other of the calibration before. A stored reading names the number of its
//! calibration, so later measurements do not change its meaning.

mod stored;

use std::sync::Arc;

use palpate_core::sensor::line::Goodness;
use palpate_core::sensor::spread_fit::SpreadFit;
use palpate_core::sensor::{Calibration, Correction, Passport};
use uuid::Uuid;

use crate::engine::{Commit, Engine, Expected};
use crate::error::{StoreError, conflict};
use crate::key::{self, Space};
use crate::pieces::{self, Limit};
use crate::record;

/// Length of a calibration's key: space, sensor, number.
const KEY_BYTES: usize = 25;
/// Attempts of an addition under concurrent additions.
const ADD_ATTEMPTS: usize = 64;

/// A stored calibration: what corrects readings that name its number.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredCalibration {
    /// The sensor.
    pub sensor: Uuid,
    /// Number among the sensor's calibrations, from 1.
    pub number: u32,
    /// The response lines of the taxels.
    pub lines: Option<StoredLines>,
    /// The passport.
    pub passport: Option<StoredPassport>,
}

impl StoredCalibration {
    /// What applies to readings.
    #[must_use]
    pub fn correction(&self) -> Correction {
        Correction {
            lines: self.lines.as_ref().map(|lines| lines.calibration.clone()),
            passport: self.passport.as_ref().map(|stored| stored.passport.clone()),
        }
    }
}

/// Response lines, their data, and the quality of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredLines {
    /// Number of the calibration that brought them; set by [`Calibrations::add`].
    pub since: u32,
    /// The correction.
    pub calibration: Calibration,
    /// Fit of the measured responses to the target line.
    pub before: Goodness,
    /// Fit of the corrected responses.
    pub after: Goodness,
    /// Number of presses in the fit of the responses.
    pub n_presses: u32,
    /// The point spread, if it was measured.
    pub spread: Option<StoredSpread>,
    /// Time of addition.
    pub created_at_ms: u64,
}

/// A passport, and the touches that it follows from.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredPassport {
    /// Number of the calibration that brought it; set by [`Calibrations::add`].
    pub since: u32,
    /// The correction.
    pub passport: Passport,
    /// The object that was touched: its name, or that of a reference body.
    pub touched: String,
    /// Id of the object; `None` for a reference body.
    pub object: Option<Uuid>,
    /// Number of touches.
    pub n_touches: u32,
    /// Residual with the set-up as stated and as found, as a share of a touch's largest pressure.
    pub residual: (f64, f64),
    /// Names of the findings that the touches did not determine.
    pub undetermined: Vec<String>,
    /// Time of addition.
    pub created_at_ms: u64,
}

/// An addition to a sensor's calibrations.
#[derive(Clone, Debug, PartialEq)]
pub enum Addition {
    /// Response lines; the passport stays.
    Lines(StoredLines),
    /// A passport; the response lines stay.
    Passport(StoredPassport),
}

impl Addition {
    /// The sensor's calibration after `latest`.
    fn after(&self, sensor: Uuid, latest: Option<StoredCalibration>) -> StoredCalibration {
        let number = latest.as_ref().map_or(1, |latest| latest.number + 1);
        let (lines, passport) = latest.map_or((None, None), |kept| (kept.lines, kept.passport));
        match self {
            Self::Lines(lines) => {
                let lines = Some(StoredLines { since: number, ..lines.clone() });
                StoredCalibration { sensor, number, lines, passport }
            }
            Self::Passport(passport) => {
                let passport = Some(StoredPassport { since: number, ..passport.clone() });
                StoredCalibration { sensor, number, lines, passport }
            }
        }
    }
}

/// A fitted point spread and its data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredSpread {
    /// The fit.
    pub fit: SpreadFit,
    /// Number of presses in the fit.
    pub n_presses: u32,
    /// Diameter of the indenter, metres.
    pub indenter_diameter: f64,
    /// Thickness of the pressed covering, metres, if stated.
    pub covering_thickness: Option<f64>,
}

/// The calibrations of all sensors.
#[derive(Clone)]
pub struct Calibrations {
    engine: Arc<dyn Engine>,
}

impl Calibrations {
    pub(crate) fn new(engine: Arc<dyn Engine>) -> Self {
        Self { engine }
    }

    /// Stores an addition under its sensor's next number and returns that calibration; durable
    /// when it returns.
    ///
    /// # Errors
    /// [`StoreError::Changed`] only under endless concurrent additions; the engine's.
    pub async fn add(
        &self,
        sensor: Uuid,
        addition: &Addition,
    ) -> Result<StoredCalibration, StoreError> {
        for _ in 0..ADD_ATTEMPTS {
            let next = addition.after(sensor, self.latest(sensor)?);
            let head = key::numbered(Space::Calibration, sensor, u64::from(next.number));
            let commit = Commit::new().expect(head.clone(), Expected::Absent);
            let commit = pieces::put(commit, &head, &record::encode(&next), None);
            match self.engine.commit(commit).await.map_err(conflict) {
                Ok(()) => return Ok(next),
                Err(Ok(_)) => {}
                Err(Err(error)) => return Err(error.into()),
            }
        }
        Err(StoreError::Changed { what: "calibrations of sensor", id: sensor })
    }

    /// Stores a calibration of another server as the sensor's next; durable when it returns.
    ///
    /// # Errors
    /// [`StoreError::Changed`] when its number is not the next one; the engine's.
    pub async fn adopt(&self, calibration: &StoredCalibration) -> Result<(), StoreError> {
        let sensor = calibration.sensor;
        let changed = || StoreError::Changed { what: "calibrations of sensor", id: sensor };
        if calibration.number != self.latest(sensor)?.map_or(0, |latest| latest.number) + 1 {
            return Err(changed());
        }
        let head = key::numbered(Space::Calibration, sensor, u64::from(calibration.number));
        let commit = Commit::new().expect(head.clone(), Expected::Absent);
        let commit = pieces::put(commit, &head, &record::encode(calibration), None);
        match self.engine.commit(commit).await.map_err(conflict) {
            Ok(()) => Ok(()),
            Err(Ok(_)) => Err(changed()),
            Err(Err(error)) => Err(error.into()),
        }
    }

    /// A sensor's calibration with the given number.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn find(&self, sensor: Uuid, number: u32) -> Result<Option<StoredCalibration>, StoreError> {
        let head = key::numbered(Space::Calibration, sensor, u64::from(number));
        let found = pieces::read(&*self.engine, Space::Calibration, &head)?;
        let decoded = found.map(|bytes| record::decode(&bytes)).transpose();
        decoded.map_err(StoreError::damaged(Space::Calibration))
    }

    /// A sensor's newest calibration.
    ///
    /// # Errors
    /// As [`Calibrations::find`].
    pub fn latest(&self, sensor: Uuid) -> Result<Option<StoredCalibration>, StoreError> {
        // Numbers have no gaps: doubling and halving finds the last, without reading all.
        let exists = |number: u32| {
            let head = key::numbered(Space::Calibration, sensor, u64::from(number));
            Ok::<bool, StoreError>(self.engine.get(&head)?.is_some())
        };
        let (mut last, mut step) = (0_u32, 1_u32);
        while exists(last.saturating_add(step))? {
            (last, step) = (last + step, step.saturating_mul(2));
        }
        while step > 0 {
            if exists(last.saturating_add(step))? {
                last += step;
            }
            step /= 2;
        }
        if last == 0 { Ok(None) } else { self.find(sensor, last) }
    }

    /// The calibrations of a sensor behind a number, oldest first, within a limit.
    ///
    /// # Errors
    /// As [`Calibrations::find`].
    pub fn page(
        &self,
        sensor: Uuid,
        behind: u32,
        limit: Limit,
    ) -> Result<Vec<StoredCalibration>, StoreError> {
        let (space, prefix) = (Space::Calibration, key::id(Space::Calibration, sensor));
        // Later pieces of the calibration before the page may follow its key.
        let from = key::numbered(space, sensor, u64::from(behind));
        let records = pieces::scan(&*self.engine, space, &prefix, KEY_BYTES, Some(from), limit)?;
        let decoded: Result<Vec<_>, _> =
            records.iter().map(|(_, bytes)| record::decode(bytes)).collect();
        decoded.map_err(StoreError::damaged(space))
    }
}
