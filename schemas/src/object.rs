//! Objects on the wire: their names, meshes and training readings.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::access::Writer;
use crate::labels::{Labels, LabelsSchema};
use crate::pose::Pose;
use crate::reading::{Reading, Stamp};
use crate::warning::Warning;

/// An object to recognise.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectInfo {
    /// The object's id.
    pub id: Uuid,
    /// Unique name of the object.
    pub name: String,
    /// Description for people.
    pub description: String,
    /// Its labels.
    #[serde(default)]
    #[schema(value_type = LabelsSchema)]
    pub labels: Labels,
    /// The uploaded mesh, if any.
    pub mesh: Option<MeshInfo>,
    /// Number of stored training readings.
    pub n_readings: u32,
    /// When the object was created.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When the name, the description or the labels last changed.
    #[schema(format = DateTime)]
    pub updated_at: String,
}

/// A page of objects.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectPage {
    /// The objects, oldest first.
    pub items: Vec<ObjectInfo>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// A new object.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateObject {
    /// Unique name: 1 to 64 letters, digits, `.`, `_` or `-`.
    #[schema(min_length = 1, max_length = 64, example = "mug")]
    pub name: String,
    /// Description for people; the service ignores it.
    #[serde(default)]
    #[schema(max_length = 2000)]
    pub description: String,
    /// Labels for searches: at most 16, as `PUT …/labels` describes them.
    #[serde(default, skip_serializing_if = "Labels::is_empty")]
    #[schema(value_type = LabelsSchema)]
    pub labels: Labels,
}

/// Changes to an object. Omitted fields stay as they are.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct UpdateObject {
    /// A new unique name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 64)]
    pub name: Option<String>,
    /// A new description.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 2000)]
    pub description: Option<String>,
}

/// Unit of the coordinates in a mesh file. STL, OBJ, PLY and OFF do not record it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum MeshUnit {
    /// Metres.
    M,
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Inches of 25.4 mm.
    In,
}

impl MeshUnit {
    /// Length of the unit in metres.
    #[must_use]
    pub fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Mm => 1e-3,
            Self::Cm => 1e-2,
            Self::In => 25.4e-3,
        }
    }

    /// Name of the unit on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::In => "in",
        }
    }
}

/// File format of a mesh.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum MeshFormat {
    /// STL, ASCII or binary (`model/stl`).
    Stl,
    /// Wavefront OBJ (`model/obj`).
    Obj,
    /// PLY, ASCII or binary (`model/ply` or `application/ply`).
    Ply,
    /// OFF (`model/off`).
    Off,
    /// Binary glTF 2.0 (`model/gltf-binary`).
    Glb,
    /// 3MF (`model/3mf`).
    #[serde(rename = "3mf")]
    ThreeMf,
}

/// Parameters of a mesh upload.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct MeshQuery {
    /// Unit of the file's coordinates. Mandatory for STL, OBJ, PLY and OFF, because they do not
    /// record it and a wrong guess would go unnoticed. GLB is in metres and 3MF names its unit:
    /// another one is refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<MeshUnit>,
    /// Format of the file, if the content type is `application/octet-stream`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub format: Option<MeshFormat>,
}

/// An uploaded mesh.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct MeshInfo {
    /// Format of the file.
    pub format: MeshFormat,
    /// Unit given at upload, or recorded in the file (micrometres are shown as `mm`, feet as `in`).
    pub unit: MeshUnit,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// BLAKE3 hash of the file, in hexadecimal.
    pub hash: String,
    /// When the mesh was uploaded.
    #[schema(format = DateTime)]
    pub uploaded_at: String,
}

/// The server's interpretation of an uploaded mesh.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct MeshReport {
    /// The uploaded mesh.
    pub mesh: MeshInfo,
    /// Number of triangles.
    pub n_triangles: u32,
    /// Number of vertices.
    pub n_vertices: u32,
    /// Extent along x, y and z in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub size: [f64; 3],
    /// Anything unusual about the mesh, such as a size that suggests another unit.
    pub warnings: Vec<String>,
}

/// Training readings of one object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AddTrainingReadings {
    /// 1 to 1000 readings in one frame in which the object is at rest. The list is stored whole or
    /// not at all.
    #[schema(min_items = 1, max_items = 1000)]
    pub readings: Vec<Reading>,
}

/// Result of adding training readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct TrainingReadingsAdded {
    /// Number of new readings.
    pub n_new: u32,
    /// Number of readings already stored (same robot, `seq` and content).
    pub n_repeated: u32,
    /// Number of readings the object has now.
    pub n_readings: u32,
    /// Probable mistakes, such as pressures in kPa or positions in millimetres; at most one of a
    /// kind. The readings are stored nevertheless.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// A stored training reading.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct StoredReading {
    /// Number of the reading within the object, from 0.
    pub index: u32,
    /// The robot that took the reading.
    pub robot: Option<String>,
    /// The robot's sequence number of the reading.
    pub seq: Option<u64>,
    /// The key the reading was written with; null if not recorded, or if the server required no
    /// keys.
    #[serde(default)]
    pub written_by: Option<Writer>,
    /// Id of the sensor.
    pub sensor: Uuid,
    /// When the reading was taken, by the robot's clock.
    pub stamp: Option<Stamp>,
    /// The sensor's pose in the frame of the object's readings; null if unknown.
    pub pose: Option<Pose>,
    /// Pressures in pascal, as sent.
    pub image: Vec<Option<f64>>,
    /// Shear in pascal, as sent: two values for each taxel; null if not sent.
    #[serde(default)]
    pub shear: Option<Vec<Option<[f64; 2]>>>,
    /// Number of the sensor calibration applied to the pressures; null if there was none.
    #[serde(default)]
    pub calibration: Option<u32>,
    /// The client's own feature of the press; null if not sent.
    #[serde(default)]
    pub feature: Option<Vec<f64>>,
    /// The free path to the pose in metres, as sent; 0 if not sent. No training uses it.
    #[serde(default)]
    pub approach_m: f64,
}

/// A page of training readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct StoredReadingPage {
    /// The readings in the order of arrival.
    pub items: Vec<StoredReading>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}
