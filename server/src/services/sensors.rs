//! The sensors of readings. They are immutable but for their labels, and are cached from their first
//! use until their labels change or they are removed.

mod packages;
mod removal;

use std::sync::Arc;

use dashmap::DashSet;
use palpate_core::sensor::{Preset, SensorKnowledge};
use palpate_schemas as wire;
use palpate_store::database::Database;
use palpate_store::entity::Sensor;
use palpate_store::error::StoreError;
use uuid::Uuid;

use crate::cause::Cause;
use crate::clock::now_ms;
use crate::known_sensors::KnownSensors;
use crate::services::calibrations::Calibrations;
use crate::services::sensor_health::SensorHealth;
use crate::wire::reading::{Given, Source};
use crate::wire::{cursor, labels, page_id, page_length, reading, sensor};

/// All sensors.
pub(crate) struct Sensors {
    store: Database,
    known: Arc<KnownSensors>,
    calibrations: Calibrations,
    health: SensorHealth,
    /// Sensors under removal, which accept no readings.
    closed: DashSet<Uuid>,
    /// Read-locked while readings are being stored.
    using: Arc<tokio::sync::RwLock<()>>,
}

impl Sensors {
    pub(crate) fn new(store: Database) -> Self {
        let known = Arc::new(KnownSensors::new(store.clone()));
        let calibrations = Calibrations::new(store.clone(), Arc::clone(&known));
        let health = SensorHealth::new(store.clone(), Arc::clone(&known));
        Self { store, known, calibrations, health, closed: DashSet::new(), using: Arc::default() }
    }

    /// The calibrations of sensors.
    pub(crate) fn calibrations(&self) -> &Calibrations {
        &self.calibrations
    }

    /// The health of sensors.
    pub(crate) fn health(&self) -> &SensorHealth {
        &self.health
    }

    /// Adds a sensor for every preset, under the preset's name, unless the name is in use.
    pub(crate) async fn add_presets(&self) -> Result<(), StoreError> {
        for name in Preset::NAMES {
            let Some(Preset { description, ranges }) = Preset::named(name) else {
                continue;
            };
            let sensor = Sensor {
                id: Uuid::now_v7(),
                name: name.to_owned(),
                preset: Some(name.to_owned()),
                description,
                knowledge: SensorKnowledge::default(),
                ranges,
                labels: wire::Labels::new(),
                used: false,
                created_at_ms: now_ms(),
            };
            match self.store.sensors().create(&sensor).await {
                Ok(()) | Err(StoreError::NameTaken { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// The sensors and calibrations in memory.
    pub(crate) fn known(&self) -> &Arc<KnownSensors> {
        &self.known
    }

    /// The sensor with an id or a name.
    pub(crate) fn get(&self, reference: &str) -> Result<Arc<Sensor>, Cause> {
        Ok(self.known.get(reference)?)
    }

    /// The sensors named by the readings of a request, unless unknown or under removal.
    pub(crate) fn sources(&self, given: &[Given<'_>]) -> Result<Vec<Option<Source>>, Cause> {
        given.iter().map(|(_, reading)| self.source(&reading.sensor)).collect()
    }

    /// The sensor with an id or a name, unless it is about to be removed.
    pub(crate) fn find_to_use(&self, reference: &str) -> Result<Option<Arc<Sensor>>, StoreError> {
        Ok(self.known.find(reference)?.filter(|sensor| !self.closed.contains(&sensor.id)))
    }

    pub(crate) fn source(&self, reference: &str) -> Result<Option<Source>, Cause> {
        let usable = self.find_to_use(reference)?;
        Ok(usable.map(|sensor| self.known.source(sensor)).transpose()?)
    }

    pub(crate) async fn create(&self, request: &wire::CreateSensor) -> Result<Sensor, Cause> {
        let sensor = sensor::new_sensor(request, Uuid::now_v7(), now_ms())?;
        self.store.sensors().create(&sensor).await?;
        tracing::info!(sensor.id = %sensor.id, "Created sensor {:?}", sensor.name);
        Ok(sensor)
    }

    /// The interpretation of a sensor's reading; nothing is stored.
    pub(crate) fn check(
        &self,
        reference: &str,
        given: &wire::Reading,
    ) -> Result<wire::ReadingCheck, Cause> {
        let expected = self.get(reference)?;
        let incoming =
            reading::one("", given, self.source(&given.sensor)?, given.frame_id.as_deref())?;
        if incoming.sensor.id != expected.id {
            let detail = format!("came {:?}, expected {reference:?} as in the path", given.sensor);
            return Err(Cause::field("/sensor", detail));
        }
        let applied = self.known.newest(expected.id)?;
        let pose = incoming.pose();
        let description = &incoming.sensor.description;
        let Some(press) = incoming.reading.press() else {
            let detail = "came without an image, expected one: there is nothing to interpret";
            return Err(Cause::field("/contact", detail));
        };
        Ok(sensor::check(press, pose, description, applied.as_ref()))
    }

    /// Replaces a sensor's labels.
    pub(crate) async fn label(
        &self,
        reference: &str,
        request: wire::SetLabels,
    ) -> Result<Sensor, Cause> {
        let id = self.get(reference)?.id;
        labels::checked(&request.labels)?;
        let table = self.store.sensors();
        let updated = table.update(id, |now| {
            now.labels = request.labels.clone();
            Ok::<(), StoreError>(())
        });
        let sensor = updated.await??;
        self.known.forget(id);
        Ok(sensor)
    }

    /// Looks again at a sensor that another server changed.
    pub(crate) fn heard(&self, id: Uuid) -> Result<(), StoreError> {
        self.known.forget(id);
        if self.store.sensors().find(id)?.is_none() {
            self.health.forget(id);
        }
        Ok(())
    }

    /// Looks again at all sensors.
    pub(crate) fn heard_all(&self) {
        self.known.forget_all();
    }

    pub(crate) fn list(&self, query: wire::LabelledQuery) -> Result<wire::SensorPage, Cause> {
        let (page, wanted) = labels::page_and_wanted(query)?;
        let (after, limit) = (page_id(&page)?, page_length(&page)?);
        let fits = |sensor: &Sensor| wanted.fits(&sensor.labels);
        let page = self.store.sensors().list_fitting(after, limit, fits)?;
        let items: Result<_, _> = page.items.iter().map(|sensor| self.show(sensor)).collect();
        Ok(wire::SensorPage { items: items?, next_cursor: cursor(page.next) })
    }

    /// A sensor in its wire form.
    pub(crate) fn show(&self, sensor: &Sensor) -> Result<wire::Sensor, Cause> {
        let newest = self.known.newest(sensor.id)?;
        Ok(sensor::sensor(sensor, newest.as_ref()))
    }
}
