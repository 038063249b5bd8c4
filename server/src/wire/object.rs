//! Conversion of objects and their meshes.

use palpate_schemas as wire;
use palpate_sim::mesh::{MeshFile, MeshFormat};
use palpate_store::entity::Object;
use palpate_store::mesh as store;
use thiserror::Error;

use crate::wire::{Invalid, count, time};

/// A stored object in its wire form.
pub(crate) fn object(
    object: &Object,
    mesh: Option<&store::MeshInfo>,
    n_readings: u64,
) -> wire::ObjectInfo {
    wire::ObjectInfo {
        id: object.id,
        name: object.name.clone(),
        description: object.description.clone(),
        labels: object.labels.clone(),
        mesh: mesh.map(mesh_info),
        n_readings: count(n_readings),
        created_at: time(object.created_at_ms),
        updated_at: time(object.updated_at_ms),
    }
}

/// The metadata of a mesh in their wire form.
pub(crate) fn mesh_info(info: &store::MeshInfo) -> wire::MeshInfo {
    wire::MeshInfo {
        format: match info.format {
            store::MeshFormat::Stl => wire::MeshFormat::Stl,
            store::MeshFormat::Obj => wire::MeshFormat::Obj,
            store::MeshFormat::Ply => wire::MeshFormat::Ply,
            store::MeshFormat::Off => wire::MeshFormat::Off,
            store::MeshFormat::Glb => wire::MeshFormat::Glb,
            store::MeshFormat::ThreeMf => wire::MeshFormat::ThreeMf,
        },
        unit: shown_unit(info.unit),
        bytes: info.length,
        hash: info.hash.iter().map(|byte| format!("{byte:02x}")).collect(),
        uploaded_at: time(info.uploaded_at_ms),
    }
}

/// The interpretation of a mesh.
pub(crate) fn mesh_report(info: &store::MeshInfo, file: &MeshFile) -> wire::MeshReport {
    let mesh = &file.mesh;
    let size = mesh.extent().to_array();
    wire::MeshReport {
        mesh: mesh_info(info),
        n_triangles: count(mesh.triangles().len()),
        n_vertices: count(mesh.vertices().len()),
        size,
        warnings: file.remarks.iter().map(ToString::to_string).collect(),
    }
}

/// Error of an upload of unknown format.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub(crate) enum FormatError {
    #[error("the content type is {found:?}, expected {MESH_TYPES}")]
    ContentType { found: String },
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

/// The content types of an upload.
const MESH_TYPES: &str = "model/stl, model/obj, model/ply, model/off, model/gltf-binary, model/3mf, \
    or application/octet-stream with ?format=";

/// The format of an upload, from its content type or the query.
pub(crate) fn mesh_format(
    content_type: &str,
    asked: Option<wire::MeshFormat>,
) -> Result<MeshFormat, FormatError> {
    match (MeshFormat::from_media_type(content_type), asked) {
        (Some(format), None) => Ok(format),
        (Some(format), Some(asked)) if format == sim_format(asked) => Ok(format),
        (Some(format), Some(asked)) => {
            let asked = sim_format(asked).extension();
            let detail = format!("came {asked}, but the content type is that of {format}");
            Err(Invalid::field("?format", detail).into())
        }
        (None, Some(asked)) if content_type == "application/octet-stream" => Ok(sim_format(asked)),
        (None, None) if content_type == "application/octet-stream" => Err(Invalid::field(
            "?format",
            "missing, expected stl, obj, ply, off, glb or 3mf with application/octet-stream",
        )
        .into()),
        (None, _) => Err(FormatError::ContentType { found: content_type.to_owned() }),
    }
}

/// Metres in one unit of a mesh's coordinates.
pub(crate) fn unit_metres(unit: store::MeshUnit) -> f64 {
    shown_unit(unit).metres()
}

/// The unit of a file in its stored form; micrometres and feet, which only 3MF has, in a like one.
pub(crate) fn stored_unit(metres: f64) -> store::MeshUnit {
    match metres {
        0.5.. => store::MeshUnit::Metre,
        0.02.. => store::MeshUnit::Inch,
        0.005.. => store::MeshUnit::Centimetre,
        _ => store::MeshUnit::Millimetre,
    }
}

fn shown_unit(unit: store::MeshUnit) -> wire::MeshUnit {
    match unit {
        store::MeshUnit::Metre => wire::MeshUnit::M,
        store::MeshUnit::Millimetre => wire::MeshUnit::Mm,
        store::MeshUnit::Centimetre => wire::MeshUnit::Cm,
        store::MeshUnit::Inch => wire::MeshUnit::In,
    }
}

/// The format in its stored form.
pub(crate) fn stored_format(format: MeshFormat) -> store::MeshFormat {
    match format {
        MeshFormat::Stl => store::MeshFormat::Stl,
        MeshFormat::Obj => store::MeshFormat::Obj,
        MeshFormat::Ply => store::MeshFormat::Ply,
        MeshFormat::Off => store::MeshFormat::Off,
        MeshFormat::Glb => store::MeshFormat::Glb,
        MeshFormat::ThreeMf => store::MeshFormat::ThreeMf,
    }
}

/// A stored format in the form of the mesh parsers.
pub(crate) fn read_format(format: store::MeshFormat) -> MeshFormat {
    match format {
        store::MeshFormat::Stl => MeshFormat::Stl,
        store::MeshFormat::Obj => MeshFormat::Obj,
        store::MeshFormat::Ply => MeshFormat::Ply,
        store::MeshFormat::Off => MeshFormat::Off,
        store::MeshFormat::Glb => MeshFormat::Glb,
        store::MeshFormat::ThreeMf => MeshFormat::ThreeMf,
    }
}

fn sim_format(format: wire::MeshFormat) -> MeshFormat {
    match format {
        wire::MeshFormat::Stl => MeshFormat::Stl,
        wire::MeshFormat::Obj => MeshFormat::Obj,
        wire::MeshFormat::Ply => MeshFormat::Ply,
        wire::MeshFormat::Off => MeshFormat::Off,
        wire::MeshFormat::Glb => MeshFormat::Glb,
        wire::MeshFormat::ThreeMf => MeshFormat::ThreeMf,
    }
}
