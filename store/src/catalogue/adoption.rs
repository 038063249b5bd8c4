//! Adoption of versions of another server: with their catalogue's id, their numbers and their
//! blocks, so that both servers know the same version.
//!
//! Blocks are written first, each checked against its hash; the manifest follows when all are
//! there. Numbers below that this server never had get the manifest of a removed version.

use thiserror::Error;
use uuid::Uuid;

use super::{BlockEntry, Catalogue, Catalogues, Manifest, block_hash};
use crate::engine::Commit;
use crate::envelope::{self, Kind};
use crate::error::StoreError;
use crate::key::{self, Space};
use crate::pieces;
use crate::record::{self, SCHEMA};

/// Error of a version that was not adopted.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AdoptError {
    /// The content of a block is not that of its hash.
    #[error("block {name:?} came with another content than its hash says")]
    Content {
        /// The block's name.
        name: String,
    },
    /// A block is missing.
    #[error("block {name:?} is missing")]
    Missing {
        /// The block's name.
        name: String,
    },
    /// The name belongs to another catalogue.
    #[error(
        "catalogue {name:?} of this server is another one, {here}, than {there} of the other \
         server: delete it, or restore a snapshot of the other server"
    )]
    OtherCatalogue {
        /// The name.
        name: String,
        /// The catalogue that has it.
        here: Uuid,
        /// The catalogue to adopt.
        there: Uuid,
    },
    /// The number belongs to another version.
    #[error("version {version} of this server has another content than that of the other server")]
    OtherVersion {
        /// The number.
        version: u32,
    },
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl Manifest {
    /// A hash of what the version is: its catalogue, its number, and the names and contents of its
    /// objects and blocks.
    #[must_use]
    pub fn hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.catalogue.as_bytes()).update(&self.version.to_le_bytes());
        let mut text = |text: &str| {
            hasher.update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
        };
        for object in &self.objects {
            text(&object.id.to_string());
            text(&object.name);
        }
        for block in &self.blocks {
            text(&block.name);
            text(&blake3::Hash::from_bytes(block.hash).to_hex());
        }
        *hasher.finalize().as_bytes()
    }
}

