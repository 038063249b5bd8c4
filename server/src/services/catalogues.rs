//! Trained models: immutable versions, and the one that new sessions use.
//!
//! The parts of a version are read from the store on demand (`loading`) and kept within a
//! memory budget (`memory`).

mod aliases;
mod elsewhere;
mod error;
mod interest;
mod loading;
mod maps;
mod memory;
pub(crate) mod packages;
mod removal;

use std::sync::Arc;

use dashmap::DashMap;
use palpate_dissertation::geometric::TableBudget;
use palpate_schemas as wire;
use palpate_store::catalogue::{Catalogue, Catalogues as Table, Draft, Manifest};
use palpate_store::database::Database;
use palpate_store::error::StoreError;
use palpate_store::model_codec::{APPEARANCE_BLOCK, ModelPart};
use uuid::Uuid;

use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::Pool;
use crate::config::Config;
use crate::model::Model;
use crate::wire::{appearance, cursor, labels, page_id, page_length, page_number, training};
pub(crate) use error::CatalogueError;
use interest::Interests;
use loading::Key;
use memory::Memory;

/// The catalogue of requests that name none.
pub(crate) const DEFAULT: &str = "default";

/// All catalogues.
pub(crate) struct Catalogues {
    store: Database,
    table: Table,
    /// A table for removals, which must work on a full disk.
    removing: Table,
    pool: Pool,
    memory: Memory<Key, Model>,
    /// The memory budget of geometric look-up tables.
    tables: Arc<TableBudget>,
    loading: tokio::sync::Mutex<()>,
    interests: Interests,
    /// Damaged versions, with the reasons.
    damaged: DashMap<(Uuid, u32), String>,
    /// Read-locked by operations that start to need a version, write-locked by removals.
    using: tokio::sync::RwLock<()>,
    /// Locked while a version's blocks and its manifest are written, or removed.
    publishing: tokio::sync::Mutex<()>,
}

/// The version for a new session.
pub(crate) struct Pinned {
    pub(crate) catalogue: Uuid,
    pub(crate) version: u32,
    /// Whether it has surfaces, which determines the available methods.
    pub(crate) has_surfaces: bool,
}

impl Catalogues {
    /// Models and look-up tables within the bounds of a configuration.
    pub(crate) fn new(store: &Database, pool: Pool, config: &Config) -> Self {
        Self {
            store: store.clone(),
            table: store.catalogues(),
            removing: store.essential().catalogues(),
            pool,
            memory: Memory::new(config.model_memory_bytes_max),
            tables: TableBudget::new(config.belief_memory_bytes_max),
            loading: tokio::sync::Mutex::new(()),
            interests: Interests::new(),
            damaged: DashMap::new(),
            using: tokio::sync::RwLock::new(()),
            publishing: tokio::sync::Mutex::new(()),
        }
    }

    /// Bytes of the shared look-up tables of geometric beliefs.
    pub(crate) fn table_bytes(&self) -> usize {
        self.tables.used()
    }

    /// The catalogue with the given name.
    pub(crate) fn find(&self, name: &str) -> Result<Catalogue, Cause> {
        let found = self.table.find_by_name(name)?;
        found.ok_or_else(|| Cause::unknown("catalogue", name))
    }

    /// The name of the catalogue with the given id.
    pub(crate) fn name(&self, id: Uuid) -> Result<String, StoreError> {
        Ok(self.table.get(id)?.name)
    }

    /// The catalogue with the given name, created if it does not exist.
    pub(crate) async fn find_or_create(&self, name: &str) -> Result<Catalogue, Cause> {
        if let Some(found) = self.table.find_by_name(name)? {
            return Ok(found);
        }
        crate::wire::name(name)?;
        let new = Catalogue::new(Uuid::now_v7(), name.to_owned(), now_ms());
        match self.table.create(&new).await {
            Ok(()) => Ok(new),
            Err(StoreError::NameTaken { .. }) => self.find(name),
            Err(error) => Err(error.into()),
        }
    }

