//! Symmetry of an object: the rotations that map it onto itself.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Source of a symmetry decision.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SymmetryBy {
    /// The object's mesh.
    Mesh,
    /// The training touches, which leave hardly any area as large as a contact untouched.
    Touches,
    /// Undetermined: with this few touches a handle or a notch could have been missed. Poses are
    /// reported as if the object had no symmetry.
    Undetermined,
}

/// An axis of rotational symmetry.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SymmetryAxis {
    /// A point on the axis, in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub point: [f64; 3],
    /// Direction of the axis, a unit vector.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub direction: [f64; 3],
    /// Order of the axis, 2 to 30; null for full rotational symmetry. Next to an axis of full
    /// symmetry, one axis of order 2 stands for all axes perpendicular to it. Three axes of full
    /// symmetry mean a ball.
    #[schema(minimum = 2, maximum = 30)]
    pub order: Option<u8>,
}