impl Catalogues {
    /// Whether the store has a block, undamaged.
    ///
    /// # Errors
    /// The engine's.
    pub fn has_block(&self, entry: &BlockEntry) -> Result<bool, StoreError> {
        match self.block(entry) {
            Ok(_) => Ok(true),
            Err(StoreError::Damaged { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Stores a block of a version that will be adopted.
    ///
    /// # Errors
    /// [`AdoptError::Content`]; the engine's.
    pub async fn adopt_block(&self, entry: &BlockEntry, content: &[u8]) -> Result<(), AdoptError> {
        if block_hash(content) != entry.hash || content.len() as u64 != entry.length {
            return Err(AdoptError::Content { name: entry.name.clone() });
        }
        let sealed = envelope::seal(Kind::Block, SCHEMA, content);
        let head = key::hash(Space::Block, &entry.hash);
        Ok(pieces::write_large(&*self.engine, &head, &sealed).await.map_err(StoreError::from)?)
    }

    /// Adopts a version whose blocks are stored, with its catalogue if that is new. It does not
    /// become current. No version may be published or removed meanwhile.
    ///
    /// # Errors
    /// [`AdoptError`].
    pub async fn adopt(&self, name: &str, manifest: &Manifest) -> Result<(), AdoptError> {
        let id = manifest.catalogue;
        match self.find_by_name(name)? {
            None => {
                let new = Catalogue::new(id, name.to_owned(), manifest.created_at_ms);
                self.create(&new).await?;
            }
            Some(here) if here.id != id => {
                let (name, here) = (name.to_owned(), here.id);
                return Err(AdoptError::OtherCatalogue { name, here, there: id });
            }
            Some(_) => {}
        }
        let version = manifest.version;
        match self.manifest(id, version) {
            Ok(known) if known.hash() == manifest.hash() => return Ok(()),
            Ok(_) => return Err(AdoptError::OtherVersion { version }),
            Err(StoreError::NoVersion { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        for block in &manifest.blocks {
            if !self.has_block(block)? {
                return Err(AdoptError::Missing { name: block.name.clone() });
            }
        }
        let bytes = manifest.blocks.iter().map(|block| block.length).sum::<u64>();
        let head = |version: u32| key::numbered(Space::Version, id, u64::from(version));
        let before = pieces::read(&*self.engine, Space::Version, &head(version))?;
        let adopted = self.table.update_with(id, |now| {
            let mut commit = Commit::new();
            for absent in now.latest + 1..version {
                let removed = Manifest { version: absent, ..manifest.removed() };
                commit = pieces::put(commit, &head(absent), &record::encode(&removed), None);
            }
            now.latest = now.latest.max(version);
            let record = record::encode(manifest);
            let commit = pieces::put(commit, &head(version), &record, before.as_deref());
            Ok::<_, AdoptError>(Commit { counted: vec![(head(version), bytes)], ..commit })
        });
        adopted.await??;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::VersionObject;
    use crate::database::Database;

    fn version(catalogue: u128, version: u32, content: &[u8]) -> Manifest {
        let block = BlockEntry {
            name: "vocabulary".to_owned(),
            hash: block_hash(content),
            length: content.len() as u64,
        };
        Manifest {
            catalogue: Uuid::from_u128(catalogue),
            version,
            job: None,
            parameters: "{}".to_owned(),
            objects: vec![VersionObject { id: Uuid::from_u128(9), name: "mug".to_owned() }],
            blocks: vec![block],
            created_at_ms: 5,
        }
    }

    #[tokio::test]
    async fn a_version_is_adopted_with_its_id_number_and_blocks() {
        let catalogues = Database::in_memory().catalogues();
        let third = version(1, 3, b"third");
        let missing = catalogues.adopt("default", &third).await.unwrap_err();
        assert_eq!(missing, AdoptError::Missing { name: "vocabulary".to_owned() });
        let other = catalogues.adopt_block(&third.blocks[0], b"forged").await.unwrap_err();
        assert_eq!(other, AdoptError::Content { name: "vocabulary".to_owned() });
        catalogues.adopt_block(&third.blocks[0], b"third").await.unwrap();
        catalogues.adopt("default", &third).await.unwrap();
        catalogues.adopt("default", &third).await.unwrap();
        assert_eq!(catalogues.manifest(third.catalogue, 3).unwrap(), third);
        assert_eq!(catalogues.block(&third.blocks[0]).unwrap(), b"third");
        assert_eq!(catalogues.get(third.catalogue).unwrap().latest, 3);
        let absent = catalogues.manifest(third.catalogue, 2).unwrap_err();
        assert!(matches!(absent, StoreError::NoVersion { version: 2, .. }), "{absent}");

        // An older one that becomes current again takes its place among them.
        let second = version(1, 2, b"second");
        catalogues.adopt_block(&second.blocks[0], b"second").await.unwrap();
        catalogues.adopt("default", &second).await.unwrap();
        assert_eq!(catalogues.manifest(third.catalogue, 2).unwrap(), second);
        assert_eq!(catalogues.get(third.catalogue).unwrap().latest, 3);
    }

    #[tokio::test]
    async fn other_content_under_a_name_or_number_is_refused() {
        let catalogues = Database::in_memory().catalogues();
        let first = version(1, 1, b"first");
        catalogues.adopt_block(&first.blocks[0], b"first").await.unwrap();
        catalogues.adopt("default", &first).await.unwrap();
        let other = version(1, 1, b"other");
        catalogues.adopt_block(&other.blocks[0], b"other").await.unwrap();
        let refused = catalogues.adopt("default", &other).await.unwrap_err();
        assert_eq!(refused, AdoptError::OtherVersion { version: 1 });
        let foreign = catalogues.adopt("default", &version(2, 1, b"first")).await.unwrap_err();
        assert!(matches!(foreign, AdoptError::OtherCatalogue { .. }), "{foreign}");
        assert_eq!(catalogues.manifest(first.catalogue, 1).unwrap(), first);
    }
}
