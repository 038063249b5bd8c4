//! Catalogues: trained models as immutable versions, and the current one.
//!
//! A version is a manifest that names blocks by the hash of their content; versions share
//! blocks. Publishing writes the blocks, then the manifest with its number; switching then
//! makes a version current in one commit and keeps the history. Each step is durable before
//! the next begins, so a crash leaves the old state or the new one, at worst with
//! unreferenced blocks. Not here: the content of the blocks (`model_codec`).

mod stored;
mod content;
mod removal;
mod adoption;

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use uuid::Uuid;

use crate::engine::{Commit, Engine};
use crate::entity::Labels;
use crate::envelope::{self, Kind};
use crate::error::StoreError;
use crate::key::{self, Space};
use crate::model_codec::ModelPart;
use crate::pieces::{self, Limit};
use crate::record::{self, SCHEMA};
use crate::table::{Entity, Page, Table};
pub use adoption::AdoptError;

/// Number of remembered switches of the current version.
pub const HISTORY_MAX: usize = 1000;
/// Length of a manifest's key: space, catalogue, version.
const MANIFEST_KEY_BYTES: usize = 25;

/// A catalogue: its versions are 1 ..= `latest`, without removed ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Catalogue {
    /// Its id.
    pub id: Uuid,
    /// Its unique name.
    pub name: String,
    /// The newest version's number; 0 when there is none yet.
    pub latest: u32,
    /// The version that new sessions use.
    pub current: Option<u32>,
    /// Names of further versions.
    pub aliases: BTreeMap<String, u32>,
    /// Its labels.
    pub labels: Labels,
    /// Number of switches of `current`; the `ETag` of the alias.
    pub revision: u64,
    /// The last [`HISTORY_MAX`] switches, oldest first.
    pub history: Vec<Switch>,
    /// Time of creation.
    pub created_at_ms: u64,
}

impl Catalogue {
    /// A catalogue without versions.
    #[must_use]
    pub fn new(id: Uuid, name: String, created_at_ms: u64) -> Self {
        Self {
            id,
            name,
            latest: 0,
            current: None,
            aliases: BTreeMap::new(),
            labels: Labels::new(),
            revision: 0,
            history: Vec::new(),
            created_at_ms,
        }
    }
}

/// A version became current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switch {
    /// The version.
    pub version: u32,
    /// Time of the switch.
    pub at_ms: u64,
}

/// An object of a version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VersionObject {
    /// The object's id.
    pub id: Uuid,
    /// Its name when it was trained.
    pub name: String,
}

/// A block in a manifest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockEntry {
    /// Name within the version.
    pub name: String,
    /// BLAKE3 hash of the content.
    pub hash: [u8; 32],
    /// Length in bytes.
    pub length: u64,
}

/// Content of a version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Manifest {
    /// The catalogue.
    pub catalogue: Uuid,
    /// The version's number, from 1.
    pub version: u32,
    /// The job that trained it.
    pub job: Option<Uuid>,
    /// Training parameters, as the server writes them (JSON); may be empty.
    pub parameters: String,
    /// The objects, in the order of the model's object numbers.
    pub objects: Vec<VersionObject>,
    /// The blocks.
    pub blocks: Vec<BlockEntry>,
    /// Time of publication.
    pub created_at_ms: u64,
}

/// A version before its publication.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Draft {
    /// The job that trained it.
    pub job: Option<Uuid>,
    /// Training parameters, as the server writes them (JSON); may be empty.
    pub parameters: String,
    /// The objects, in the order of the model's object numbers.
    pub objects: Vec<VersionObject>,
    /// The blocks of another version that it shares as they are.
    pub shared: Vec<BlockEntry>,
    /// Its own blocks: names (unique within the version) and contents.
    pub blocks: Vec<(String, Vec<u8>)>,
    /// Time of publication.
    pub created_at_ms: u64,
}

/// All catalogues.
#[derive(Clone)]
pub struct Catalogues {
    engine: Arc<dyn Engine>,
    table: Table<Catalogue>,
}

impl Manifest {
    /// Whether the version was trained with a part.
    #[must_use]
    pub fn has(&self, part: ModelPart) -> bool {
        self.blocks.iter().any(|block| part.owns(&block.name))
    }
}

