//! The calibrations of sensors: fitted, stored, and found again for every stored reading.
//!
//! A calibration applies to readings that come after it. A stored reading names its number,
//! so it is understood the same way for ever. They never change, so they are kept in memory.

use std::sync::Arc;

use dashmap::DashMap;
use palpate_core::sensor::Calibration;
use palpate_schemas as wire;
use palpate_store::calibration::StoredCalibration;
use palpate_store::database::Database;
use palpate_store::entity::Sensor;
use palpate_store::error::StoreError;
use uuid::Uuid;

use crate::clock::now_ms;
use crate::compute::Pool;
use crate::refusal::Refusal;
use crate::wire::calibration as convert;

/// All calibrations.
pub(crate) struct Calibrations {
    store: Database,
    known: DashMap<(Uuid, u32), Arc<Calibration>>,
    /// Each sensor's newest number; 0 when it has none.
    newest: DashMap<Uuid, u32>,
}

/// A calibration and its number.
#[derive(Clone, Debug)]
pub(crate) struct Applied {
    pub(crate) number: u32,
    pub(crate) calibration: Arc<Calibration>,
}

impl Calibrations {
    pub(crate) fn new(store: Database) -> Self {
        Self { store, known: DashMap::new(), newest: DashMap::new() }
    }

    /// The calibration that applies to readings of a sensor that come now.
    pub(crate) fn newest(&self, sensor: Uuid) -> Result<Option<Applied>, Refusal> {
        let known = self.newest.get(&sensor).map(|number| *number);
        let number = match known {
            Some(number) => number,
            None => {
                let latest = self.store.calibrations().latest(sensor)?;
                let number = latest.map_or(0, |latest| latest.number);
                // Whoever added one in the meantime knows better.
                *self.newest.entry(sensor).or_insert(number)
            }
        };
        Ok(self.of(sensor, number)?.map(|calibration| Applied { number, calibration }))
    }

    /// The calibration of a number that a stored reading names; 0 is none.
    pub(crate) fn of(
        &self,
        sensor: Uuid,
        number: u32,
    ) -> Result<Option<Arc<Calibration>>, Refusal> {
        if number == 0 {
            return Ok(None);
        }
        if let Some(known) = self.known.get(&(sensor, number)) {
            return Ok(Some(Arc::clone(&known)));
        }
        let stored = self.store.calibrations().find(sensor, number)?;
        let stored = stored.ok_or_else(|| Refusal::Unusable {
            what: "a reading of sensor",
            id: sensor.to_string(),
            reason: format!("calibration {number} is missing"),
        })?;
        let calibration = Arc::new(stored.calibration);
        self.known.insert((sensor, number), Arc::clone(&calibration));
        Ok(Some(calibration))
    }

    /// Fits a calibration to indentations on the compute pool, and stores it.
    pub(crate) async fn calibrate(
        &self,
        sensor: &Arc<Sensor>,
        request: wire::CalibrateSensor,
        pool: &Pool,
    ) -> Result<wire::SensorCalibration, Refusal> {
        let (place, fitted) = (pool.place()?, Arc::clone(sensor));
        let now = now_ms();
        let fit = place.run_long(move || convert::fitted(&request, &fitted, now)).await??;
        let number = self.store.calibrations().add(&fit).await?;
        let newest = self.newest.entry(sensor.id);
        newest.and_modify(|newest| *newest = number.max(*newest)).or_insert(number);
        let (id, name) = (sensor.id, &sensor.name);
        tracing::info!(sensor.id = %id, calibration = number, "Calibrated sensor {name:?}");
        Ok(convert::calibration(&StoredCalibration { number, ..fit }, &sensor.description))
    }

    /// A calibration as the wire shows it, the newest if no number is asked for.
    pub(crate) fn show(
        &self,
        sensor: &Sensor,
        query: wire::CalibrationQuery,
    ) -> Result<wire::SensorCalibration, Refusal> {
        let table = self.store.calibrations();
        let found: Result<Option<StoredCalibration>, StoreError> = match query.number {
            Some(number) => table.find(sensor.id, number),
            None => table.latest(sensor.id),
        };
        let number = query.number.map(|number| format!(" {number}")).unwrap_or_default();
        let stored = found?.ok_or_else(|| Refusal::NotFound {
            what: "calibration of sensor",
            reference: format!("{}{number}", sensor.name),
        })?;
        Ok(convert::calibration(&stored, &sensor.description))
    }
}
