//! The objects to recognise: their names, meshes and training readings.
//!
//! Meshes and readings are stored as received; derived data is in catalogues. A catalogue's
//! version keeps the model of an object that is deleted later.

use std::collections::BTreeSet;
use std::sync::Arc;

use bytes::Bytes;
use palpate_schemas as wire;
use palpate_sim::mesh::{Mesh, MeshError, MeshFormat};
use palpate_store::database::Database;
use palpate_store::entity::{Object, StoredReading};
use palpate_store::error::StoreError;
use palpate_store::journal::{AppendError, Event, Limit, NewEntry};
use palpate_store::mesh::{MeshInfo, MeshReader};
use thiserror::Error;
use uuid::Uuid;

use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::{Pool, Size, Urgency};
use crate::config::Config;
use crate::services::keys::Keys;
use crate::services::sensors::Sensors;
use crate::services::thumbnails::Thumbnails;
use crate::wire::labels;
use crate::wire::object::{
    FormatError, mesh_report, read_format, stored_format, stored_unit, unit_metres,
};
use crate::wire::reading::{Incoming, READINGS_MAX};
use crate::wire::{self as convert, PAGE_BYTES, cursor, page_id, page_length, page_number};

/// Maximum length of a description, in characters.
const DESCRIPTION_MAX: usize = 2000;
/// Attempts of an append under concurrent appends.
const APPEND_ATTEMPTS: usize = 16;

/// All objects.
pub(crate) struct Objects {
    store: Database,
    sensors: Arc<Sensors>,
    pool: Pool,
    readings_max: usize,
    thumbnails: Arc<Thumbnails>,
}

/// Error of an object's change.
#[derive(Debug, Error)]
pub(crate) enum ObjectError {
    #[error("object {object:?} is being trained by job {job}: cancel the job first")]
    InTraining { object: String, job: Uuid },
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for ObjectError {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}

impl Objects {
    pub(crate) fn new(store: Database, sensors: Arc<Sensors>, pool: Pool, config: &Config) -> Self {
        let thumbnails = Arc::new(Thumbnails::new(config.data.join("thumbnails")));
        Self { store, sensors, pool, readings_max: config.object_readings_max, thumbnails }
    }

    /// The object with an id or a name.
    pub(crate) fn find(&self, reference: &str) -> Result<Object, Cause> {
        let table = self.store.objects();
        let found = match Uuid::parse_str(reference) {
            Ok(id) => table.find(id)?,
            Err(_) => table.find_by_name(reference)?,
        };
        found.ok_or_else(|| Cause::unknown("object", reference))
    }

    /// The object in its wire form.
    pub(crate) fn show(&self, object: &Object) -> Result<wire::ObjectInfo, StoreError> {
        let mesh = self.store.meshes().info(object.id)?;
        let n_readings = self.store.training().len(object.id)?;
        Ok(convert::object::object(object, mesh.as_ref(), n_readings))
    }

    pub(crate) fn list(&self, query: wire::LabelledQuery) -> Result<wire::ObjectPage, Cause> {
        let (page, wanted) = labels::page_and_wanted(query)?;
        let (after, limit) = (page_id(&page)?, page_length(&page)?);
        let fits = |object: &Object| wanted.fits(&object.labels);
        let page = self.store.objects().list_fitting(after, limit, fits)?;
        let items: Result<_, _> = page.items.iter().map(|object| self.show(object)).collect();
        Ok(wire::ObjectPage { items: items?, next_cursor: cursor(page.next) })
    }

    pub(crate) async fn create(&self, request: wire::CreateObject) -> Result<Object, Cause> {
        convert::name(&request.name)?;
        convert::text("/description", &request.description, DESCRIPTION_MAX)?;
        labels::checked(&request.labels)?;
        let now = now_ms();
        let object = Object {
            id: Uuid::now_v7(),
            name: request.name,
            description: request.description,
            labels: request.labels,
            revision: 1,
            created_at_ms: now,
            updated_at_ms: now,
        };
        self.store.objects().create(&object).await?;
        tracing::info!(object.id = %object.id, "Created object {:?}", object.name);
        Ok(object)
    }

    pub(crate) async fn update(
        &self,
        reference: &str,
        request: wire::UpdateObject,
    ) -> Result<Object, Cause> {
        let object = self.find(reference)?;
        request.name.as_deref().map(convert::name).transpose()?;
        let description = request.description.as_deref();
        description.map(|text| convert::text("/description", text, DESCRIPTION_MAX)).transpose()?;
        let table = self.store.objects();
        let updated = table.update(object.id, |now| {
            now.name = request.name.clone().unwrap_or_else(|| now.name.clone());
            now.description =
                request.description.clone().unwrap_or_else(|| now.description.clone());
            now.revision += 1;
            now.updated_at_ms = now_ms();
            Ok::<(), StoreError>(())
        });
        Ok(updated.await??)
    }