impl Catalogues {
    pub(crate) fn new(engine: Arc<dyn Engine>) -> Self {
        Self { table: Table::new(Arc::clone(&engine)), engine }
    }

    /// Creates a catalogue without versions.
    ///
    /// # Errors
    /// [`StoreError::NameTaken`], [`StoreError::Exists`]; the engine's.
    pub async fn create(&self, catalogue: &Catalogue) -> Result<(), StoreError> {
        self.table.create(catalogue).await
    }

    /// The catalogue with the given id.
    ///
    /// # Errors
    /// [`StoreError::NotFound`], [`StoreError::Damaged`]; the engine's.
    pub fn get(&self, id: Uuid) -> Result<Catalogue, StoreError> {
        self.table.get(id)
    }

    /// The catalogue with the given name, if any.
    ///
    /// # Errors
    /// [`StoreError::Damaged`]; the engine's.
    pub fn find_by_name(&self, name: &str) -> Result<Option<Catalogue>, StoreError> {
        self.table.find_by_name(name)
    }

    /// Up to `limit` catalogues after `after`.
    ///
    /// # Errors
    /// [`StoreError::Damaged`]; the engine's.
    pub fn list(&self, after: Option<Uuid>, limit: usize) -> Result<Page<Catalogue>, StoreError> {
        self.table.list(after, limit)
    }

    /// Up to `limit` catalogues after `after` that fit, as [`Table::list_fitting`].
    ///
    /// # Errors
    /// The engine's.
    pub fn list_fitting(
        &self,
        after: Option<Uuid>,
        limit: usize,
        fits: impl Fn(&Catalogue) -> bool,
    ) -> Result<Page<Catalogue>, StoreError> {
        self.table.list_fitting(after, limit, fits)
    }

    /// Writes a new version: its blocks, then its manifest. It does not become current. All its
    /// blocks count to the caller, including those that other versions share. No version that has
    /// the draft's shared blocks may be removed meanwhile.
    ///
    /// # Errors
    /// [`StoreError::NotFound`], [`StoreError::Damaged`]; the engine's.
    pub async fn publish(&self, catalogue: Uuid, draft: Draft) -> Result<Manifest, StoreError> {
        self.get(catalogue)?;
        let own: u64 = draft.blocks.iter().map(|(_, content)| content.len() as u64).sum();
        let bytes = own + draft.shared.iter().map(|block| block.length).sum::<u64>();
        self.engine.check_quota(bytes)?;
        let mut blocks = draft.shared;
        for (name, content) in draft.blocks {
            blocks.push(self.write_block(name, &content).await?);
        }
        let mut manifest = Manifest {
            catalogue,
            version: 0,
            job: draft.job,
            parameters: draft.parameters,
            objects: draft.objects,
            blocks,
            created_at_ms: draft.created_at_ms,
        };
        // The number is taken and the manifest written in one commit: neither a crash nor
        // another publisher leaves one without the other.
        let published = self.table.update_with(catalogue, |now| {
            now.latest += 1;
            manifest.version = now.latest;
            let head = key::numbered(Space::Version, catalogue, u64::from(now.latest));
            let commit = pieces::put(Commit::new(), &head, &record::encode(&manifest), None);
            Ok::<_, Infallible>(Commit { counted: vec![(head, bytes)], ..commit })
        });
        published.await?.unwrap_or_else(|never| match never {});
        Ok(manifest)
    }

    /// Makes a version current, for new sessions. `revision`, if given, must be the present one.
    ///
    /// # Errors
    /// [`StoreError::NoVersion`]; [`StoreError::Changed`] when the revision is another one.
    pub async fn switch(
        &self,
        catalogue: Uuid,
        version: u32,
        revision: Option<u64>,
        at_ms: u64,
    ) -> Result<Catalogue, StoreError> {
        self.manifest(catalogue, version)?;
        let switched = self.table.update(catalogue, |now| {
            if revision.is_some_and(|revision| revision != now.revision) {
                return Err(StoreError::Changed { what: Catalogue::WHAT, id: catalogue });
            }
            now.current = Some(version);
            now.revision += 1;
            now.history.push(Switch { version, at_ms });
            let surplus = now.history.len().saturating_sub(HISTORY_MAX);
            now.history.drain(..surplus);
            Ok(())
        });
        switched.await?
    }

