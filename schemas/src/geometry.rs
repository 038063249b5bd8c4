//! Chapter 3 on the wire: training and reading maps of contact, where an object may lie, and
//! how probable each coordinate is. Metres and radians.

use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

use crate::pose::Pose;

/// What a training is to learn for the methods `geometric…`, beside its vocabulary.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GeometryTraining {
    /// Whether the maps are of a plane that is pressed, or of the whole surface.
    pub kind: GeometryKind,
    /// The side of a cell in metres, 0.0001 to 0.05; when not given what suits the kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0001, maximum = 0.05)]
    pub cell: Option<f64>,
}

/// What a map is of.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum GeometryKind {
    /// A raised shape that is pressed from above, such as a letter: x, y and the turn about
    /// the plane's normal. Also learns the pressures.
    Planar,
    /// A solid touched from all sides: the full pose, where a prior bounds it.
    Solid,
}

/// What a training learnt of one object's geometry.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct GeometryReport {
    /// What the map is of.
    pub kind: GeometryKind,
    /// The side of a cell in metres.
    pub cell: f64,
    /// Cells along x, y and z; a planar map has one layer.
    #[schema(value_type = Vec<u32>, min_items = 3, max_items = 3)]
    pub n_cells: [u32; 3],
    /// Memory of the maps, in bytes.
    pub bytes: u64,
    /// Whether the pressures were learnt too.
    pub has_force: bool,
}

/// The trained map of where an object generates contact.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct OccupancyMap {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// What the map is of.
    pub kind: GeometryKind,
    /// The corner with the smallest coordinates, in the object frame, in metres. A planar
    /// map lies at z = `min[2]`.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub min: [f64; 3],
    /// The side of a cell in metres.
    pub cell: f64,
    /// Cells along x, y and z.
    #[schema(value_type = Vec<u32>, min_items = 3, max_items = 3)]
    pub n_cells: [u32; 3],
    /// The probability of a cell that no press has reached.
    pub prior: f64,
    /// How many cells are likelier occupied than the prior says.
    pub n_occupied: u32,
    /// How many cells are less likely occupied than the prior says.
    pub n_free: u32,
    /// How many cells no press has reached.
    pub n_unknown: u32,
    /// Whether the pressures were learnt too.
    pub has_force: bool,
    /// The log-odds of the cells of one slice, x fastest, then y; null unless `slice` names one.
    pub log_odds: Option<Vec<f32>>,
}

/// Which slice of a map.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct SliceQuery {
    /// The layer of cells with this number, from 0 at the smallest z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[param(minimum = 0)]
    pub slice: Option<u32>,
}

/// How a map becomes a PLY file.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct PlyQuery {
    /// What the file holds; `points` when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub form: Option<PlyForm>,
}

/// What a PLY file of a map holds.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum PlyForm {
    /// The centres of the cells that are likely occupied.
    #[default]
    Points,
    /// The surface around them.
    Mesh,
}

/// Two versions whose maps of contact are to be added up.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MergeMaps {
    /// The version of this catalogue that is added to; the current one when not given. The
    /// new version takes everything else from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub version: Option<u32>,
    /// The version whose maps are added.
    pub with: VersionReference,
    /// Whether new sessions use the new version; true when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activate: Option<bool>,
}

/// A version of a catalogue, by name and number.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct VersionReference {
    /// The catalogue's name.
    #[schema(max_length = 64, example = "default")]
    pub catalogue: String,
    /// The version's number.
    #[schema(minimum = 1)]
    pub version: u32,
}

/// Where the object of a session may lie before the first touch.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum PosePrior {
    /// Flat in a plane, for maps of kind `planar`: x, y and the turn are uniform.
    #[schema(title = "PlanarPosePrior")]
    Planar {
        /// The plane's pose in the session frame: x and y along the plane, z out of it
        /// towards the sensor. The session frame itself when not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        plane: Option<Pose>,
        /// The middle of the square in which the object's origin lies, in the plane, metres;
        /// 0, 0 when not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(value_type = Option<Vec<f64>>, min_items = 2, max_items = 2)]
        center: Option<[f64; 2]>,
        /// Half the square's side in metres, 0.0001 to 1; 0.01 when not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0001, maximum = 1.0)]
        half_extent: Option<f64>,
        /// The middle of the turns, in radians; 0 when not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        angle: Option<f64>,
        /// How far the turn may be from it, in radians, 0.001 to π; π, any turn, when not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.001)]
        half_angle: Option<f64>,
    },
    /// Near a pose, for maps of kind `solid`.
    #[schema(title = "BoundedPosePrior")]
    Bounded {
        /// The pose in the middle (`session_from_object`).
        pose: Pose,
        /// How far the object's origin may be from it along the session's x, y and z, metres,
        /// each 0.0001 to 1.
        #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
        half_extents: [f64; 3],
        /// How far it may be turned about each of the session's axes, in radians, 0.001 to π.
        #[schema(minimum = 0.001)]
        half_angle: f64,
    },
}

/// Which object's marginals.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, Eq, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct MarginalsQuery {
    /// Id or name of an object of the session's version; the likeliest when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
}

/// How probable each value of each coordinate is, if the object is the one it is of.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Marginals {
    /// The session.
    pub session: Uuid,
    /// The belief's revision; its value is the `ETag`.
    pub revision: u32,
    /// The object's id.
    pub object: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// How probable the object is.
    pub probability: f64,
    /// One for each coordinate of the pose that the session's prior leaves open.
    pub axes: Vec<Marginal>,
    /// x against y; null unless the prior is planar.
    pub plane: Option<PlaneMarginal>,
}

/// How probable each place in the plane is, whatever the turn.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct PlaneMarginal {
    /// The corner with the smallest x and y, in metres.
    #[schema(value_type = Vec<f64>, min_items = 2, max_items = 2)]
    pub low: [f64; 2],
    /// The corner with the largest x and y, in metres.
    #[schema(value_type = Vec<f64>, min_items = 2, max_items = 2)]
    pub high: [f64; 2],
    /// How many bins along x and y.
    #[schema(value_type = Vec<u32>, min_items = 2, max_items = 2)]
    pub n: [u32; 2],
    /// The probabilities of the bins, x fastest; they sum to 1.
    pub probabilities: Vec<f64>,
}

/// How probable each value of one coordinate is.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Marginal {
    /// The coordinate: `x`, `y` and `theta`, the turn, in the prior's plane; or `x`, `y`, `z`
    /// along the session's axes and `rx`, `ry`, `rz`, the rotation vector from the prior's
    /// pose about them.
    #[schema(example = "theta")]
    pub axis: String,
    /// The unit of `low` and `high`.
    pub unit: AxisUnit,
    /// Where the first bin begins.
    pub low: f64,
    /// Where the last bin ends.
    pub high: f64,
    /// The probabilities of bins of equal width from `low` to `high`; they sum to 1.
    pub probabilities: Vec<f64>,
}

/// The unit of a coordinate.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AxisUnit {
    /// Metres.
    M,
    /// Radians.
    Rad,
}
