//! The sensors that robots may send readings of. They never change, so they are kept in
//! memory once they were asked for, until they are removed.

mod removal;

use std::sync::Arc;

use dashmap::{DashMap, DashSet};
use palpate_core::sensor::SensorDescription;
use palpate_schemas as wire;
use palpate_store::database::Database;
use palpate_store::entity::Sensor;
use palpate_store::error::StoreError;
use uuid::Uuid;

use crate::services::calibrations::Calibrations;
use crate::clock::now_ms;
use crate::refusal::Refusal;
use crate::wire::{cursor, page_id, page_length, reading, sensor};

/// All sensors.
pub(crate) struct Sensors {
    store: Database,
    known: DashMap<String, Arc<Sensor>>,
    calibrations: Calibrations,
    /// Sensors that are about to be removed: no reading of them comes in.
    closed: DashSet<Uuid>,
    /// Held for reading while readings are on their way into the store.
    using: Arc<tokio::sync::RwLock<()>>,
}

impl Sensors {
    pub(crate) fn new(store: Database) -> Self {
        let calibrations = Calibrations::new(store.clone());
        Self {
            store,
            known: DashMap::new(),
            calibrations,
            closed: DashSet::new(),
            using: Arc::default(),
        }
    }

    /// What is known of how they respond.
    pub(crate) fn calibrations(&self) -> &Calibrations {
        &self.calibrations
    }

    /// Makes a sensor of every preset, under the preset's name, unless the name is taken.
    pub(crate) async fn add_presets(&self) -> Result<(), StoreError> {
        for name in SensorDescription::PRESET_NAMES {
            let Some(description) = SensorDescription::preset_named(name) else { continue };
            let sensor = Sensor {
                id: Uuid::now_v7(),
                name: name.to_owned(),
                preset: Some(name.to_owned()),
                description,
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

    /// The sensor of an id or a name, if there is one.
    pub(crate) fn find(&self, reference: &str) -> Result<Option<Arc<Sensor>>, StoreError> {
        let id = Uuid::parse_str(reference).ok();
        let key = id.map_or_else(|| reference.to_owned(), |id| id.to_string());
        if let Some(known) = self.known.get(&key) {
            return Ok(Some(Arc::clone(&known)));
        }
        let table = self.store.sensors();
        let found = match id {
            Some(id) => table.find(id)?,
            None => table.find_by_name(reference)?,
        };
        let found = found.map(Arc::new);
        if let Some(sensor) = &found {
            self.known.insert(key, Arc::clone(sensor));
        }
        Ok(found)
    }

    /// As [`Sensors::find`], without sensors that are about to be removed.
    pub(crate) fn find_to_use(&self, reference: &str) -> Result<Option<Arc<Sensor>>, StoreError> {
        Ok(self.find(reference)?.filter(|sensor| !self.closed.contains(&sensor.id)))
    }

    /// The sensor of an id or a name.
    pub(crate) fn get(&self, reference: &str) -> Result<Arc<Sensor>, Refusal> {
        self.find(reference)?
            .ok_or_else(|| Refusal::NotFound { what: "sensor", reference: reference.to_owned() })
    }

    pub(crate) async fn create(&self, request: &wire::CreateSensor) -> Result<Sensor, Refusal> {
        let sensor = sensor::new_sensor(request, Uuid::now_v7(), now_ms())?;
        self.store.sensors().create(&sensor).await?;
        tracing::info!(sensor.id = %sensor.id, "Created sensor {:?}", sensor.name);
        Ok(sensor)
    }

    /// How a reading of a sensor is understood; nothing is stored.
    pub(crate) fn check(
        &self,
        reference: &str,
        given: &wire::Reading,
    ) -> Result<wire::ReadingCheck, Refusal> {
        let expected = self.get(reference)?;
        let incoming = reading::one("", given, self, given.frame_id.as_deref())?;
        if incoming.sensor.id != expected.id {
            let detail = format!("came {:?}, expected {reference:?} as in the path", given.sensor);
            return Err(Refusal::field("/sensor", detail));
        }
        let applied = self.calibrations.newest(expected.id)?;
        let pose = incoming.stored.session_from_sensor;
        let description = &expected.description;
        Ok(sensor::check(&incoming.reading, pose, description, applied.as_ref()))
    }

    pub(crate) fn list(&self, query: &wire::PageQuery) -> Result<wire::SensorPage, Refusal> {
        let page = self.store.sensors().list_whole(page_id(query)?, page_length(query)?)?;
        let items: Result<_, _> = page.items.iter().map(|sensor| self.show(sensor)).collect();
        Ok(wire::SensorPage { items: items?, next_cursor: cursor(page.next) })
    }

    /// A sensor for the wire.
    pub(crate) fn show(&self, sensor: &Sensor) -> Result<wire::Sensor, Refusal> {
        let newest = self.calibrations.newest(sensor.id)?;
        Ok(sensor::sensor(sensor, newest.map(|newest| newest.number)))
    }
}
