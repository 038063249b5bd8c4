//! The stored form of a mesh's metadata.

use uuid::Uuid;

use super::{MeshFormat, MeshInfo, MeshUnit};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{Record, code, coded, read, write};

const MESH_FORMATS: [MeshFormat; 6] = [
    MeshFormat::Stl,
    MeshFormat::Obj,
    MeshFormat::Ply,
    MeshFormat::Off,
    MeshFormat::Glb,
    MeshFormat::ThreeMf,
];
const MESH_UNITS: [MeshUnit; 4] =
    [MeshUnit::Metre, MeshUnit::Millimetre, MeshUnit::Centimetre, MeshUnit::Inch];

impl Record for MeshInfo {
    const KIND: Kind = Kind::Mesh;

    fn to_payload(&self) -> Vec<u8> {
        let (format, unit) = (code(&MESH_FORMATS, &self.format), code(&MESH_UNITS, &self.unit));
        let upload = self.upload.as_bytes();
        write(&(upload, format, unit, self.length, self.hash, self.uploaded_at_ms))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (upload, format, unit, length, hash, uploaded_at_ms) = read(payload)?;
        let format = coded(&MESH_FORMATS, "format", format)?;
        let unit = coded(&MESH_UNITS, "unit", unit)?;
        let upload = Uuid::from_bytes(upload);
        Ok(Self { upload, format, unit, length, hash, uploaded_at_ms })
    }
}
