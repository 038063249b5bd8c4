//! The calibrations of sensors: fitted, stored, and found for every stored reading.
//!
//! A calibration applies to later readings. A stored reading names its number, so its meaning
//! never changes. Calibrations never change, so they are kept in memory.

use std::sync::Arc;

use palpate_schemas as wire;
use palpate_store::calibration::StoredCalibration;
use palpate_store::database::Database;
use palpate_store::entity::Sensor;
use palpate_store::error::StoreError;

use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::Pool;
use crate::known_sensors::KnownSensors;
use crate::wire::calibration as convert;

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
        let number = self.store.calibrations().add(&fit).await?;
        self.known.added(sensor.id, number);
        let (id, name) = (sensor.id, &sensor.name);
        tracing::info!(sensor.id = %id, calibration = number, "Calibrated sensor {name:?}");
        Ok(convert::calibration(&StoredCalibration { number, ..fit }, &sensor.description))
    }

    /// A calibration in its wire form, the newest without a number.
    pub(crate) fn show(
        &self,
        sensor: &Sensor,
        query: wire::CalibrationQuery,
    ) -> Result<wire::SensorCalibration, Cause> {
        let table = self.store.calibrations();
        let found: Result<Option<StoredCalibration>, StoreError> = match query.number {
            Some(number) => table.find(sensor.id, number),
            None => table.latest(sensor.id),
        };
        let number = query.number.map(|number| format!(" {number}")).unwrap_or_default();
        let stored = found?.ok_or_else(|| {
            Cause::unknown("calibration of sensor", format!("{}{number}", sensor.name))
        })?;
        Ok(convert::calibration(&stored, &sensor.description))
    }
}
