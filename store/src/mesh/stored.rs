//! The stored form of a mesh's metadata.

use bincode::{Decode, Encode};
use uuid::Uuid;

use super::{MeshFormat, MeshInfo, MeshUnit};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, code, coded, read, write};

#[derive(Encode, Decode)]
struct MeshRecordV1 {
    upload: IdV1,
    format: u8,
    unit: u8,
    length: u64,
    hash: [u8; 32],
    uploaded_at_ms: u64,
}

const MESH_FORMATS: [MeshFormat; 4] =
    [MeshFormat::Stl, MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Off];
const MESH_UNITS: [MeshUnit; 4] =
    [MeshUnit::Metre, MeshUnit::Millimetre, MeshUnit::Centimetre, MeshUnit::Inch];

impl Record for MeshInfo {
    const KIND: Kind = Kind::Mesh;

    fn to_payload(&self) -> Vec<u8> {
        write(&MeshRecordV1 {
            upload: self.upload.into_bytes(),
            format: code(&MESH_FORMATS, &self.format),
            unit: code(&MESH_UNITS, &self.unit),
            length: self.length,
            hash: self.hash,
            uploaded_at_ms: self.uploaded_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: MeshRecordV1 = read(payload)?;
        Ok(Self {
            upload: Uuid::from_bytes(stored.upload),
            format: coded(&MESH_FORMATS, "format", stored.format)?,
            unit: coded(&MESH_UNITS, "unit", stored.unit)?,
            length: stored.length,
            hash: stored.hash,
            uploaded_at_ms: stored.uploaded_at_ms,
        })
    }
}
