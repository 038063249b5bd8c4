//! Versions as packages: what a cell fetches from the central service, and how it takes that over.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use palpate_schemas as wire;
use palpate_store::catalogue::{BlockEntry, Manifest};
use palpate_store::record;
use uuid::Uuid;

use super::{CatalogueError, Catalogues, number};
use crate::cause::Cause;
use crate::clock::now_ms;

impl Catalogues {
    /// The hash of a version's content, in hexadecimal.
    pub(crate) fn hash(&self, name: &str, version: u32) -> Result<String, CatalogueError> {
        let manifest = self.manifest(&self.find(name)?, version)?;
        Ok(hex(&manifest.hash()))
    }

    /// Refuses a version of another content than the hash says.
    pub(crate) fn expect_hash(
        &self,
        name: &str,
        version: u32,
        expected: &str,
    ) -> Result<(), CatalogueError> {
        let found = self.hash(name, version)?;
        if found.eq_ignore_ascii_case(expected) {
            return Ok(());
        }
        let (catalogue, expected) = (name.to_owned(), expected.to_owned());
        Err(CatalogueError::OtherContent { catalogue, version, expected, found })
    }

    /// A version as a package.
    pub(crate) fn package(
        &self,
        name: &str,
        version: &str,
    ) -> Result<wire::VersionPackage, CatalogueError> {
        let catalogue = self.find(name)?;
        let manifest = self.manifest(&catalogue, number(version)?)?;
        Ok(wire::VersionPackage {
            catalogue: catalogue.name,
            version: manifest.version,
            hash: hex(&manifest.hash()),
            record: STANDARD.encode(record::encode(&manifest)),
            bytes: manifest.blocks.iter().map(|block| block.length).sum(),
            blocks: manifest.blocks.iter().map(|block| hex(&block.hash)).collect(),
        })
    }

    /// The content of a version's block, by its hash. Blocks.
    pub(crate) fn block(
        &self,
        name: &str,
        version: &str,
        hash: &str,
    ) -> Result<Vec<u8>, CatalogueError> {
        let manifest = self.manifest(&self.find(name)?, number(version)?)?;
        let block = manifest.blocks.iter().find(|block| hex(&block.hash) == hash);
        let block = block.ok_or_else(|| Cause::unknown("block", hash))?;
        Ok(self.table.block(block)?)
    }

    /// The blocks of a version of another server that this one does not have. Blocks.
    pub(crate) fn missing_blocks(
        &self,
        manifest: &Manifest,
    ) -> Result<Vec<BlockEntry>, CatalogueError> {
        let mut missing = Vec::new();
        for block in &manifest.blocks {
            if !self.table.has_block(block)? {
                missing.push(block.clone());
            }
        }
        Ok(missing)
    }

    /// Stores a block of another server's version.
    pub(crate) async fn adopt_block(
        &self,
        block: &BlockEntry,
        content: &[u8],
    ) -> Result<(), CatalogueError> {
        Ok(self.table.adopt_block(block, content).await?)
    }

    /// Takes over a version whose blocks are stored, and makes it current.
    pub(crate) async fn adopt(
        &self,
        name: &str,
        manifest: &Manifest,
    ) -> Result<(), CatalogueError> {
        crate::wire::name(name).map_err(Cause::from)?;
        let _alone = self.alone().await?;
        self.table.adopt(name, manifest).await?;
        let (id, version) = (manifest.catalogue, manifest.version);
        if self.table.get(id)?.current != Some(version) {
            self.table.switch(id, version, None, now_ms()).await?;
            tracing::info!("Version {version} of catalogue {name:?} came from the central service");
        }
        Ok(())
    }

    /// Whether a catalogue has a version current, of this id and content.
    pub(crate) fn is_current(&self, name: &str, manifest: &Manifest) -> Result<bool, Cause> {
        let Some(here) = self.table.find_by_name(name)? else { return Ok(false) };
        let id: Uuid = manifest.catalogue;
        if here.id != id || here.current != Some(manifest.version) {
            return Ok(false);
        }
        Ok(self.table.manifest(id, manifest.version)?.hash() == manifest.hash())
    }

    /// The number of a catalogue's current version, if it has one.
    pub(crate) fn current(&self, name: &str) -> Result<Option<u32>, Cause> {
        Ok(self.table.find_by_name(name)?.and_then(|catalogue| catalogue.current))
    }
}

/// The version of a package.
pub(crate) fn unpacked(package: &wire::VersionPackage) -> Result<Manifest, Cause> {
    let bytes = STANDARD.decode(&package.record);
    let bytes = bytes.map_err(|error| Cause::field("/record", error))?;
    let manifest: Manifest =
        record::decode(&bytes).map_err(|error| Cause::field("/record", error))?;
    if hex(&manifest.hash()) != package.hash || manifest.version != package.version {
        return Err(Cause::field("/hash", "is not that of the record"));
    }
    Ok(manifest)
}

/// Bytes in hexadecimal.
pub(crate) fn hex(hash: &[u8; 32]) -> String {
    blake3::Hash::from_bytes(*hash).to_hex().to_string()
}
