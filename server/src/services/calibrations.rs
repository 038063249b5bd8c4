//! The calibrations of sensors: fitted, stored, and found for every stored reading.
//!
//! A calibration applies to later readings. A stored reading names its number, so its meaning
//! never changes. Calibrations never change, so they are kept in memory.

use std::sync::Arc;

use palpate_schemas as wire;
use palpate_store::calibration::{Addition, StoredCalibration, StoredPassport};
use palpate_store::database::Database;
use palpate_store::entity::Sensor;
use palpate_store::error::StoreError;
use uuid::Uuid;

use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::Pool;
use crate::known_sensors::KnownSensors;
use crate::wire::calibration as convert;
use crate::wire::commissioning::stored_passport;

/// All calibrations.
pub(crate) struct Calibrations {
    store: Database,
    known: Arc<KnownSensors>,
}

impl Calibrations {
    pub(crate) fn new(store: Database, known: Arc<KnownSensors>) -> Self {
        Self { store, known }
    }

    /// Fits a calibration to indentations on the compute pool, and stores it.
    pub(crate) async fn calibrate(
        &self,
        sensor: &Arc<Sensor>,
        request: wire::CalibrateSensor,
        pool: &Pool,
    ) -> Result<wire::SensorCalibration, Cause> {
        let (place, fitted) = (pool.place()?, Arc::clone(sensor));
        let now = now_ms();
        let fit = place.run_long(move || convert::fitted(&request, &fitted, now)).await??;
        let stored = self.add(sensor.id, &Addition::Lines(fit)).await?;
        let (id, name, number) = (sensor.id, &sensor.name, stored.number);
        tracing::info!(sensor.id = %id, calibration = number, "Calibrated sensor {name:?}");
        convert::calibration(&stored, &sensor.description).ok_or_else(|| no_lines(sensor))
    }

    /// Stores a passport, which corrects later readings; the number of its calibration.
    pub(crate) async fn apply(
        &self,
        sensor: &Sensor,
        passport: StoredPassport,
    ) -> Result<u32, Cause> {
        let number = self.add(sensor.id, &Addition::Passport(passport)).await?.number;
        let (id, name) = (sensor.id, &sensor.name);
        tracing::info!(sensor.id = %id, calibration = number, "Commissioned sensor {name:?}");
        Ok(number)
    }

    async fn add(&self, sensor: Uuid, addition: &Addition) -> Result<StoredCalibration, Cause> {
        let stored = self.store.calibrations().add(sensor, addition).await?;
        self.known.added(sensor, stored.number);
        Ok(stored)
    }

    /// A calibration in its wire form, the newest without a number.
    pub(crate) fn show(
        &self,
        sensor: &Sensor,
        query: wire::CalibrationQuery,
    ) -> Result<wire::SensorCalibration, Cause> {
        let stored = self.find(sensor, query)?;
        convert::calibration(&stored, &sensor.description).ok_or_else(|| no_lines(sensor))
    }

    /// The passport that a calibration has, the newest calibration's without a number.
    pub(crate) fn passport(
        &self,
        sensor: &Sensor,
        query: wire::CalibrationQuery,
    ) -> Result<wire::SensorPassport, Cause> {
        let stored = self.find(sensor, query)?.passport;
        let stored = stored.ok_or_else(|| Cause::unknown("passport of sensor", &sensor.name))?;
        Ok(stored_passport(&stored, sensor))
    }

    fn find(
        &self,
        sensor: &Sensor,
        query: wire::CalibrationQuery,
    ) -> Result<StoredCalibration, Cause> {
        let table = self.store.calibrations();
        let found: Result<Option<StoredCalibration>, StoreError> = match query.number {
            Some(number) => table.find(sensor.id, number),
            None => table.latest(sensor.id),
        };
        let number = query.number.map(|number| format!(" {number}")).unwrap_or_default();
        found?.ok_or_else(|| {
            Cause::unknown("calibration of sensor", format!("{}{number}", sensor.name))
        })
    }
}

/// The refusal of a calibration that is a passport alone.
fn no_lines(sensor: &Sensor) -> Cause {
    Cause::unknown("taxel lines of sensor", &sensor.name)
}
