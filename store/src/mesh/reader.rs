//! A reader of a mesh file block by block, for slow consumers.
//!
//! Only one block is in memory. The last block is returned after the hash of the whole file
//! has been checked, so a damaged file never completes. A file replaced meanwhile gives an
//! error.

use std::sync::Arc;

use uuid::Uuid;

use super::MeshInfo;
use crate::engine::Engine;
use crate::envelope::{EnvelopeError, HEADER_BYTES, total_bytes};
use crate::error::{RecordError, StoreError};
use crate::key::{self, Space};
use crate::pieces::Rest;

/// Number of pieces of a block: 256 KiB.
const PIECES_PER_BLOCK: usize = 64;

/// A mesh file and the position in it.
pub struct MeshReader {
    engine: Arc<dyn Engine>,
    info: MeshInfo,
    rest: Rest,
    /// Number of bytes read.
    read: u64,
    hasher: blake3::Hasher,
    /// The last block read, not yet returned.
    block: Vec<u8>,
}

impl MeshReader {
    /// Opens the file of `info` and reads its first block; `None` when there is no file.
    pub(super) fn open(
        engine: Arc<dyn Engine>,
        object: Uuid,
        info: MeshInfo,
    ) -> Result<Option<Self>, StoreError> {
        let head = key::nested(Space::MeshFile, object, info.upload);
        let Some(first) = engine.get(&head)? else { return Ok(None) };
        let rest = Rest::behind(Space::MeshFile, &head, &first)?;
        let damaged = StoreError::damaged(Space::MeshFile);
        let total = total_bytes(&first).map_err(|error| damaged(error.into()))?;
        let expected = usize::try_from(info.length).unwrap_or(usize::MAX);
        if total.checked_sub(HEADER_BYTES) != Some(expected) {
            let error = EnvelopeError::Length { expected, found: total };
            return Err(damaged(error.into()));
        }
        let block = first[HEADER_BYTES..].to_vec();
        let mut hasher = blake3::Hasher::new();
        hasher.update(&block);
        let mut reader = Self { engine, info, rest, read: block.len() as u64, hasher, block };
        let more = reader.read_on()?;
        reader.block.extend_from_slice(&more);
        Ok(Some(reader))
    }

    /// The metadata of the mesh.
    #[must_use]
    pub fn info(&self) -> &MeshInfo {
        &self.info
    }

    /// The next block of the file, at most about 256 KiB; `None` at the end.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], also when the file is replaced meanwhile; the engine's.
    pub fn next_block(&mut self) -> Result<Option<Vec<u8>>, StoreError> {
        if self.block.is_empty() {
            return Ok(None);
        }
        let next = self.read_on()?;
        Ok(Some(std::mem::replace(&mut self.block, next)))
    }

    /// Reads one more block, and checks the file at its end.
    fn read_on(&mut self) -> Result<Vec<u8>, StoreError> {
        let block = self.rest.next(&*self.engine, PIECES_PER_BLOCK)?;
        self.hasher.update(&block);
        self.read += block.len() as u64;
        let found = self.hasher.finalize();
        if self.read >= self.info.length && found.as_bytes() != &self.info.hash {
            let expected = blake3::Hash::from_bytes(self.info.hash).to_hex().to_string();
            let error = RecordError::Hash { expected, found: found.to_hex().to_string() };
            return Err(StoreError::damaged(Space::MeshFile)(error));
        }
        Ok(block)
    }
}
