//! Trained models: versions that never change, and the one that new sessions use.
//!
//! What sessions recognise by is read from the store part by part (`loading`) and kept under a
//! budget of memory (`memory`).

mod appearance;
mod loading;
mod maps;
mod memory;
mod removal;

use std::sync::Arc;

use dashmap::DashMap;
use glam::DVec3;
use palpate_core::symmetry::Symmetry;
use palpate_dissertation::appearance::model::AppearanceModel;
use palpate_dissertation::geometric::model::GeometricModel;
use palpate_dissertation::geometric::{PreparedGeometry, TableBudget};
use palpate_dissertation::sva::model::ObjectMap;
use palpate_recogniser::model::SurfaceModel;
use palpate_schemas as wire;
use palpate_store::catalogue::{Catalogue, Catalogues as Table, Draft, Manifest, VersionObject};
use palpate_store::database::Database;
use palpate_store::error::StoreError;
use palpate_store::model::TrainedModel;
use palpate_store::model_codec::ModelPart;
use uuid::Uuid;

use crate::clock::now_ms;
use crate::compute::Pool;
use crate::refusal::Refusal;
use crate::wire::{cursor, page_id, page_length, page_number, training};
use loading::Key;
pub(crate) use loading::part_name;
use memory::Memory;

/// The catalogue that is meant when nobody names one.
pub(crate) const DEFAULT: &str = "default";

/// A version that can recognise: the part of it that a method needs, or all parts.
pub(crate) struct Model {
    pub(crate) catalogue: Uuid,
    pub(crate) name: String,
    pub(crate) version: u32,
    pub(crate) core: Arc<TrainedModel>,
    pub(crate) objects: Vec<VersionObject>,
    /// Where each object's frame has its origin in the frame that it was taught in, metres.
    pub(crate) origins_in_model: Arc<[DVec3]>,
    /// The symmetries of its objects; empty where no method of the part answers poses modulo
    /// symmetry.
    pub(crate) symmetries: Arc<[Symmetry]>,
    /// What sessions by geometry share.
    prepared: Option<PreparedGeometry>,
}

impl Model {
    /// The geometry of its objects with what sessions look up in it.
    pub(crate) fn prepared(&self) -> Result<&PreparedGeometry, Refusal> {
        self.prepared.as_ref().ok_or_else(|| self.no_geometry())
    }

    fn no_geometry(&self) -> Refusal {
        Refusal::NoGeometric { catalogue: self.name.clone(), version: self.version }
    }

    /// What the version knows of its objects' geometry.
    pub(crate) fn geometric(&self) -> Result<&Arc<GeometricModel>, Refusal> {
        self.core.geometric.as_ref().ok_or_else(|| self.no_geometry())
    }

    /// What the version knows of its objects' appearance.
    pub(crate) fn appearance(&self) -> Result<&Arc<AppearanceModel>, Refusal> {
        self.core.appearance.as_ref().ok_or_else(|| Refusal::NoAppearance {
            catalogue: self.name.clone(),
            version: self.version,
        })
    }

    /// The surfaces of its objects.
    pub(crate) fn surface(&self) -> Result<&Arc<SurfaceModel>, Refusal> {
        self.core.surface.as_ref().ok_or_else(|| Refusal::NoSurface {
            catalogue: self.name.clone(),
            version: self.version,
        })
    }

    /// The maps of pairs of touches, one an object.
    pub(crate) fn sva(&self) -> Result<&[Arc<ObjectMap>], Refusal> {
        let maps = self.core.sva.objects.as_slice();
        if maps.len() == self.objects.len() {
            return Ok(maps);
        }
        Err(Refusal::NoSva { catalogue: self.name.clone(), version: self.version })
    }

    /// The place of an object among the model's, by its id or its name when it was trained.
    pub(crate) fn find(&self, reference: &str) -> Option<usize> {
        match Uuid::parse_str(reference) {
            Ok(id) => self.objects.iter().position(|object| object.id == id),
            Err(_) => self.objects.iter().position(|object| object.name == reference),
        }
    }
}