    pub(crate) fn list(&self, query: wire::LabelledQuery) -> Result<wire::CataloguePage, Cause> {
        let (page, wanted) = labels::page_and_wanted(query)?;
        let (after, limit) = (page_id(&page)?, page_length(&page)?);
        let fits = |catalogue: &Catalogue| wanted.fits(&catalogue.labels);
        let page = self.table.list_fitting(after, limit, fits)?;
        let items = page.items.iter().map(training::catalogue).collect();
        Ok(wire::CataloguePage { items, next_cursor: cursor(page.next) })
    }

    pub(crate) fn versions(
        &self,
        name: &str,
        query: &wire::PageQuery,
    ) -> Result<wire::CatalogueVersionPage, CatalogueError> {
        let catalogue = self.find(name)?;
        let after = u32::try_from(page_number(query)?).unwrap_or(u32::MAX);
        let limit = page_length(query)?;
        let manifests = self.table.manifests(catalogue.id, after, limit)?;
        let last = manifests.last().map_or(after, |manifest| manifest.version);
        let more = manifests.len() == limit && last < catalogue.latest;
        let items: Result<_, _> =
            manifests.iter().map(|manifest| self.shown(&catalogue, manifest)).collect();
        Ok(wire::CatalogueVersionPage {
            items: items?,
            next_cursor: more.then(|| last.to_string()),
        })
    }

    pub(crate) fn version(
        &self,
        name: &str,
        version: &str,
    ) -> Result<wire::CatalogueVersion, CatalogueError> {
        let catalogue = self.find(name)?;
        self.shown(&catalogue, &self.manifest(&catalogue, number(version)?)?)
    }

    fn shown(
        &self,
        catalogue: &Catalogue,
        manifest: &Manifest,
    ) -> Result<wire::CatalogueVersion, CatalogueError> {
        let damage = self.damaged.get(&(catalogue.id, manifest.version));
        let damage = damage.map(|reason| reason.clone());
        Ok(wire::CatalogueVersion { damage, ..training::version(catalogue, manifest)? })
    }

    /// Excludes a damaged version from recognition.
    pub(crate) fn quarantine(&self, catalogue: Uuid, version: u32, reason: String) {
        tracing::error!(
            catalogue.id = %catalogue, version,
            "Version {version} of catalogue {catalogue} is damaged: {reason}"
        );
        self.damaged.insert((catalogue, version), reason);
    }

    /// Number of damaged versions.
    pub(crate) fn n_damaged(&self) -> usize {
        self.damaged.len()
    }

    /// The map of one object of a version, with a page of its patches.
    pub(crate) async fn object_map(
        &self,
        name: &str,
        version: &str,
        object: &str,
        query: &wire::PageQuery,
    ) -> Result<wire::ObjectMap, CatalogueError> {
        let (from, limit) = (page_number(query)?, page_length(query)?);
        let (model, place) = self.object_of(name, version, object, ModelPart::Sva).await?;
        let from = usize::try_from(from).unwrap_or(usize::MAX);
        Ok(training::object_map(&model.objects[place], &model.sva()?[place], from, limit))
    }

    /// The report of a version's appearance.
    pub(crate) async fn appearance_report(
        &self,
        name: &str,
        version: &str,
    ) -> Result<wire::AppearanceReport, CatalogueError> {
        let catalogue = self.find(name)?;
        let manifest = self.manifest(&catalogue, number(version)?)?;
        let model = self.load(catalogue.id, manifest.version, ModelPart::Appearance).await?;
        let trained = model.appearance()?;
        let block = manifest.blocks.iter().find(|block| block.name == APPEARANCE_BLOCK);
        let hash = block.map_or([0; 32], |block| block.hash);
        Ok(appearance::report(trained, &model.objects, &hash, &model.name, model.version))
    }

    /// A part of a version's model and the index of one of its objects, by the segments of a path.
    async fn object_of(
        &self,
        name: &str,
        version: &str,
        object: &str,
        part: ModelPart,
    ) -> Result<(Arc<Model>, usize), CatalogueError> {
        let catalogue = self.find(name)?;
        let version = self.manifest(&catalogue, number(version)?)?.version;
        let model = self.load(catalogue.id, version, part).await?;
        let place = model.find(object).ok_or_else(|| Cause::unknown("object", object))?;
        Ok((model, place))
    }

