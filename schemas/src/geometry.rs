//! Geometry on the wire (chapter 3): contact maps, pose priors and marginals. Metres and radians.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::camera::{ClassWeight, StatedPose, WorkspaceBox};
use crate::pose::Pose;

/// Training options of the methods `geometric…`.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GeometricTraining {
    /// Kind of contact map: a pressed plane or a whole surface.
    pub kind: GeometricKind,
    /// Cell size in metres, 0.0001 to 0.05. Default: suited to the kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0001, maximum = 0.05)]
    pub cell: Option<f64>,
}

/// Kind of contact map.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum GeometricKind {
    /// A raised shape pressed from above, such as a letter: x, y and the rotation about the plane's
    /// normal. Also learns pressures.
    Planar,
    /// A solid touched from all sides: the full pose, within a bounded prior.
    Solid,
}

/// Summary of an object's contact map.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct GeometricReport {
    /// Kind of the map.
    pub kind: GeometricKind,
    /// Cell size in metres.
    pub cell: f64,
    /// Number of cells along x, y and z; a planar map has one layer.
    #[schema(value_type = Vec<u32>, min_items = 3, max_items = 3)]
    pub n_cells: [u32; 3],
    /// Memory of the maps, in bytes.
    pub bytes: u64,
    /// Whether the map includes pressures.
    pub has_force: bool,
}

/// The trained contact map of an object: where it generates contact.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct OccupancyMap {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Kind of the map.
    pub kind: GeometricKind,
    /// Corner with the smallest coordinates, in the object frame, in metres. A planar map lies at z
    /// = `min[2]`.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub min: [f64; 3],
    /// Cell size in metres.
    pub cell: f64,
    /// Number of cells along x, y and z.
    #[schema(value_type = Vec<u32>, min_items = 3, max_items = 3)]
    pub n_cells: [u32; 3],
    /// Occupancy probability of a cell that no press has reached.
    pub prior: f64,
    /// Number of cells with an occupancy above the prior.
    pub n_occupied: u32,
    /// Number of cells with an occupancy below the prior.
    pub n_free: u32,
    /// Number of cells that no press has reached.
    pub n_unknown: u32,
    /// Whether the map includes pressures.
    pub has_force: bool,
    /// Log-odds of the cells of the slice, x fastest, then y; null without `slice`.
    pub log_odds: Option<Vec<f32>>,
}

/// Selects a slice of a map.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct SliceQuery {
    /// Layer of cells, counted from 0 at the smallest z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub slice: Option<u32>,
}

/// Parameters of a PLY export.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct PlyQuery {
    /// Content of the file. Default: `points`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub form: Option<PlyForm>,
}

/// Content of a PLY file.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum PlyForm {
    /// Centres of the cells that are likely occupied.
    #[default]
    Points,
    /// Surface around the cells that are likely occupied.
    Mesh,
}

/// Two versions whose contact maps are to be merged.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MergeMaps {
    /// Base version, of this catalogue. The new version takes everything but the maps' evidence
    /// from it. Default: the current version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub version: Option<u32>,
    /// The version whose contact maps are added.
    pub with: VersionReference,
    /// Whether to make the new version current. Default: true.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activate: Option<bool>,
}

/// A version of a catalogue, by name and number.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct VersionReference {
    /// Name of the catalogue.
    #[schema(max_length = 64, example = "default")]
    pub catalogue: String,
    /// Number of the version.
    #[schema(minimum = 1)]
    pub version: u32,
}