/// All catalogues.
pub(crate) struct Catalogues {
    store: Database,
    table: Table,
    /// The same for removals, which must work on a full disk.
    removing: Table,
    pool: Pool,
    memory: Memory<Key, Model>,
    /// The memory of what sessions by geometry look up.
    tables: Arc<TableBudget>,
    loading: tokio::sync::Mutex<()>,
    /// Versions that are damaged, and why.
    damaged: DashMap<(Uuid, u32), String>,
    /// Held for reading by what begins to need a version, for writing by what removes one.
    using: tokio::sync::RwLock<()>,
    /// Held while a version's blocks and its manifest are written, or removed.
    publishing: tokio::sync::Mutex<()>,
}

/// The version that a new session is about to pin.
pub(crate) struct Pinned {
    pub(crate) catalogue: Uuid,
    pub(crate) version: u32,
    /// Whether it has surfaces: what methods there are depends on it.
    pub(crate) has_surfaces: bool,
}

impl Catalogues {
    /// Models are kept in at most `memory_bytes_max` bytes, and what beliefs make of them in
    /// at most `tables_bytes_max`.
    pub(crate) fn new(
        store: &Database,
        pool: Pool,
        memory_bytes_max: u64,
        tables_bytes_max: usize,
    ) -> Self {
        let (memory, tables) = (Memory::new(memory_bytes_max), TableBudget::new(tables_bytes_max));
        Self {
            store: store.clone(),
            table: store.catalogues(),
            removing: store.essential().catalogues(),
            pool,
            memory,
            tables,
            loading: tokio::sync::Mutex::new(()),
            damaged: DashMap::new(),
            using: tokio::sync::RwLock::new(()),
            publishing: tokio::sync::Mutex::new(()),
        }
    }

    /// Bytes of what beliefs by geometry look up and share.
    pub(crate) fn table_bytes(&self) -> usize {
        self.tables.used()
    }

    /// The catalogue of a name.
    pub(crate) fn find(&self, name: &str) -> Result<Catalogue, Refusal> {
        let found = self.table.find_by_name(name)?;
        found.ok_or_else(|| Refusal::NotFound { what: "catalogue", reference: name.to_owned() })
    }

    /// The name of a catalogue's id.
    pub(crate) fn name(&self, id: Uuid) -> Result<String, Refusal> {
        Ok(self.table.get(id)?.name)
    }

    /// The catalogue of a name, made if it does not exist.
    pub(crate) async fn find_or_create(&self, name: &str) -> Result<Catalogue, Refusal> {
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

    pub(crate) fn list(&self, query: &wire::PageQuery) -> Result<wire::CataloguePage, Refusal> {
        let page = self.table.list(page_id(query)?, page_length(query)?)?;
        let items = page.items.iter().map(training::catalogue).collect();
        Ok(wire::CataloguePage { items, next_cursor: cursor(page.next) })
    }

    pub(crate) fn versions(
        &self,
        name: &str,
        query: &wire::PageQuery,
    ) -> Result<wire::CatalogueVersionPage, Refusal> {
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
    ) -> Result<wire::CatalogueVersion, Refusal> {
        let catalogue = self.find(name)?;
        self.shown(&catalogue, &self.manifest(&catalogue, number(version)?)?)
    }

    fn shown(
        &self,
        catalogue: &Catalogue,
        manifest: &Manifest,
    ) -> Result<wire::CatalogueVersion, Refusal> {
        let damage = self.damaged.get(&(catalogue.id, manifest.version));
        let damage = damage.map(|reason| reason.clone());
        Ok(wire::CatalogueVersion { damage, ..training::version(catalogue, manifest)? })
    }

    /// Keeps a damaged version from being recognised with.
    pub(crate) fn quarantine(&self, catalogue: Uuid, version: u32, reason: String) {
        tracing::error!(
            catalogue.id = %catalogue, version,
            "Version {version} of catalogue {catalogue} is damaged: {reason}"
        );
        self.damaged.insert((catalogue, version), reason);
    }

    /// How many versions are damaged.
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
    ) -> Result<wire::ObjectMap, Refusal> {
        let (from, limit) = (page_number(query)?, page_length(query)?);
        let (model, place) = self.object_of(name, version, object, ModelPart::Sva).await?;
        let from = usize::try_from(from).unwrap_or(usize::MAX);
        Ok(training::object_map(&model.objects[place], &model.sva()?[place], from, limit))
    }

