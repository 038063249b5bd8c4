//! The symmetry of an object: the turns that leave it as it is.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What the symmetry of an object was decided by.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SymmetryBy {
    /// By its mesh.
    Mesh,
    /// By its training touches, which leave hardly any place as large as a contact untouched.
    Touches,
    /// By nothing: with so few touches a handle or a notch could have been missed. Poses are
    /// answered as if the object had no symmetry.
    Undetermined,
}

/// An axis that an object can be turned about without a trace.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SymmetryAxis {
    /// A point of the axis, in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub point: [f64; 3],
    /// Its direction, norm 1.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub direction: [f64; 3],
    /// How many equal turns make a full one, 2 to 30; null when every turn leaves the object as
    /// it is. Beside such an axis, one of order 2 stands for all across it; three of them are a
    /// ball.
    #[schema(minimum = 2, maximum = 30)]
    pub order: Option<u8>,
}
