//! Loading of models: the part of a version that a session's method needs, within a memory budget.
//!
//! Parts are read from the store when a session first needs them and shared by all sessions
//! of the version. Trainings and merges read whole versions for themselves: these are not
//! kept, and not counted in the budget.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::symmetry::Symmetry;
use palpate_dissertation::geometric::{PreparedGeometry, TableBudget};
use palpate_recogniser::belief::prepare;
use palpate_recogniser::options::SurfaceOptions;
use palpate_store::catalogue::{Catalogues as Table, Manifest, VersionObject};
use palpate_store::error::StoreError;
use palpate_store::model::TrainedModel;
use palpate_store::model_codec::{CodecError, ModelPart};
use uuid::Uuid;

use super::memory::NoRoom;
use super::{CatalogueError, Catalogues, parameters_of};
use crate::asker::Asker;
use crate::model::{Model, NoPart, part_name};
use crate::wire::count;

/// Ratio of a surface's size in memory to its block's, unless a report states the size.
const SURFACE_GROWTH: u64 = 16;

/// A part of a version.
pub(super) type Key = (Uuid, u32, ModelPart);

impl Catalogues {
    /// A part of a version's model, from memory or the store.
    pub(crate) async fn load(
        &self,
        catalogue: Uuid,
        version: u32,
        part: ModelPart,
    ) -> Result<Arc<Model>, CatalogueError> {
        let key = (catalogue, version, part);
        if let Some(model) = self.memory.get(&key) {
            return Ok(model);
        }
        // One at a time: many sessions may need the same model at once, and there may be
        // space for one of several.
        let _loading = self.loading.lock().await;
        if let Some(model) = self.memory.get(&key) {
            return Ok(model);
        }
        let name = self.table.get(catalogue)?.name;
        if let Some(reason) = self.damaged.get(&(catalogue, version)) {
            return Err(CatalogueError::Quarantined {
                catalogue: name,
                version,
                reason: reason.clone(),
            });
        }
        let manifest = self.table.manifest(catalogue, version)?;
        if !manifest.has(part) {
            return Err(NoPart { part, catalogue: name, version }.into());
        }
        let no_room = |needed: u64, why: NoRoom| match why {
            NoRoom::TooLarge => CatalogueError::ModelTooLarge {
                catalogue: name.clone(),
                version,
                part: part_name(part),
                needed,
                budget: self.memory.budget(),
            },
            NoRoom::InUse { bytes } => CatalogueError::ModelsInUse {
                catalogue: name.clone(),
                version,
                needed,
                in_use: bytes,
                budget: self.memory.budget(),
            },
        };
        let expected = bytes_expected(&manifest, part);
        self.memory.make_room(expected).map_err(|why| no_room(expected, why))?;
        let (table, read_name) = (self.table.clone(), name.clone());
        let tables = Arc::clone(&self.tables);
        let stop = Asker::current().overdue().clone();
        let read = move || {
            let core = table.model_part(&manifest, part, &stop)?;
            prepared_part(&table, read_name, manifest, core, part, &tables)
        };
        let model = match self.pool.place()?.run(read).await? {
            Err(error @ (StoreError::Damaged { .. } | StoreError::Model { .. })) => {
                let reason = error.to_string();
                self.quarantine(catalogue, version, reason.clone());
                return Err(CatalogueError::Quarantined { catalogue: name, version, reason });
            }
            other => other?,
        };
        let bytes = bytes_found(&model.core).unwrap_or(expected);
        self.memory.keep(key, model, bytes).map_err(|why| no_room(bytes, why))
    }

    /// All parts of a version's model, read for the caller alone.
    pub(crate) async fn whole(
        &self,
        catalogue: Uuid,
        version: u32,
    ) -> Result<Arc<Model>, CatalogueError> {
        let (table, stop) = (self.table.clone(), Asker::current().overdue().clone());
        let read = move || {
            let name = table.get(catalogue)?.name;
            let manifest = table.manifest(catalogue, version)?;
            let core = table.model(&manifest, &stop)?;
            let origins_in_model = origins_in_model(&manifest)?;
            let (core, objects) = (Arc::new(core), manifest.objects);
            let (symmetries, prepared) = (Arc::default(), None);
            Ok::<_, StoreError>(Model {
                catalogue,
                name,
                version,
                core,
                objects,
                origins_in_model,
                symmetries,
                prepared,
            })
        };
        Ok(Arc::new(self.pool.place()?.run(read).await??))
    }

    /// The bytes of a part of all models in memory.
    pub(crate) fn bytes_in_memory(&self, part: ModelPart) -> u64 {
        self.memory.bytes(|key| key.2 == part)
    }
}

/// Expected memory of a part: the size of its blocks; for surfaces the size reported by their
/// training, since their tables are built when they are read.
fn bytes_expected(manifest: &Manifest, part: ModelPart) -> u64 {
    let blocks = manifest.blocks.iter().filter(|block| part.needs(&block.name));
    let stored: u64 = blocks.map(|block| block.length).sum();
    match part {
        ModelPart::Sva | ModelPart::Geometric | ModelPart::Appearance => stored,
        ModelPart::Surface => match parameters_of(manifest) {
            Some(known) if known.report.surface_bytes > 0 => known.report.surface_bytes,
            _ => SURFACE_GROWTH * stored,
        },
    }
}

/// Actual memory of the surfaces that were read; `None` for other parts.
fn bytes_found(core: &TrainedModel) -> Option<u64> {
    core.surface.as_ref().map(|surface| surface.bytes() as u64)
}

fn prepared_part(
    table: &Table,
    name: String,
    manifest: Manifest,
    core: TrainedModel,
    part: ModelPart,
    tables: &Arc<TableBudget>,
) -> Result<Model, StoreError> {
    let (catalogue, version, n_objects) =
        (manifest.catalogue, manifest.version, manifest.objects.len());
    let what = part_name(part);
    tracing::info!("Read {what} of {n_objects} objects, version {version} of catalogue {name:?}");
    if let Some(surface) = &core.surface {
        prepare(surface, &SurfaceOptions::default());
    }
    let symmetries: Arc<[Symmetry]> = match (&core.surface, part) {
        (Some(surface), _) => surface.maps().iter().map(|map| map.symmetry().clone()).collect(),
        (None, ModelPart::Sva) => table.symmetries(&manifest)?.into(),
        (None, _) => Arc::default(),
    };
    let geometry = core.geometric.clone();
    let prepared = geometry.map(|model| PreparedGeometry::within(model, Arc::clone(tables)));
    let origins_in_model = origins_in_model(&manifest)?;
    let (core, objects) = (Arc::new(core), manifest.objects);
    Ok(Model { catalogue, name, version, core, objects, origins_in_model, symmetries, prepared })
}

/// Origins of the objects' frames in their training frames, metres, from the version's report.
fn origins_in_model(manifest: &Manifest) -> Result<Arc<[DVec3]>, StoreError> {
    let reports = parameters_of(manifest).map(|known| known.report.objects).unwrap_or_default();
    let origin = |object: &VersionObject| {
        let report = reports.iter().find(|report| report.id == object.id);
        report.map(|report| DVec3::from_array(report.origin_in_mesh))
    };
    let origins: Option<Arc<[DVec3]>> = manifest.objects.iter().map(origin).collect();
    let n_objects = count(manifest.objects.len());
    origins.ok_or_else(|| StoreError::Model {
        catalogue: manifest.catalogue,
        version: manifest.version,
        source: CodecError::Count {
            field: "number of objects in the report",
            found: count(reports.len()),
            low: n_objects,
            high: n_objects,
        },
    })
}
