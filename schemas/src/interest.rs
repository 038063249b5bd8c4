//! Interest points: where a touch tells most about which object it is.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// What a touch at each place of an object tells about its identity.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct InterestMap {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Bits of a touch that no rival could give: log₂ of the number of rivals and the object. No
    /// place has more.
    pub bits_max: f64,
    /// Places of the surface, spread evenly.
    #[schema(max_items = 500)]
    pub places: Vec<InterestPlace>,
    /// The objects that the object is compared with, most alike first; empty in a version of one
    /// object.
    #[schema(max_items = 31)]
    pub rivals: Vec<InterestRival>,
}

/// A place of an object's surface, in the object frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct InterestPlace {
    /// Position in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub position: [f64; 3],
    /// Outward normal, a unit vector.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub normal: [f64; 3],
    /// Expected information of a touch there on the identity, in bits, once the poses are known and
    /// the object and its rivals are equally probable.
    pub bits: f64,
}

/// An object that another one is compared with.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct InterestRival {
    /// Its id.
    pub id: Uuid,
    /// Its name when it was trained.
    pub name: String,
    /// Mean likeness of a touch of the object to one of the rival at the same place, 0.01 to 1.
    pub likeness: f64,
}