    /// Changes a catalogue's labels or aliases; `change` may run several times.
    ///
    /// # Errors
    /// As [`Table::update`].
    pub async fn update<R>(
        &self,
        id: Uuid,
        change: impl FnMut(&mut Catalogue) -> Result<(), R>,
    ) -> Result<Result<Catalogue, R>, StoreError> {
        self.table.update(id, change).await
    }

    /// The manifest of a version.
    ///
    /// # Errors
    /// [`StoreError::NoVersion`], [`StoreError::Damaged`]; the engine's.
    pub fn manifest(&self, catalogue: Uuid, version: u32) -> Result<Manifest, StoreError> {
        let head = key::numbered(Space::Version, catalogue, u64::from(version));
        let bytes = pieces::read(&*self.engine, Space::Version, &head)?
            .ok_or(StoreError::NoVersion { catalogue, version })?;
        let manifest: Manifest =
            record::decode(&bytes).map_err(StoreError::damaged(Space::Version))?;
        if manifest.is_removed() {
            return Err(StoreError::NoVersion { catalogue, version });
        }
        Ok(manifest)
    }

    /// Up to `limit` manifests of versions above `after`, without removed ones, in ascending
    /// order.
    ///
    /// # Errors
    /// [`StoreError::Damaged`]; the engine's.
    pub fn manifests(
        &self,
        catalogue: Uuid,
        after: u32,
        limit: usize,
    ) -> Result<Vec<Manifest>, StoreError> {
        let (mut found, mut after) = (Vec::new(), after);
        loop {
            let wanted = limit - found.len();
            let mut behind = key::numbered(Space::Version, catalogue, u64::from(after));
            behind.extend_from_slice(&[0xff; 5]);
            let (prefix, space) = (key::id(Space::Version, catalogue), Space::Version);
            let from = Some(behind);
            let records = pieces::scan(
                &*self.engine,
                space,
                &prefix,
                MANIFEST_KEY_BYTES,
                from,
                Limit::records(wanted),
            )?;
            let decoded: Result<Vec<Manifest>, _> =
                records.iter().map(|(_, bytes)| record::decode(bytes)).collect();
            let decoded = decoded.map_err(StoreError::damaged(space))?;
            let (n_read, last) = (decoded.len(), decoded.last().map(|last| last.version));
            found.extend(decoded.into_iter().filter(|manifest| !manifest.is_removed()));
            match last {
                Some(last) if n_read == wanted && found.len() < limit => after = last,
                _ => return Ok(found),
            }
        }
    }

    /// Bytes of all blocks that versions of a catalogue name, each once.
    ///
    /// # Errors
    /// [`StoreError::Damaged`]; the engine's.
    pub fn block_bytes(&self, catalogue: Uuid) -> Result<u64, StoreError> {
        let mut blocks = BTreeMap::new();
        for manifest in self.manifests(catalogue, 0, usize::MAX)? {
            blocks.extend(manifest.blocks.iter().map(|block| (block.hash, block.length)));
        }
        Ok(blocks.values().sum())
    }

    async fn write_block(&self, name: String, content: &[u8]) -> Result<BlockEntry, StoreError> {
        let hash = block_hash(content);
        let entry = BlockEntry { name, hash, length: content.len() as u64 };
        // An undamaged block is shared; a damaged one is written again.
        if self.block(&entry).is_err() {
            let sealed = envelope::seal(Kind::Block, SCHEMA, content);
            let head = key::hash(Space::Block, &hash);
            pieces::write_large(&*self.engine, &head, &sealed).await?;
        }
        Ok(entry)
    }
}

/// The hash under which a block is stored and shared by versions.
#[must_use]
pub fn block_hash(content: &[u8]) -> [u8; 32] {
    *blake3::hash(content).as_bytes()
}

impl Entity for Catalogue {
    const SPACE: Space = Space::Catalogue;
    const WHAT: &'static str = "catalogue";

    fn id(&self) -> Uuid {
        self.id
    }

    fn name(&self) -> Option<&str> {
        Some(&self.name)
    }
}