/// Prior of the object's pose, before the first touch.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum PosePrior {
    /// Flat in a plane, for maps of kind `planar`: uniform in x, y and rotation.
    #[schema(title = "PlanarPosePrior")]
    Planar {
        /// The plane's pose in the session frame: x and y in the plane, z towards the sensor.
        /// Default: the session frame.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        plane: Option<Pose>,
        /// Centre of the square that holds the object's origin, in the plane, in metres. Default:
        /// 0, 0.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(value_type = Option<Vec<f64>>, min_items = 2, max_items = 2)]
        center: Option<[f64; 2]>,
        /// Half the square's side in metres, 0.0001 to 1. Default: 0.01.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0001, maximum = 1.0)]
        half_extent: Option<f64>,
        /// Central rotation in radians. Default: 0.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        angle: Option<f64>,
        /// Maximum deviation from `angle` in radians, 0.001 to π. Default: π (any rotation).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.001)]
        half_angle: Option<f64>,
    },
    /// Near a given pose, for maps of kind `solid`.
    #[schema(title = "BoundedPosePrior")]
    Bounded {
        /// Central pose (`session_from_object`).
        pose: Pose,
        /// Maximum distance of the object's origin from the central pose along the session's x, y
        /// and z, in metres, each 0.0001 to 1.
        #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
        half_extents: [f64; 3],
        /// Maximum rotation about each of the session's axes, in radians, 0.001 to π.
        #[schema(minimum = 0.001)]
        half_angle: f64,
    },
    /// A camera's word, for the method `surface`: hypotheses of the pose, a detector's weights of
    /// objects, a workspace, or several of these. Touches overrule it. It holds for the object as
    /// it lies at the first touch.
    #[schema(title = "CameraPosePrior")]
    Camera {
        /// Possible poses. Default: any pose in the workspace.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        #[schema(max_items = 64)]
        hypotheses: Vec<StatedPose>,
        /// A detector's weights of objects, which multiply the session's `prior`. Objects that are
        /// not listed have the weight 0. Default: all objects weigh the same.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        #[schema(max_items = 1_000)]
        class_weights: Vec<ClassWeight>,
        /// Box that holds the object. Default: anywhere.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        workspace: Option<WorkspaceBox>,
        /// Probability that the statement is wrong, 0.001 to 0.9. A wrong statement says nothing
        /// about the object and its pose. Default: 0.1.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.001, maximum = 0.9, example = 0.1)]
        wrong: Option<f64>,
    },
}

/// Parameters of a marginals query.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct MarginalsQuery {
    /// Id or name of an object of the session's version. Default: the likeliest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
}

/// Marginal distributions of an object's pose coordinates, given that it is the session's object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Marginals {
    /// The session.
    pub session: Uuid,
    /// Revision of the belief. Its value is the `ETag`.
    pub revision: u32,
    /// The object's id.
    pub object: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Probability of the object.
    pub probability: f64,
    /// One marginal for each pose coordinate that the session's prior leaves open.
    pub axes: Vec<Marginal>,
    /// Joint marginal of x and y; null unless the prior is planar.
    pub plane: Option<PlaneMarginal>,
}

/// Joint marginal of x and y in the plane, over all rotations.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct PlaneMarginal {
    /// The corner with the smallest x and y, in metres.
    #[schema(value_type = Vec<f64>, min_items = 2, max_items = 2)]
    pub low: [f64; 2],
    /// The corner with the largest x and y, in metres.
    #[schema(value_type = Vec<f64>, min_items = 2, max_items = 2)]
    pub high: [f64; 2],
    /// Number of bins along x and y.
    #[schema(value_type = Vec<u32>, min_items = 2, max_items = 2)]
    pub n: [u32; 2],
    /// The probabilities of the bins, x fastest; they sum to 1.
    pub probabilities: Vec<f64>,
}

/// Marginal distribution of one coordinate.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Marginal {
    /// The coordinate. With a planar prior: `x`, `y` and `theta` (rotation) in its plane.
    /// Otherwise: `x`, `y`, `z` along the session's axes, and `rx`, `ry`, `rz`, the components of
    /// the rotation vector from the prior's pose.
    #[schema(example = "theta")]
    pub axis: String,
    /// Unit of `low` and `high`.
    pub unit: AxisUnit,
    /// Start of the first bin.
    pub low: f64,
    /// End of the last bin.
    pub high: f64,
    /// Probabilities of equally wide bins from `low` to `high`; they sum to 1.
    pub probabilities: Vec<f64>,
}

/// Unit of a coordinate.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AxisUnit {
    /// Metres.
    M,
    /// Radians.
    Rad,
}
