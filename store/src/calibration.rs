//! Calibrations of sensors: numbered from 1 for each sensor, added and never changed.
//!
//! A stored reading names the number of its calibration, so later measurements do not change
//! its meaning.

use std::sync::Arc;

use palpate_core::sensor::Calibration;
use palpate_core::sensor::line::Goodness;
use palpate_core::sensor::spread_fit::SpreadFit;
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

/// A stored calibration: the correction, its data, and the quality of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredCalibration {
    /// The sensor.
    pub sensor: Uuid,
    /// Number among the sensor's calibrations, from 1; set by [`Calibrations::add`].
    pub number: u32,
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

    /// Stores a calibration under its sensor's next number and returns that number; durable
    /// when it returns.
    ///
    /// # Errors
    /// [`StoreError::Changed`] only under endless concurrent additions; the engine's.
    pub async fn add(&self, calibration: &StoredCalibration) -> Result<u32, StoreError> {
        let sensor = calibration.sensor;
        for _ in 0..ADD_ATTEMPTS {
            let number = self.latest(sensor)?.map_or(1, |latest| latest.number + 1);
            let numbered = StoredCalibration { number, ..calibration.clone() };
            let head = key::numbered(Space::Calibration, sensor, u64::from(number));
            let commit = Commit::new().expect(head.clone(), Expected::Absent);
            let commit = pieces::put(commit, &head, &record::encode(&numbered), None);
            match self.engine.commit(commit).await.map_err(conflict) {
                Ok(()) => return Ok(number),
                Err(Ok(_)) => {}
                Err(Err(error)) => return Err(error.into()),
            }
        }
        Err(StoreError::Changed { what: "calibrations of sensor", id: sensor })
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
        Ok(self.all(sensor)?.pop())
    }

    /// All calibrations of a sensor, oldest first.
    ///
    /// # Errors
    /// As [`Calibrations::find`].
    pub fn all(&self, sensor: Uuid) -> Result<Vec<StoredCalibration>, StoreError> {
        let prefix = key::id(Space::Calibration, sensor);
        let space = Space::Calibration;
        let records = pieces::scan(
            &*self.engine,
            space,
            &prefix,
            KEY_BYTES,
            None,
            Limit::records(usize::MAX),
        )?;
        let decoded: Result<Vec<_>, _> =
            records.iter().map(|(_, bytes)| record::decode(bytes)).collect();
        decoded.map_err(StoreError::damaged(space))
    }
}
