//! Meshes of objects: the files as uploaded, with their format and unit.
//!
//! An upload is written under its own id, piece by piece; one commit then makes it the
//! object's mesh, and the previous file is removed. A crash in between leaves the old one.

mod reader;
mod stored;

use std::sync::Arc;

use uuid::Uuid;

use crate::engine::{Commit, Engine, EngineError, Expected};
use crate::envelope::{self, Kind};
use crate::error::{RecordError, StoreError, conflict};
use crate::holding;
use crate::key::{self, Space};
use crate::pieces;
use crate::record::{self, SCHEMA};
pub use reader::MeshReader;

/// Attempts to read a mesh that is being replaced.
const OPEN_ATTEMPTS: usize = 16;

/// The format of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// STL, binary or text.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// PLY, binary or text.
    Ply,
    /// Geomview OFF.
    Off,
    /// Binary glTF.
    Glb,
    /// 3MF.
    ThreeMf,
}

/// The unit of a mesh's coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshUnit {
    /// Metres.
    Metre,
    /// Millimetres.
    Millimetre,
    /// Centimetres.
    Centimetre,
    /// Inches of 25.4 mm.
    Inch,
}

/// Metadata of a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshInfo {
    /// Id of the upload.
    pub upload: Uuid,
    /// Format of the file.
    pub format: MeshFormat,
    /// Unit of the coordinates.
    pub unit: MeshUnit,
    /// Length of the file in bytes.
    pub length: u64,
    /// BLAKE3 hash of the file.
    pub hash: [u8; 32],
    /// Time of the upload.
    pub uploaded_at_ms: u64,
}

impl MeshInfo {
    /// The metadata of a file; `upload` must be new.
    #[must_use]
    pub fn new(
        upload: Uuid,
        format: MeshFormat,
        unit: MeshUnit,
        file: &[u8],
        uploaded_at_ms: u64,
    ) -> Self {
        let hash = *blake3::hash(file).as_bytes();
        Self { upload, format, unit, length: file.len() as u64, hash, uploaded_at_ms }
    }
}

/// The meshes of all objects.
#[derive(Clone)]
pub struct Meshes {
    engine: Arc<dyn Engine>,
}

impl Meshes {
    pub(crate) fn new(engine: Arc<dyn Engine>) -> Self {
        Self { engine }
    }

    /// Makes `file` the mesh of `object`. `info` describes it ([`MeshInfo::new`]).
    ///
    /// # Errors
    /// [`StoreError::Changed`] when another upload for the object won; the engine's.
    pub async fn put(&self, object: Uuid, info: &MeshInfo, file: &[u8]) -> Result<(), StoreError> {
        let head = key::id(Space::Mesh, object);
        let before = self.engine.get(&head)?;
        let file_key = key::nested(Space::MeshFile, object, info.upload);
        let sealed = envelope::seal(Kind::MeshFile, SCHEMA, file);
        if let Err(error) = pieces::write_large(&*self.engine, &file_key, &sealed).await {
            // The part that was written is removed, if the engine still removes.
            if let Err(error) = self.remove_file(&file_key).await {
                tracing::warn!(%error, "Cannot remove what was stored of a mesh that did not fit");
            }
            return Err(error.into());
        }
        let expected = before.clone().map_or(Expected::Absent, Expected::Value);
        let commit = Commit::new().expect(head.clone(), expected).put(head, record::encode(info));
        match self.engine.commit(commit).await.map_err(conflict) {
            Ok(()) => {}
            Err(Ok(_)) => {
                self.remove_file(&file_key).await?;
                return Err(StoreError::Changed { what: "mesh of object", id: object });
            }
            Err(Err(error)) => return Err(error.into()),
        }
        if let Some(Ok(before)) = before.map(|bytes| record::decode::<MeshInfo>(&bytes)) {
            let replaced = key::nested(Space::MeshFile, object, before.upload);
            self.remove_file(&replaced).await?;
        }
        Ok(())
    }

    async fn remove_file(&self, file_key: &[u8]) -> Result<(), EngineError> {
        pieces::remove_all(&*self.engine, file_key).await?;
        holding::release(&*self.engine, file_key).await
    }

    /// The metadata of an object's mesh, if it has one.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn info(&self, object: Uuid) -> Result<Option<MeshInfo>, StoreError> {
        let Some(bytes) = self.engine.get(&key::id(Space::Mesh, object))? else {
            return Ok(None);
        };
        record::decode(&bytes).map(Some).map_err(StoreError::damaged(Space::Mesh))
    }

    /// An object's mesh with its complete file, checked against its hash.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn get(&self, object: Uuid) -> Result<Option<(MeshInfo, Vec<u8>)>, StoreError> {
        let Some(info) = self.info(object)? else { return Ok(None) };
        let damaged = StoreError::damaged(Space::MeshFile);
        let head = key::nested(Space::MeshFile, object, info.upload);
        let Some(sealed) = pieces::read(&*self.engine, Space::MeshFile, &head)? else {
            // Replaced or removed in the meantime.
            return match self.info(object)? {
                Some(now) if now.upload != info.upload => self.get(object),
                Some(_) => Err(damaged(RecordError::Piece { piece: 0 })),
                None => Ok(None),
            };
        };
        let file = open_raw(Kind::MeshFile, &sealed, &info.hash).map_err(damaged)?;
        Ok(Some((info, file)))
    }

    /// A reader of an object's mesh, block by block, with its first block read.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn open(&self, object: Uuid) -> Result<Option<MeshReader>, StoreError> {
        for _ in 0..OPEN_ATTEMPTS {
            let Some(info) = self.info(object)? else { return Ok(None) };
            if let Some(reader) = MeshReader::open(Arc::clone(&self.engine), object, info)? {
                return Ok(Some(reader));
            }
            // Replaced in the meantime.
        }
        Err(StoreError::damaged(Space::MeshFile)(RecordError::Piece { piece: 0 }))
    }

    /// Removes an object's mesh.
    ///
    /// # Errors
    /// The engine's.
    pub async fn remove(&self, object: Uuid) -> Result<(), StoreError> {
        for space in [Space::Mesh, Space::MeshFile] {
            pieces::remove_all(&*self.engine, &key::id(space, object)).await?;
        }
        Ok(())
    }
}

/// The raw payload of a sealed record, checked against its hash.
pub(crate) fn open_raw(
    kind: Kind,
    sealed: &[u8],
    expected: &[u8; 32],
) -> Result<Vec<u8>, RecordError> {
    let opened = envelope::open(kind, sealed)?;
    if opened.schema != SCHEMA {
        return Err(RecordError::Schema { found: opened.schema, known: SCHEMA });
    }
    let found = blake3::hash(opened.payload);
    if found.as_bytes() != expected {
        let expected = blake3::Hash::from_bytes(*expected).to_hex().to_string();
        return Err(RecordError::Hash { expected, found: found.to_hex().to_string() });
    }
    Ok(opened.payload.to_vec())
}
