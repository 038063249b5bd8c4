//! Cache of sensors and calibrations, by the names and numbers in stored readings.
//!
//! Calibrations never change, nor do sensors but for their labels, so both stay cached, a sensor
//! until its labels change or it is removed.

use std::sync::Arc;

use dashmap::DashMap;
use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::sensor::{Correction, Passport, SensorError, SensorKnowledge};
use palpate_store::calibration::StoredCalibration;
use palpate_store::database::Database;
use palpate_store::entity::{Sensor, StoredReading};
use palpate_store::error::StoreError;
use palpate_store::journal::{Entry, Event};
use thiserror::Error;
use uuid::Uuid;

use crate::wire::reading::{Applied, Source};

/// The sensors in use, and their calibrations.
pub(crate) struct KnownSensors {
    store: Database,
    sensors: DashMap<String, Arc<Sensor>>,
    calibrations: DashMap<(Uuid, u32), Applied>,
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
    #[error("calibration {number} has a passport of no possible sensor: {source}")]
    World { number: u32, source: SensorError },
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

    /// Drops a sensor that was removed or has other labels.
    pub(crate) fn forget(&self, sensor: Uuid) {
        self.sensors.retain(|_, known| known.id != sensor);
    }

    /// Drops all sensors and the numbers of their newest calibrations.
    pub(crate) fn forget_all(&self) {
        self.sensors.clear();
        self.newest.clear();
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
        self.applied(sensor, number)
    }

    /// The sensor as its newest passport measured it; without one as described.
    pub(crate) fn interpreted(&self, sensor: Arc<Sensor>) -> Result<Arc<Sensor>, UnknownSensor> {
        let newest = self.newest(sensor.id)?;
        Ok(newest.map_or(sensor, |applied| applied.sensor))
    }

    /// The correction of a stored reading, by the calibration that it names.
    pub(crate) fn correction(
        &self,
        reading: &StoredReading,
    ) -> Result<Option<Arc<Correction>>, UnknownSensor> {
        let applied = self.applied(reading.sensor, reading.calibration)?;
        Ok(applied.map(|applied| applied.correction))
    }

    /// The pose of a stored reading's sensor after its correction, if it has one.
    pub(crate) fn pose(&self, reading: &StoredReading) -> Result<Option<Pose>, UnknownSensor> {
        let Some(sent) = reading.session_from_sensor else { return Ok(None) };
        let correction = self.correction(reading)?;
        Ok(Some(correction.map_or(sent, |correction| correction.pose(sent))))
    }

    /// The place of an entry (m); `None` if it is not a reading or has none.
    pub(crate) fn place_of(&self, entry: &Entry) -> Result<Option<DVec3>, UnknownSensor> {
        let Event::Reading(reading) = &entry.event else { return Ok(None) };
        let pose = self.pose(reading)?.map(|pose| pose.translation);
        Ok(pose.or(reading.contact.map(|contact| DVec3::from_array(contact.position))))
    }

    /// The calibration with a number; 0 is none.
    pub(crate) fn applied(
        &self,
        sensor: Uuid,
        number: u32,
    ) -> Result<Option<Applied>, UnknownSensor> {
        if number == 0 {
            return Ok(None);
        }
        if let Some(known) = self.calibrations.get(&(sensor, number)) {
            return Ok(Some(known.clone()));
        }
        let stored = self.store.calibrations().find(sensor, number)?;
        let stored = stored.ok_or(UnknownSensor::Calibration { sensor, number })?;
        let applied = applied(&stored, self.get(&sensor.to_string())?)?;
        self.calibrations.insert((sensor, number), applied.clone());
        Ok(Some(applied))
    }

    /// Registers the number of a new calibration.
    pub(crate) fn added(&self, sensor: Uuid, number: u32) {
        let newest = self.newest.entry(sensor);
        newest.and_modify(|newest| *newest = number.max(*newest)).or_insert(number);
    }
}

fn applied(stored: &StoredCalibration, sensor: Arc<Sensor>) -> Result<Applied, UnknownSensor> {
    let number = stored.number;
    let world = stored.passport.as_ref().map(|stored| measured(&stored.passport, &sensor));
    let world = world.transpose().map_err(|source| UnknownSensor::World { number, source })?;
    Ok(Applied {
        number,
        passport: stored.passport.as_ref().map(|passport| passport.since),
        correction: Arc::new(stored.correction()),
        sensor: world.map_or(sensor, Arc::new),
    })
}

/// A sensor as its passport measured it, with the ranges that this leaves open.
fn measured(passport: &Passport, sensor: &Sensor) -> Result<Sensor, SensorError> {
    Ok(Sensor {
        description: passport.description(&sensor.description)?,
        knowledge: SensorKnowledge::DataSheet,
        ranges: passport.ranges(&sensor.description),
        ..sensor.clone()
    })
}
