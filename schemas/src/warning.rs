//! Warnings on the wire: what was accepted, and is probably a mistake all the same.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Something that is probably a mistake. It changes nothing: what it is about was accepted.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Warning {
    /// What kind of mistake: for programs, it does not change between releases.
    pub code: WarningCode,
    /// What it is about: a JSON pointer into the request, such as `/readings/3/image` (the first
    /// reading that it is about), or into the report; empty for the whole.
    #[schema(example = "/readings/0/image")]
    pub pointer: String,
    /// What was found and what was expected, in a sentence.
    pub detail: String,
}

/// The kind of a warning.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, PartialOrd, Ord, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WarningCode {
    /// Pressures are probably in another unit than pascal.
    PressureUnit,
    /// The largest pressure is a contact, but below 1 % of the sensor's range.
    PressureLow,
    /// Pressures are clearly negative: the sensor was not tared.
    NotTared,
    /// Most taxels are saturated.
    Saturated,
    /// A position is probably in millimetres.
    PositionUnit,
    /// A position is further from the origin of its frame than an arm reaches.
    PositionFar,
    /// Readings that touch one object lie further apart than an object is large.
    PositionsApart,
    /// An object is larger than objects that are touched: probably in another unit.
    ObjectLarge,
    /// An object is smaller than a sensor feels: probably in another unit.
    ObjectSmall,
    /// Objects of one catalogue differ in size as metres and millimetres do.
    SizesDiffer,
    /// Too few readings touched the object to know its surface.
    FewTouches,
    /// Objects were left out of the version.
    ObjectsSkipped,
}
