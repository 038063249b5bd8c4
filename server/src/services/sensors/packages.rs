//! Sensors as packages: what a cell fetches from the central service, and how it takes that over.
//!
//! Sensors are the same when their names are: each server gives them ids of its own.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use palpate_schemas as wire;
use palpate_store::calibration::{StoredCalibration, StoredPassport};
use palpate_store::entity::Sensor;
use palpate_store::journal::Limit;
use palpate_store::record::{self, Record};

use super::Sensors;
use crate::cause::Cause;
use crate::wire::{PAGE_BYTES, page_length, page_number};

impl Sensors {
    /// A sensor with a page of its calibrations as a package. Blocks.
    pub(crate) fn package(
        &self,
        reference: &str,
        query: &wire::PageQuery,
    ) -> Result<wire::SensorPackage, Cause> {
        let sensor = self.get(reference)?;
        let first = page_number(query)?;
        let behind = u32::try_from(first).unwrap_or(u32::MAX);
        let limit = Limit { records: page_length(query)?, bytes: PAGE_BYTES };
        let calibrations = self.store.calibrations().page(sensor.id, behind, limit)?;
        let last = calibrations.last().map_or(behind, |last| last.number);
        let more = self.store.calibrations().find(sensor.id, last.saturating_add(1))?.is_some();
        Ok(wire::SensorPackage {
            name: sensor.name.clone(),
            record: STANDARD.encode(record::encode(&*sensor)),
            first: behind,
            next_cursor: more.then(|| last.to_string()),
            calibrations: calibrations
                .iter()
                .map(|it| STANDARD.encode(record::encode(it)))
                .collect(),
        })
    }

    /// Takes a sensor over with those calibrations of a page that are missing here; how the two
    /// differ, if they do.
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
        let (calibrations, length) = (self.store.calibrations(), package.calibrations.len());
        let limit = Limit { records: length, bytes: usize::MAX };
        let own = calibrations.page(id, package.first, limit)?;
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
                    calibrations.adopt(&there).await?;
                    self.known.added(id, there.number);
                    let (name, number) = (&package.name, there.number);
                    tracing::info!("Calibration {number} of sensor {name:?} came as well");
                }
            }
        }
        if package.next_cursor.is_some() {
            return Ok(None);
        }
        let n_there = package.first as usize + length;
        let n_here = calibrations.latest(id)?.map_or(0, |latest| latest.number as usize);
        let n_more = n_here.saturating_sub(n_there);
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