    /// Replaces an object's labels.
    pub(crate) async fn label(
        &self,
        reference: &str,
        request: wire::SetLabels,
    ) -> Result<Object, Cause> {
        let object = self.find(reference)?;
        labels::checked(&request.labels)?;
        let table = self.store.objects();
        let updated = table.update(object.id, |now| {
            now.labels = request.labels.clone();
            now.revision += 1;
            now.updated_at_ms = now_ms();
            Ok::<(), StoreError>(())
        });
        Ok(updated.await??)
    }

    /// Deletes an object with its mesh and readings, unless a training needs them.
    pub(crate) async fn delete(&self, reference: &str) -> Result<(), ObjectError> {
        let object = self.find(reference)?;
        for job in self.store.jobs().all()? {
            if !job.state.is_final() && job.request.contains(&object.id.to_string()) {
                return Err(ObjectError::InTraining { object: object.name, job: job.id });
            }
        }
        let mesh = self.store.meshes().info(object.id)?;
        self.store.essential().remove_object(object.id).await?;
        if let Some(mesh) = mesh {
            self.thumbnails.remove(mesh.upload);
        }
        tracing::info!(object.id = %object.id, "Deleted object {:?}", object.name);
        Ok(())
    }

    /// Reads a mesh and, if valid, makes it the object's.
    pub(crate) async fn put_mesh(
        &self,
        reference: &str,
        query: wire::MeshQuery,
        content_type: &str,
        file: Bytes,
    ) -> Result<wire::MeshReport, ObjectError> {
        let object = self.find(reference)?;
        let format = convert::object::mesh_format(content_type, query.format)?;
        let unit = query.unit.map(wire::MeshUnit::metres);
        let bytes = file.clone();
        let (upload, thumbnails) = (Uuid::now_v7(), Arc::clone(&self.thumbnails));
        let read = move || {
            let read = Mesh::read(format, &bytes, unit)?;
            thumbnails.make(upload, &read.mesh);
            Ok::<_, MeshError>(read)
        };
        let read = self.pool.place()?.run_as((Urgency::Long, Size::Heavy), read).await?.map_err(
            |error| {
                let field = match error {
                    MeshError::UnitMissing { .. } | MeshError::UnitContradicts { .. } => "?unit",
                    _ => "",
                };
                Cause::field(field, error)
            },
        )?;
        let (format, unit) = (stored_format(format), stored_unit(read.unit));
        let info = MeshInfo::new(upload, format, unit, &file, now_ms());
        let before = self.store.meshes().info(object.id)?;
        self.store.meshes().put(object.id, &info, &file).await?;
        if let Some(before) = before {
            self.thumbnails.remove(before.upload);
        }
        let n_triangles = read.mesh.triangles().len();
        tracing::info!(object.id = %object.id, n_triangles, "Stored a mesh of {:?}", object.name);
        Ok(mesh_report(&info, &read))
    }

    /// A reader of an object's uploaded mesh, block by block, and its format.
    pub(crate) async fn mesh(&self, reference: &str) -> Result<(MeshFormat, MeshReader), Cause> {
        let object = self.find(reference)?;
        let meshes = self.store.meshes();
        let found = self.pool.place()?.run_long(move || meshes.open(object.id)).await??;
        let reader = found.ok_or_else(|| Cause::unknown("mesh of object", object.name))?;
        Ok((read_format(reader.info().format), reader))
    }

    /// A small picture of an object's mesh, and the tag of the mesh; made again if it is missing.
    pub(crate) async fn thumbnail(&self, reference: &str) -> Result<(String, Vec<u8>), Cause> {
        let object = self.find(reference)?;
        let (meshes, thumbnails) = (self.store.meshes(), Arc::clone(&self.thumbnails));
        let find = move || -> Result<Option<(Uuid, Vec<u8>)>, Cause> {
            let Some(info) = meshes.info(object.id)? else { return Ok(None) };
            if let Some(png) = thumbnails.find(info.upload) {
                return Ok(Some((info.upload, png)));
            }
            let Some((info, file)) = meshes.get(object.id)? else { return Ok(None) };
            let mesh = Mesh::from_bytes(read_format(info.format), &file, unit_metres(info.unit));
            let mesh = mesh.map_err(|error| Cause::Unusable {
                what: "mesh of object",
                id: object.name.clone(),
                reason: error.to_string(),
            })?;
            Ok(Some((info.upload, thumbnails.make(info.upload, &mesh))))
        };
        let found = self.pool.place()?.run_as((Urgency::Long, Size::Heavy), find).await??;
        let (upload, png) = found.ok_or_else(|| Cause::unknown("mesh of object", reference))?;
        Ok((format!("\"{upload}\""), png))
    }

    /// Removes pictures of meshes that are no object's any more. Blocks.
    pub(crate) fn tidy_thumbnails(&self) {
        match self.uploads() {
            Ok(uploads) => self.thumbnails.tidy(|upload| uploads.contains(&upload)),
            Err(error) => tracing::warn!("Cannot look which pictures are needed: {error}"),
        }
    }

