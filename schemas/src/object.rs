//! Objects on the wire: their names, meshes and training readings.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::access::Writer;
use crate::pose::Pose;
use crate::reading::{Reading, Stamp};
use crate::warning::Warning;

/// A thing that robots are to recognise.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectInfo {
    /// The object's id.
    pub id: Uuid,
    /// Its unique name.
    pub name: String,
    /// What people say about it.
    pub description: String,
    /// The mesh that was uploaded, if any.
    pub mesh: Option<MeshInfo>,
    /// How many training readings are stored.
    pub n_readings: u32,
    /// When it was created.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When its name or description last changed.
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
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateObject {
    /// Its unique name: 1 to 64 letters, digits, `.`, `_` or `-`.
    #[schema(min_length = 1, max_length = 64, example = "mug")]
    pub name: String,
    /// What people say about it; for people only.
    #[serde(default)]
    #[schema(max_length = 2000)]
    pub description: String,
}

/// What to change of an object; what is not given stays.
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

/// What the coordinates in a mesh file mean. STL, OBJ, PLY and OFF do not say it.
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
    /// Metres in one of it.
    #[must_use]
    pub fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Mm => 1e-3,
            Self::Cm => 1e-2,
            Self::In => 25.4e-3,
        }
    }

    /// Its name, as on the wire.
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

/// The file formats of meshes.
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
}

/// How to read an uploaded mesh.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct MeshQuery {
    /// What one unit of the file's coordinates is. Mandatory: guessing would be silent.
    pub unit: MeshUnit,
    /// The file's format, when the content type is `application/octet-stream`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub format: Option<MeshFormat>,
}

/// An object's mesh, as it was uploaded.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct MeshInfo {
    /// The file's format.
    pub format: MeshFormat,
    /// The unit that was given with it.
    pub unit: MeshUnit,
    /// The file's length in bytes.
    pub bytes: u64,
    /// The blake3 hash of the file, in hexadecimal.
    pub hash: String,
    /// When it was uploaded.
    #[schema(format = DateTime)]
    pub uploaded_at: String,
}

/// How the server understands an uploaded mesh.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct MeshReport {
    /// The mesh, as it was uploaded.
    pub mesh: MeshInfo,
    /// Number of triangles.
    pub n_triangles: u32,
    /// Number of vertices.
    pub n_vertices: u32,
    /// Extent along x, y and z in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub size: [f64; 3],
    /// What is unusual about it, such as a size that suggests the other unit.
    pub warnings: Vec<String>,
}

/// Training readings of one object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AddTrainingReadings {
    /// 1 to 1000 readings, all in one frame in which the object is at rest. All are taken or
    /// none.
    #[schema(min_items = 1, max_items = 1000)]
    pub readings: Vec<Reading>,
}

/// What became of training readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct TrainingReadingsAdded {
    /// How many are new.
    pub n_new: u32,
    /// How many were there already (same robot and seq, same content).
    pub n_repeated: u32,
    /// How many the object has now.
    pub n_readings: u32,
    /// What is probably a mistake, such as pressures in kPa or positions in millimetres; at most
    /// one of a kind. The readings are stored all the same.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// A training reading as it is stored.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct StoredReading {
    /// Its number within the object, from 0.
    pub index: u32,
    /// The robot that took it.
    pub robot: Option<String>,
    /// The robot's number of it.
    pub seq: Option<u64>,
    /// The key that it was written with; null when that was not recorded, or nobody was asked
    /// for a key.
    #[serde(default)]
    pub written_by: Option<Writer>,
    /// The id of its sensor.
    pub sensor: Uuid,
    /// When it was taken, by the robot's clock.
    pub stamp: Option<Stamp>,
    /// The sensor's pose in the frame of the object's readings; null when it was not known.
    pub pose: Option<Pose>,
    /// Pressures in pascal, as they were sent.
    pub image: Vec<Option<f64>>,
    /// The number of the sensor's calibration that corrects them; null when there was none.
    #[serde(default)]
    pub calibration: Option<u32>,
    /// The client's own code of the press; null when it sent none.
    #[serde(default)]
    pub feature: Option<Vec<f64>>,
}

/// A page of training readings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct StoredReadingPage {
    /// The readings in the order in which they arrived.
    pub items: Vec<StoredReading>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}
