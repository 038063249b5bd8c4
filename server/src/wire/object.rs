//! Objects and their meshes for the wire.

use palpate_schemas as wire;
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_store::entity::Object;
use palpate_store::mesh as store;

use crate::refusal::Refusal;
use crate::wire::{count, time};

/// Larger meshes are probably in another unit, in metres.
const SIZE_LARGE: f64 = 2.0;
/// Smaller meshes are probably in another unit, in metres.
const SIZE_SMALL: f64 = 0.005;

/// A stored object for the wire.
pub(crate) fn object(
    object: &Object,
    mesh: Option<&store::MeshInfo>,
    n_readings: u64,
) -> wire::ObjectInfo {
    wire::ObjectInfo {
        id: object.id,
        name: object.name.clone(),
        description: object.description.clone(),
        mesh: mesh.map(mesh_info),
        n_readings: count(n_readings),
        created_at: time(object.created_at_ms),
        updated_at: time(object.updated_at_ms),
    }
}

/// What is stored of a mesh, for the wire.
pub(crate) fn mesh_info(info: &store::MeshInfo) -> wire::MeshInfo {
    wire::MeshInfo {
        format: match info.format {
            store::MeshFormat::Stl => wire::MeshFormat::Stl,
            store::MeshFormat::Obj => wire::MeshFormat::Obj,
            store::MeshFormat::Ply => wire::MeshFormat::Ply,
            store::MeshFormat::Off => wire::MeshFormat::Off,
        },
        unit: match info.unit {
            store::MeshUnit::Metre => wire::MeshUnit::M,
            store::MeshUnit::Millimetre => wire::MeshUnit::Mm,
        },
        bytes: info.length,
        hash: info.hash.iter().map(|byte| format!("{byte:02x}")).collect(),
        uploaded_at: time(info.uploaded_at_ms),
    }
}

/// How a mesh was understood.
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
    if size > SIZE_LARGE {
        let other = if unit == store::MeshUnit::Metre { ": is the file in mm?" } else { "" };
        warnings.push(format!("the mesh is {size:.3} m large{other}"));
    }
    if size < SIZE_SMALL {
        let other = if unit == store::MeshUnit::Millimetre { ": is the file in m?" } else { "" };
        warnings.push(format!("the mesh is {:.4} mm small{other}", size * 1e3));
    }
    if !mesh.is_watertight() {
        warnings.push("the mesh is not watertight: its surface has holes or seams".to_owned());
    }
    warnings
}

/// The format of an upload, by its content type or by the query.
pub(crate) fn mesh_format(
    content_type: &str,
    asked: Option<wire::MeshFormat>,
) -> Result<MeshFormat, Refusal> {
    match (MeshFormat::from_media_type(content_type), asked) {
        (Some(format), None) => Ok(format),
        (Some(format), Some(asked)) if format == sim_format(asked) => Ok(format),
        (Some(format), Some(asked)) => {
            let detail = format!("came {asked:?}, but the content type is that of {format}");
            Err(Refusal::field("?format", detail))
        }
        (None, Some(asked)) if content_type == "application/octet-stream" => Ok(sim_format(asked)),
        (None, None) if content_type == "application/octet-stream" => Err(Refusal::field(
            "?format",
            "missing, expected stl, obj, ply or off with application/octet-stream",
        )),
        (None, _) => Err(Refusal::ContentType {
            found: content_type.to_owned(),
            expected: "model/stl, model/obj, model/ply, model/off, or application/octet-stream \
                       with ?format=",
        }),
    }
}

/// Metres in one unit of a mesh's coordinates.
pub(crate) fn unit_metres(unit: store::MeshUnit) -> f64 {
    match unit {
        store::MeshUnit::Metre => 1.0,
        store::MeshUnit::Millimetre => 1e-3,
    }
}

/// The unit as it is stored.
pub(crate) fn stored_unit(unit: wire::MeshUnit) -> store::MeshUnit {
    match unit {
        wire::MeshUnit::M => store::MeshUnit::Metre,
        wire::MeshUnit::Mm => store::MeshUnit::Millimetre,
    }
}

/// The format as it is stored.
pub(crate) fn stored_format(format: MeshFormat) -> store::MeshFormat {
    match format {
        MeshFormat::Stl => store::MeshFormat::Stl,
        MeshFormat::Obj => store::MeshFormat::Obj,
        MeshFormat::Ply => store::MeshFormat::Ply,
        MeshFormat::Off => store::MeshFormat::Off,
    }
}

/// A stored format as the mesh readers know it.
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
