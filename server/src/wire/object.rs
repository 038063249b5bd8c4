//! Conversion of objects and their meshes.

use palpate_core::units::Shown;
use palpate_schemas as wire;
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_store::entity::Object;
use palpate_store::mesh as store;
use thiserror::Error;

use crate::hints::{SIZE_LARGE, SIZE_SMALL};
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
        },
        unit: shown_unit(info.unit),
        bytes: info.length,
        hash: info.hash.iter().map(|byte| format!("{byte:02x}")).collect(),
        uploaded_at: time(info.uploaded_at_ms),
    }
}

/// The interpretation of a mesh.
pub(crate) fn mesh_report(info: &store::MeshInfo, mesh: &Mesh) -> wire::MeshReport {
    let size = mesh.extent().to_array();
    wire::MeshReport {
        mesh: mesh_info(info),
        n_triangles: count(mesh.triangles().len()),
        n_vertices: count(mesh.vertices().len()),
        size,
        warnings: warnings(mesh, info.unit),
    }
}

fn warnings(mesh: &Mesh, unit: store::MeshUnit) -> Vec<String> {
    let size = mesh.largest_dimension();
    let mut warnings = Vec::new();
    let unit = shown_unit(unit);
    if size > SIZE_LARGE {
        let other = if unit == wire::MeshUnit::Mm { "" } else { ": is the file in mm?" };
        warnings.push(format!("the mesh is {} m large{other}", Shown(size)));
    }
    if size < SIZE_SMALL {
        let other = if unit == wire::MeshUnit::M { "" } else { ": is the file in m?" };
        warnings.push(format!("the mesh is {} mm small{other}", Shown(size * 1e3)));
    }
    if !mesh.is_watertight() {
        warnings.push("the mesh is not watertight: its surface has holes or seams".to_owned());
    }
    warnings
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
const MESH_TYPES: &str =
    "model/stl, model/obj, model/ply, model/off, or application/octet-stream with ?format=";

/// The format of an upload, from its content type or the query.
pub(crate) fn mesh_format(
    content_type: &str,
    asked: Option<wire::MeshFormat>,
) -> Result<MeshFormat, FormatError> {
    match (MeshFormat::from_media_type(content_type), asked) {
        (Some(format), None) => Ok(format),
        (Some(format), Some(asked)) if format == sim_format(asked) => Ok(format),
        (Some(format), Some(asked)) => {
            let asked = sim_format(asked);
            let detail = format!("came {asked}, but the content type is that of {format}");
            Err(Invalid::field("?format", detail).into())
        }
        (None, Some(asked)) if content_type == "application/octet-stream" => Ok(sim_format(asked)),
        (None, None) if content_type == "application/octet-stream" => Err(Invalid::field(
            "?format",
            "missing, expected stl, obj, ply or off with application/octet-stream",
        )
        .into()),
        (None, _) => Err(FormatError::ContentType { found: content_type.to_owned() }),
    }
}

/// Metres in one unit of a mesh's coordinates.
pub(crate) fn unit_metres(unit: store::MeshUnit) -> f64 {
    shown_unit(unit).metres()
}

/// The unit in its stored form.
pub(crate) fn stored_unit(unit: wire::MeshUnit) -> store::MeshUnit {
    match unit {
        wire::MeshUnit::M => store::MeshUnit::Metre,
        wire::MeshUnit::Mm => store::MeshUnit::Millimetre,
        wire::MeshUnit::Cm => store::MeshUnit::Centimetre,
        wire::MeshUnit::In => store::MeshUnit::Inch,
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
    }
}

/// A stored format in the form of the mesh parsers.
pub(crate) fn read_format(format: store::MeshFormat) -> MeshFormat {
    match format {
        store::MeshFormat::Stl => MeshFormat::Stl,
        store::MeshFormat::Obj => MeshFormat::Obj,
        store::MeshFormat::Ply => MeshFormat::Ply,
        store::MeshFormat::Off => MeshFormat::Off,
    }
}

fn sim_format(format: wire::MeshFormat) -> MeshFormat {
    match format {
        wire::MeshFormat::Stl => MeshFormat::Stl,
        wire::MeshFormat::Obj => MeshFormat::Obj,
        wire::MeshFormat::Ply => MeshFormat::Ply,
        wire::MeshFormat::Off => MeshFormat::Off,
    }
}