    /// The uploads of all objects' meshes.
    fn uploads(&self) -> Result<BTreeSet<Uuid>, StoreError> {
        let mut uploads = BTreeSet::new();
        for object in self.store.objects().all()? {
            uploads.extend(self.store.meshes().info(object.id)?.map(|info| info.upload));
        }
        Ok(uploads)
    }

    /// Stores training readings: all or none, without repetitions.
    pub(crate) async fn add_readings(
        &self,
        reference: &str,
        request: &wire::AddTrainingReadings,
    ) -> Result<wire::TrainingReadingsAdded, Cause> {
        let object = self.find(reference)?;
        let frame_id = convert::reading::shared_frame(&request.readings)?;
        let _using = self.sensors.using().await;
        let given = convert::reading::given(&request.readings);
        convert::reading::check_size("/readings", given.len(), &given)?;
        convert::felt::for_training(&request.readings)?;
        let sources = self.sensors.sources(&given)?;
        let readings = convert::reading::readings(&given, sources, frame_id)?;
        let journal = self.store.training();
        for _ in 0..APPEND_ATTEMPTS {
            let before = journal.len(object.id)?;
            self.check_like_first(&object, &readings)?;
            let entries = self.new_entries(&object, &readings)?;
            if before as usize + entries.len() > self.readings_max {
                return Err(Cause::ReadingsFull {
                    what: "object",
                    found: before,
                    more: entries.len(),
                    max: self.readings_max,
                });
            }
            match journal.append(object.id, before, &entries).await {
                Err(AppendError::Sequence { .. }) => {}
                other => {
                    other?;
                    let first = journal.entry(object.id, 0)?;
                    let known = self.sensors.known();
                    let place = first.map(|first| known.place_of(&first)).transpose()?.flatten();
                    return Ok(wire::TrainingReadingsAdded {
                        n_new: convert::count(entries.len()),
                        n_repeated: convert::count(readings.len() - entries.len()),
                        n_readings: convert::count(before + entries.len() as u64),
                        warnings: convert::reading::warnings(readings.iter(), place, None),
                    });
                }
            }
        }
        Err(AppendError::Sequence { expected: 0, found: 0 }.into())
    }

    /// Training readings in order of arrival.
    pub(crate) fn readings(
        &self,
        reference: &str,
        query: &wire::PageQuery,
        keys: &Keys,
    ) -> Result<wire::StoredReadingPage, Cause> {
        let object = self.find(reference)?;
        let (from, limit) = (page_number(query)?, page_length(query)?);
        let journal = self.store.training();
        let limit = Limit { records: limit.min(READINGS_MAX), bytes: PAGE_BYTES };
        let entries = journal.page(object.id, from, limit)?;
        let next = from + entries.len() as u64;
        let more = next < journal.len(object.id)? && !entries.is_empty();
        Ok(wire::StoredReadingPage {
            items: entries
                .iter()
                .filter_map(|it| convert::reading::stored(it, |key| keys.writer(key)))
                .collect(),
            next_cursor: more.then(|| next.to_string()),
        })
    }

    /// Refuses readings of another sensor than the object's first, since a map has one
    /// sensor, and features of another length.
    fn check_like_first(&self, object: &Object, readings: &[Incoming]) -> Result<(), Cause> {
        let first = match self.store.training().entry(object.id, 0)?.map(|entry| entry.event) {
            Some(Event::Reading(reading)) => reading,
            _ => readings[0].stored.clone(),
        };
        let length = |reading: &StoredReading| reading.feature.as_ref().map_or(0, Vec::len);
        let is_other = |r: &Incoming| length(&r.stored) != length(&first);
        if let Some(index) = readings.iter().position(is_other) {
            let (found, expected) = (length(&readings[index].stored), length(&first));
            let detail = format!(
                "{found} values came, expected {expected} as in the object's first reading"
            );
            return Err(Cause::field(format!("/readings/{index}/feature"), detail));
        }
        let Some(index) = readings.iter().position(|r| r.sensor.id != first.sensor) else {
            return Ok(());
        };
        let found = &readings[index].sensor.name;
        let expected = self.sensors.get(&first.sensor.to_string())?;
        let detail = format!(
            "came {found:?}, expected {:?} as in the object's first reading",
            expected.name
        );
        Err(Cause::field(format!("/readings/{index}/sensor"), detail))
    }

    /// The entries of the readings that are not stored yet.
    fn new_entries(&self, object: &Object, readings: &[Incoming]) -> Result<Vec<NewEntry>, Cause> {
        let (journal, key) = (self.store.training(), Asker::current().key());
        let stored =
            |id: &palpate_store::entity::ReadingId| -> Result<Option<StoredReading>, Cause> {
                let Some(seq) = journal.find(object.id, id, key)? else { return Ok(None) };
                let entry = journal.entry(object.id, seq)?;
                Ok(entry.and_then(|entry| match entry.event {
                    Event::Reading(reading) => Some(reading),
                    Event::Retraction { .. } | Event::Closed => None,
                }))
            };
        let now = now_ms();
        let new = crate::repeats::new_readings(readings, stored)?;
        Ok(new.into_iter().map(|reading| reading.entry(now, key)).collect())
    }
}
