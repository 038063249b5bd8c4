//! Sensors as packages: what a cell fetches from the central service, and how it takes that over.
//!
//! Sensors are the same when their names are: each server gives them ids of its own.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use palpate_schemas as wire;
use palpate_store::calibration::{StoredCalibration, StoredPassport};
use palpate_store::entity::Sensor;
use palpate_store::record::{self, Record};

use super::Sensors;
use crate::cause::Cause;

impl Sensors {
    /// A sensor with its calibrations as a package.
    pub(crate) fn package(&self, reference: &str) -> Result<wire::SensorPackage, Cause> {
        let sensor = self.get(reference)?;
        let calibrations = self.store.calibrations().all(sensor.id)?;
        Ok(wire::SensorPackage {
            name: sensor.name.clone(),
            record: STANDARD.encode(record::encode(&*sensor)),
            calibrations: calibrations
                .iter()
                .map(|it| STANDARD.encode(record::encode(it)))
                .collect(),
        })
    }

    /// Takes a sensor over with the calibrations that are missing here; how the two differ, if
    /// they do.
    pub(crate) async fn adopt(
        &self,
        package: &wire::SensorPackage,
    ) -> Result<Option<String>, Cause> {
        let there: Sensor = decoded("/record", &package.record)?;
        let known = self.known.find(&package.name)?;
        let id = known.as_ref().map_or(there.id, |known| known.id);
        let here = match known {
            Some(here) => here.as_ref().clone(),
            None => {
                self.store.sensors().create(&there).await?;
                tracing::info!("Sensor {:?} came from the central service", package.name);
                there.clone()
            }
        };
        let is_same = |a: &Sensor, b: &Sensor| {
            a.description == b.description && a.knowledge == b.knowledge && a.ranges == b.ranges
        };
        if !is_same(&here, &there) {
            return Ok(Some("its description differs from the central service's".to_owned()));
        }
        let own = self.store.calibrations().all(id)?;
        for (index, record) in package.calibrations.iter().enumerate() {
            let there: StoredCalibration = decoded("/calibrations", record)?;
            let there = StoredCalibration { sensor: id, ..there };
            match own.get(index) {
                Some(here) if is_same_calibration(here, &there) => {}
                Some(here) => {
                    let number = here.number;
                    return Ok(Some(format!(
                        "its calibration {number} differs from the central service's"
                    )));
                }
                None => {
                    self.store.calibrations().adopt(&there).await?;
                    self.known.added(id, there.number);
                    let (name, number) = (&package.name, there.number);
                    tracing::info!("Calibration {number} of sensor {name:?} came as well");
                }
            }
        }
        let n_more = own.len().saturating_sub(package.calibrations.len());
        let more = format!("it has {n_more} calibrations that the central service does not have");
        Ok((n_more > 0).then_some(more))
    }
}

/// Whether two calibrations correct readings alike.
fn is_same_calibration(here: &StoredCalibration, there: &StoredCalibration) -> bool {
    let passport = |stored: &StoredCalibration| {
        stored.passport.as_ref().map(|StoredPassport { passport, .. }| passport.clone())
    };
    let lines =
        |stored: &StoredCalibration| stored.lines.as_ref().map(|lines| lines.calibration.clone());
    passport(here) == passport(there) && lines(here) == lines(there)
}

fn decoded<T: Record>(pointer: &str, text: &str) -> Result<T, Cause> {
    let bytes = STANDARD.decode(text).map_err(|error| Cause::field(pointer, error))?;
    record::decode(&bytes).map_err(|error| Cause::field(pointer, error))
}
