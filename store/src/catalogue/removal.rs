//! Removal of versions and catalogues, and of the blocks that are no longer referenced.
//!
//! A removed version leaves a manifest without objects and blocks, so that its number is not
//! reused and its absence differs from a loss. Its blocks go when no other version names
//! them. A crash in between leaves unreferenced blocks, which `fsck --collect` removes. Not
//! here: whether a version is in use.

use std::collections::BTreeSet;

use uuid::Uuid;

use super::{BlockEntry, Catalogue, Catalogues, Manifest};
use crate::engine::{Commit, Expected};
use crate::error::{StoreError, conflict};
use crate::holding;
use crate::key::{self, Space};
use crate::pieces;
use crate::record;

/// Training parameters of a removed version's manifest.
const REMOVED: &str = "removed";
/// Number of manifests per read.
const MANIFESTS_PER_SCAN: usize = 16;

impl Manifest {
    /// Whether the version was removed.
    pub(super) fn is_removed(&self) -> bool {
        self.parameters == REMOVED && self.blocks.is_empty()
    }

    /// The manifest that stands for a removed version.
    pub(super) fn removed(&self) -> Self {
        Self {
            job: None,
            parameters: REMOVED.to_owned(),
            objects: Vec::new(),
            blocks: Vec::new(),
            ..self.clone()
        }
    }
}

impl Catalogues {
    /// Removes a version and the blocks that no other version names. The version must not be
    /// in use, and no version may be published meanwhile.
    ///
    /// # Errors
    /// [`StoreError::NoVersion`], [`StoreError::Changed`], [`StoreError::Damaged`]; the engine's.
    pub async fn remove_version(&self, catalogue: Uuid, version: u32) -> Result<(), StoreError> {
        let manifest = self.manifest(catalogue, version)?;
        let named = self.blocks_of_others(&manifest)?;
        let head = key::numbered(Space::Version, catalogue, u64::from(version));
        let before = pieces::read(&*self.engine, Space::Version, &head)?
            .ok_or(StoreError::NoVersion { catalogue, version })?;
        let commit = Commit::new().expect(head.clone(), Expected::Value(pieces::first(&before)));
        let after = record::encode(&manifest.removed());
        let commit = pieces::put(commit, &head, &after, Some(&before));
        match self.engine.commit(commit).await.map_err(conflict) {
            Ok(()) => {}
            Err(Ok(_)) => return Err(StoreError::Changed { what: "version", id: catalogue }),
            Err(Err(error)) => return Err(error.into()),
        }
        let freed: BTreeSet<[u8; 32]> = manifest.blocks.iter().map(|block| block.hash).collect();
        for hash in freed.difference(&named) {
            pieces::remove_all(&*self.engine, &key::hash(Space::Block, hash)).await?;
        }
        Ok(holding::release(&*self.engine, &head).await?)
    }

    /// Removes a catalogue with all its versions, which must not be in use; no version may be
    /// published meanwhile.
    ///
    /// # Errors
    /// As [`Catalogues::remove_version`].
    pub async fn remove(&self, catalogue: Uuid) -> Result<(), StoreError> {
        loop {
            let manifests = self.manifests(catalogue, 0, MANIFESTS_PER_SCAN)?;
            if manifests.is_empty() {
                break;
            }
            for manifest in manifests {
                self.remove_version(catalogue, manifest.version).await?;
            }
        }
        self.table.remove(catalogue).await?;
        pieces::remove_all(&*self.engine, &key::id(Space::Version, catalogue)).await?;
        for space in [Space::Version, Space::Catalogue] {
            holding::release(&*self.engine, &key::id(space, catalogue)).await?;
        }
        Ok(())
    }

    /// The blocks that other versions of any catalogue name.
    fn blocks_of_others(&self, version: &Manifest) -> Result<BTreeSet<[u8; 32]>, StoreError> {
        let mut named = BTreeSet::new();
        for Catalogue { id, .. } in self.table.all()? {
            let mut after = 0;
            loop {
                let manifests = self.manifests(id, after, MANIFESTS_PER_SCAN)?;
                let Some(last) = manifests.last() else { break };
                after = last.version;
                let is_other = |other: &&Manifest| {
                    (other.catalogue, other.version) != (version.catalogue, version.version)
                };
                let blocks = manifests.iter().filter(is_other).flat_map(|other| &other.blocks);
                named.extend(blocks.map(|BlockEntry { hash, .. }| *hash));
            }
        }
        Ok(named)
    }
}
