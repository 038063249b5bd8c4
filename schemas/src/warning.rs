//! Warnings on the wire: input that was accepted but is probably a mistake.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A probable mistake in accepted input. It does not change the result.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Warning {
    /// Kind of mistake, for programs; stable between releases.
    pub code: WarningCode,
    /// Location: a JSON pointer into the request (to the first reading concerned, such as
    /// `/readings/3/image`) or into the report; empty for the whole.
    #[schema(example = "/readings/0/image")]
    pub pointer: String,
    /// What was found and what was expected.
    pub detail: String,
}

/// Kind of a warning.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, PartialOrd, Ord, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WarningCode {
    /// Pressures are probably not in pascal.
    PressureUnit,
    /// The largest pressure indicates contact but is below 1 % of the sensor's range.
    PressureLow,
    /// Pressures are clearly negative: the sensor was probably not tared.
    NotTared,
    /// Most taxels are saturated.
    Saturated,
    /// A position is probably in millimetres.
    PositionUnit,
    /// A position is further from the frame's origin than an arm reaches.
    PositionFar,
    /// All touches of a session fit better with the sensor beside its stated pose: the tool centre
    /// is probably wrong, or the covering is softer or stiffer than described.
    SensorShifted,
    /// The images of all touches of a session fit better in another order: `image_order` of the sensor
    /// is probably wrong.
    ImageOrder,
    /// A robot's stamps step back while its numbers count up.
    StampsBackwards,
    /// The sensor's health says that it is to be commissioned again.
    SensorChanged,
    /// Readings that touch one object are further apart than an object is large.
    PositionsApart,
    /// An object is larger than objects that robots touch: probably the wrong unit.
    ObjectLarge,
    /// An object is too small for the sensor: probably the wrong unit.
    ObjectSmall,
    /// Objects of one catalogue differ in size as metres and millimetres do.
    SizesDiffer,
    /// Objects of one catalogue have the same shape, or were taught by the same readings.
    DuplicateObjects,
    /// Too few readings touched the object, or too few places of it, to determine its surface.
    FewTouches,
    /// A retraining or extension pressed meshes with the trust in the sensor of the version before,
    /// where the sensor states another.
    KnowledgeKept,
    /// The training skipped objects.
    ObjectsSkipped,
    /// The session's method needs images and ignores contacts without one.
    ContactIgnored,
    /// The session's method takes the object to be at rest and ignores announced motions.
    MotionIgnored,
    /// The session's method ignores the free paths of readings.
    ApproachIgnored,
    /// Shear is stored with the reading, and no method uses it.
    ShearIgnored,
}
