//! Cache of sensors and calibrations, by the names and numbers in stored readings.
//!
//! Calibrations never change and sensors are immutable, so both stay cached, a sensor until
//! its removal.

use std::sync::Arc;

use dashmap::DashMap;
use palpate_core::sensor::Calibration;
use palpate_store::database::Database;
use palpate_store::entity::Sensor;
use palpate_store::error::StoreError;
use thiserror::Error;
use uuid::Uuid;

use crate::wire::reading::{Applied, Source};

/// The sensors in use, and their calibrations.
pub(crate) struct KnownSensors {
    store: Database,
    sensors: DashMap<String, Arc<Sensor>>,
    calibrations: DashMap<(Uuid, u32), Arc<Calibration>>,
    /// The number of each sensor's newest calibration; 0 when it has none.
    newest: DashMap<Uuid, u32>,
}

/// A sensor or calibration of a stored reading does not exist.
#[derive(Debug, Error)]
pub(crate) enum UnknownSensor {
    #[error("there is no sensor {reference:?}")]
    Sensor { reference: String },
    #[error("calibration {number} of sensor {sensor} is missing")]
    Calibration { sensor: Uuid, number: u32 },
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl KnownSensors {
    pub(crate) fn new(store: Database) -> Self {
        let (sensors, calibrations) = (DashMap::new(), DashMap::new());
        Self { store, sensors, calibrations, newest: DashMap::new() }
    }

    /// The sensor with an id or a name, if any.
    pub(crate) fn find(&self, reference: &str) -> Result<Option<Arc<Sensor>>, StoreError> {
        let id = Uuid::parse_str(reference).ok();
        let key = id.map_or_else(|| reference.to_owned(), |id| id.to_string());
        if let Some(known) = self.sensors.get(&key) {
            return Ok(Some(Arc::clone(&known)));
        }
        let table = self.store.sensors();
        let found = match id {
            Some(id) => table.find(id)?,
            None => table.find_by_name(reference)?,
        };
        let found = found.map(Arc::new);
        if let Some(sensor) = &found {
            self.sensors.insert(key, Arc::clone(sensor));
        }
        Ok(found)
    }

    /// The sensor with an id or a name.
    pub(crate) fn get(&self, reference: &str) -> Result<Arc<Sensor>, UnknownSensor> {
        let unknown = || UnknownSensor::Sensor { reference: reference.to_owned() };
        self.find(reference)?.ok_or_else(unknown)
    }

    /// Drops a removed sensor.
    pub(crate) fn forget(&self, sensor: Uuid) {
        self.sensors.retain(|_, known| known.id != sensor);
    }

    /// The sensor of new readings, with its present calibration.
    pub(crate) fn source(&self, sensor: Arc<Sensor>) -> Result<Source, UnknownSensor> {
        let applied = self.newest(sensor.id)?;
        Ok(Source { sensor, applied })
    }

    /// The calibration for new readings of a sensor.
    pub(crate) fn newest(&self, sensor: Uuid) -> Result<Option<Applied>, UnknownSensor> {
        let known = self.newest.get(&sensor).map(|number| *number);
        let number = match known {
            Some(number) => number,
            None => {
                let latest = self.store.calibrations().latest(sensor)?;
                let number = latest.map_or(0, |latest| latest.number);
                // A calibration added in the meantime is newer.
                *self.newest.entry(sensor).or_insert(number)
            }
        };
        Ok(self.calibration(sensor, number)?.map(|calibration| Applied { number, calibration }))
    }

    /// The calibration with the number in a stored reading; 0 is none.
    pub(crate) fn calibration(
        &self,
        sensor: Uuid,
        number: u32,
    ) -> Result<Option<Arc<Calibration>>, UnknownSensor> {
        if number == 0 {
            return Ok(None);
        }
        if let Some(known) = self.calibrations.get(&(sensor, number)) {
            return Ok(Some(Arc::clone(&known)));
        }
        let stored = self.store.calibrations().find(sensor, number)?;
        let stored = stored.ok_or(UnknownSensor::Calibration { sensor, number })?;
        let calibration = Arc::new(stored.calibration);
        self.calibrations.insert((sensor, number), Arc::clone(&calibration));
        Ok(Some(calibration))
    }

    /// Registers the number of a new calibration.
    pub(crate) fn added(&self, sensor: Uuid, number: u32) {
        let newest = self.newest.entry(sensor);
        newest.and_modify(|newest| *newest = number.max(*newest)).or_insert(number);
    }
}
