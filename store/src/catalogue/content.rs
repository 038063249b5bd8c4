//! Reading of a version's content: its blocks, and the model and symmetries that they make.

use std::collections::BTreeMap;

use palpate_core::stop::Stop;
use palpate_core::symmetry::Symmetry;
use uuid::Uuid;

use super::{BlockEntry, Catalogues, Manifest, VersionObject};
use crate::envelope::Kind;
use crate::error::{RecordError, StoreError};
use crate::key::{self, Space};
use crate::mesh::open_raw;
use crate::model::TrainedModel;
use crate::model_codec::{self, CodecError, ModelPart};
use crate::pieces;

impl Catalogues {
    /// The content of a block, checked against its hash.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], also when it is missing; the engine's.
    pub fn block(&self, entry: &BlockEntry) -> Result<Vec<u8>, StoreError> {
        let damaged = StoreError::damaged(Space::Block);
        let head = key::hash(Space::Block, &entry.hash);
        let sealed = pieces::read(&*self.engine, Space::Block, &head)?
            .ok_or_else(|| damaged(RecordError::Piece { piece: 0 }))?;
        let content = open_raw(Kind::Block, &sealed, &entry.hash).map_err(&damaged)?;
        if content.len() as u64 != entry.length {
            let (consumed, length) = (content.len(), entry.length as usize);
            return Err(damaged(RecordError::Trailing { consumed, length }));
        }
        Ok(content)
    }

    /// All blocks of a version, in the manifest's order: names and contents.
    ///
    /// # Errors
    /// As [`Catalogues::block`].
    pub fn blocks(&self, manifest: &Manifest) -> Result<Vec<(String, Vec<u8>)>, StoreError> {
        let content = |entry: &BlockEntry| Ok((entry.name.clone(), self.block(entry)?));
        manifest.blocks.iter().map(content).collect()
    }

    /// The trained model of a version. Heeds `stop` between blocks.
    ///
    /// # Errors
    /// [`StoreError::Model`] when its blocks are inconsistent; else as [`Catalogues::block`].
    pub fn model(&self, manifest: &Manifest, stop: &Stop) -> Result<TrainedModel, StoreError> {
        self.model_of(manifest, |_| true, stop)
    }

    /// One part of the trained model of a version, without the others. Reads the blocks of
    /// that part alone, and heeds `stop` between them.
    ///
    /// # Errors
    /// As [`Catalogues::model`].
    pub fn model_part(
        &self,
        manifest: &Manifest,
        part: ModelPart,
        stop: &Stop,
    ) -> Result<TrainedModel, StoreError> {
        self.model_of(manifest, |name| part.needs(name), stop)
    }

    /// The model that some blocks of a version make.
    fn model_of(
        &self,
        manifest: &Manifest,
        is_needed: impl Fn(&str) -> bool,
        stop: &Stop,
    ) -> Result<TrainedModel, StoreError> {
        let objects: Vec<Uuid> = manifest.objects.iter().map(|object| object.id).collect();
        let needed = manifest.blocks.iter().filter(|block| is_needed(&block.name));
        let read = |entry: &BlockEntry| {
            stop.check();
            Ok((entry.name.clone(), self.block(entry)?))
        };
        let blocks: Result<Vec<(String, Vec<u8>)>, StoreError> = needed.map(read).collect();
        model_codec::model_from_blocks(&blocks?, &objects).map_err(unfit(manifest))
    }

    /// The symmetries of a version's objects, in its order; none for objects without such a block.
    ///
    /// # Errors
    /// As [`Catalogues::model`].
    pub fn symmetries(&self, manifest: &Manifest) -> Result<Vec<Symmetry>, StoreError> {
        let by_name: BTreeMap<&str, &BlockEntry> =
            manifest.blocks.iter().map(|block| (block.name.as_str(), block)).collect();
        let symmetry = |object: &VersionObject| {
            let name = model_codec::symmetry_block_name(object.id);
            let Some(entry) = by_name.get(name.as_str()) else { return Ok(Symmetry::NONE) };
            model_codec::symmetry_from_block(&self.block(entry)?).map_err(unfit(manifest))
        };
        manifest.objects.iter().map(symmetry).collect()
    }
}

/// The error of blocks that make no model.
fn unfit(manifest: &Manifest) -> impl FnOnce(CodecError) -> StoreError {
    let (catalogue, version) = (manifest.catalogue, manifest.version);
    move |source| StoreError::Model { catalogue, version, source }
}