    /// A part of a version's model and the place of one of its objects, all as a path names them.
    async fn object_of(
        &self,
        name: &str,
        version: &str,
        object: &str,
        part: ModelPart,
    ) -> Result<(Arc<Model>, usize), Refusal> {
        let catalogue = self.find(name)?;
        let version = self.manifest(&catalogue, number(version)?)?.version;
        let model = self.load(catalogue.id, version, part).await?;
        let place = model
            .find(object)
            .ok_or_else(|| Refusal::NotFound { what: "object", reference: object.to_owned() })?;
        Ok((model, place))
    }

    /// Makes a version current if nobody else has switched since `revision`.
    pub(crate) async fn switch(
        &self,
        name: &str,
        version: u32,
        revision: u64,
    ) -> Result<Catalogue, Refusal> {
        let _using = self.using().await;
        let catalogue = self.find(name)?;
        self.manifest(&catalogue, version)
            .map_err(|refusal| Refusal::field("/version", refusal))?;
        match self.table.switch(catalogue.id, version, Some(revision), now_ms()).await {
            Err(StoreError::Changed { .. }) => Err(Refusal::RevisionChanged {
                expected: revision.to_string(),
                found: self.find(name)?.revision,
            }),
            other => {
                tracing::info!("Version {version} of catalogue {name:?} is current now");
                Ok(other?)
            }
        }
    }

    /// Stores a new version and, if asked to, makes it current.
    pub(crate) async fn publish(
        &self,
        name: &str,
        draft: Draft,
        activate: bool,
    ) -> Result<u32, Refusal> {
        let _publishing = self.publishing.lock().await;
        let catalogue = self.find(name)?;
        let manifest = self.table.publish(catalogue.id, draft).await?;
        if activate {
            self.table.switch(catalogue.id, manifest.version, None, now_ms()).await?;
        }
        Ok(manifest.version)
    }

    /// The version that a job made, if it did.
    pub(crate) fn made_by(&self, name: &str, job: Uuid) -> Result<Option<u32>, Refusal> {
        let Some(catalogue) = self.table.find_by_name(name)? else { return Ok(None) };
        let manifests = self.table.manifests(catalogue.id, 0, usize::MAX)?;
        let made = manifests.iter().rev().find(|manifest| manifest.job == Some(job));
        Ok(made.map(|manifest| manifest.version))
    }

    /// The version that a new session uses: the one asked for, or the current one.
    pub(crate) fn pin(&self, name: &str, version: Option<u32>) -> Result<Pinned, Refusal> {
        let catalogue = self.table.find_by_name(name)?.ok_or_else(|| unknown_catalogue(name))?;
        let manifest = match version {
            Some(version) => self
                .manifest(&catalogue, version)
                .map_err(|refusal| Refusal::field("/version", refusal))?,
            None => {
                let current = catalogue.current;
                let untrained = || Refusal::Untrained { catalogue: name.to_owned() };
                self.manifest(&catalogue, current.ok_or_else(untrained)?)?
            }
        };
        let has_surfaces = manifest.has(ModelPart::Surface);
        Ok(Pinned { catalogue: catalogue.id, version: manifest.version, has_surfaces })
    }

    /// The manifest of a version of a named catalogue, and how it was trained.
    pub(crate) fn manifest_of(
        &self,
        name: &str,
        version: u32,
    ) -> Result<(Manifest, training::VersionParameters), Refusal> {
        let catalogue = self.find(name)?;
        let manifest = self.manifest(&catalogue, version)?;
        let parameters = training::parameters(&catalogue, &manifest)?;
        Ok((manifest, parameters))
    }

    fn manifest(&self, catalogue: &Catalogue, version: u32) -> Result<Manifest, Refusal> {
        self.table.manifest(catalogue.id, version).map_err(|error| match error {
            StoreError::NoVersion { .. } => {
                Refusal::NoVersion { catalogue: catalogue.name.clone(), version }
            }
            other => other.into(),
        })
    }
}

/// The number of a version as a path has it.
fn number(version: &str) -> Result<u32, Refusal> {
    let unknown = || Refusal::NotFound { what: "version", reference: version.to_owned() };
    version.parse().map_err(|_| unknown())
}

fn unknown_catalogue(name: &str) -> Refusal {
    if name == DEFAULT {
        return Refusal::Untrained { catalogue: name.to_owned() };
    }
    Refusal::field("/catalogue", format!("there is no catalogue {name:?}"))
}

/// How a version was trained, if its manifest can be read.
fn parameters_of(manifest: &Manifest) -> Option<training::VersionParameters> {
    serde_json::from_str(&manifest.parameters).ok()
}