    /// Makes a version current if there was no other switch since `revision`.
    pub(crate) async fn switch(
        &self,
        name: &str,
        version: u32,
        revision: u64,
    ) -> Result<Catalogue, CatalogueError> {
        let _using = self.using().await;
        let catalogue = self.find(name)?;
        self.manifest(&catalogue, version).map_err(|error| Cause::field("/version", error))?;
        match self.table.switch(catalogue.id, version, Some(revision), now_ms()).await {
            Err(StoreError::Changed { .. }) => Err(CatalogueError::RevisionChanged {
                expected: revision.to_string(),
                found: self.find(name)?.revision,
            }),
            other => {
                tracing::info!("Version {version} of catalogue {name:?} is current now");
                Ok(other?)
            }
        }
    }

    /// Stores a new version and makes it current on request.
    pub(crate) async fn publish(
        &self,
        name: &str,
        draft: Draft,
        activate: bool,
    ) -> Result<u32, CatalogueError> {
        let _alone = self.alone().await?;
        let catalogue = self.find(name)?;
        let manifest = self.table.publish(catalogue.id, draft).await?;
        if activate {
            self.table.switch(catalogue.id, manifest.version, None, now_ms()).await?;
        }
        Ok(manifest.version)
    }

    /// Stores a version that shares the blocks of version `before`, and on request makes it current,
    /// unless another one than that is current by then.
    pub(crate) async fn publish_recalibrated(
        &self,
        catalogue: Uuid,
        before: u32,
        draft: Draft,
        activate: bool,
    ) -> Result<u32, CatalogueError> {
        let _alone = self.alone().await?;
        let catalogue = self.table.get(catalogue)?;
        // Its blocks are there as long as it is.
        let before = self.manifest(&catalogue, before)?.version;
        let version = self.table.publish(catalogue.id, draft).await?.version;
        if activate && catalogue.current == Some(before) {
            let revision = Some(catalogue.revision);
            match self.table.switch(catalogue.id, version, revision, now_ms()).await {
                // Somebody has chosen another version.
                Ok(_) | Err(StoreError::Changed { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(version)
    }

    /// The version made by a job, if any.
    pub(crate) fn made_by(&self, name: &str, job: Uuid) -> Result<Option<u32>, StoreError> {
        let Some(catalogue) = self.table.find_by_name(name)? else { return Ok(None) };
        let manifests = self.table.manifests(catalogue.id, 0, usize::MAX)?;
        let made = manifests.iter().rev().find(|manifest| manifest.job == Some(job));
        Ok(made.map(|manifest| manifest.version))
    }

    /// The current version of a named catalogue and its parameters; `None` also if these cannot be
    /// read.
    pub(crate) fn current_of(
        &self,
        name: &str,
    ) -> Result<Option<(u32, training::VersionParameters)>, StoreError> {
        let Some(catalogue) = self.table.find_by_name(name)? else { return Ok(None) };
        let Some(version) = catalogue.current else { return Ok(None) };
        let manifest = self.manifest(&catalogue, version).ok();
        Ok(manifest.and_then(|manifest| parameters_of(&manifest)).map(|known| (version, known)))
    }

    /// The manifest of a version of a named catalogue, and its training parameters.
    pub(crate) fn manifest_of(
        &self,
        name: &str,
        version: u32,
    ) -> Result<(Manifest, training::VersionParameters), CatalogueError> {
        let catalogue = self.find(name)?;
        let manifest = self.manifest(&catalogue, version)?;
        let parameters = training::parameters(&catalogue, &manifest)?;
        Ok((manifest, parameters))
    }

    fn manifest(&self, catalogue: &Catalogue, version: u32) -> Result<Manifest, CatalogueError> {
        self.table.manifest(catalogue.id, version).map_err(|error| match error {
            StoreError::NoVersion { .. } => {
                CatalogueError::NoVersion { catalogue: catalogue.name.clone(), version }
            }
            other => other.into(),
        })
    }
}

/// The number of a version in a path.
fn number(version: &str) -> Result<u32, Cause> {
    version.parse().map_err(|_| Cause::unknown("version", version))
}

/// The training parameters of a version, if its manifest can be read.
fn parameters_of(manifest: &Manifest) -> Option<training::VersionParameters> {
    serde_json::from_str(&manifest.parameters).ok()
}
