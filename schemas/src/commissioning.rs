//! Commissioning on the wire: touches of a known object in, findings and a passport out.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::coupling::CoveringEdge;
use crate::pose::Pose;
use crate::sensor::ImageOrder;

/// A body to print and to touch, if no object of the catalogue is at hand.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum ReferenceBodyName {
    /// A plate with a ridge.
    Ridge,
    /// A sphere.
    Sphere,
    /// A cube.
    Cube,
    /// A stepped wedge.
    Wedge,
}

impl ReferenceBodyName {
    /// Every body.
    pub const ALL: [Self; 4] = [Self::Ridge, Self::Sphere, Self::Cube, Self::Wedge];

    /// The name on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ridge => "ridge",
            Self::Sphere => "sphere",
            Self::Cube => "cube",
            Self::Wedge => "wedge",
        }
    }
}

/// Touches of one known object at rest, as the driver sends them. Exactly one of `object` and
/// `reference_body` names it.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CommissionSensor {
    /// Id or name of the touched object, which has a mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "mug")]
    pub object: Option<String>,
    /// The touched reference body, in the frame of its mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_body: Option<ReferenceBodyName>,
    /// Pose of the object's mesh in the session frame, in metres; null if it is unknown. Default:
    /// null.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session_from_object: Option<Pose>,
    /// The touches, in the numbers that the driver sends. Touch faces with different normals, edges
    /// and corners; about twenty tell enough.
    #[schema(min_items = 8, max_items = 100)]
    pub readings: Vec<CommissioningReading>,
    /// Seed of the search. The same request gives the same findings. Default: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(maximum = 9_007_199_254_740_991_u64)]
    pub seed: Option<u64>,
    /// Whether the findings become the sensor's passport, which corrects readings received after
    /// it. Default: false.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub apply: bool,
}

/// One touch in the numbers that the driver sends, whatever their unit and convention.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CommissioningReading {
    /// The image as the driver sends it; null for a taxel without a value.
    #[schema(max_items = 16_384)]
    pub image: Vec<Option<f64>>,
    /// The pose as the driver sends it; the quaternion has norm 1.
    pub pose: Pose,
}

/// Finding about a sensor on its robot.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FindingName {
    /// Unit of pressures.
    PressureUnit,
    /// Unit of positions.
    PositionUnit,
    /// Order of quaternions.
    QuaternionOrder,
    /// Frames between which poses map.
    PoseDirection,
    /// Order of the driver's images.
    ImageOrder,
    /// Offset and turn of the tool centre.
    ToolCenter,
    /// Factor on the described pressures.
    Gain,
    /// Excess of the pressure ratio at full indentation over that at first touch.
    Stiffening,
    /// Standard deviation of the point spread.
    PointSpread,
    /// End of the covering.
    Edge,
    /// Single taxels that are dead or have an offset.
    Taxels,
    /// How loose single poses are.
    Looseness,
}

impl FindingName {
    /// Every finding.
    pub const ALL: [Self; 12] = [
        Self::PressureUnit,
        Self::PositionUnit,
        Self::QuaternionOrder,
        Self::PoseDirection,
        Self::ImageOrder,
        Self::ToolCenter,
        Self::Gain,
        Self::Stiffening,
        Self::PointSpread,
        Self::Edge,
        Self::Taxels,
        Self::Looseness,
    ];

    /// The name on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PressureUnit => "pressure_unit",
            Self::PositionUnit => "position_unit",
            Self::QuaternionOrder => "quaternion_order",
            Self::PoseDirection => "pose_direction",
            Self::ImageOrder => "image_order",
            Self::ToolCenter => "tool_center",
            Self::Gain => "gain",
            Self::Stiffening => "stiffening",
            Self::PointSpread => "point_spread",
            Self::Edge => "edge",
            Self::Taxels => "taxels",
            Self::Looseness => "looseness",
        }
    }
}

/// Consequence of a finding.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FindingVerdict {
    /// It is as stated, or a number that these touches determine.
    Right,
    /// It differs from what is stated and needs the correction.
    Wrong,
    /// These touches do not determine it.
    Undetermined,
}

/// One finding.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Finding {
    /// Name of the finding.
    pub name: FindingName,
    /// Consequence of the finding.
    pub verdict: FindingVerdict,
    /// The likeliest possibility, in words.
    #[schema(example = "kPa")]
    pub found: String,
    /// What the set-up states, in words; null if it states nothing.
    #[schema(example = "Pa")]
    pub stated: Option<String>,
    /// Probability of `found` against the other possibilities, for choices; null for numbers.
    pub probability: Option<f64>,
    /// Value in SI units, for single numbers; null for choices.
    pub value: Option<f64>,
    /// Standard deviation of `value`; null for choices, and if these touches say nothing.
    pub deviation: Option<f64>,
    /// The correction to make, in one sentence; null if none is needed.
    #[schema(example = "Multiply pressures by 1000: they are in kPa.")]
    pub correction: Option<String>,
}

/// A number with its standard deviation, in SI units.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Measured {
    /// The likeliest value.
    pub value: f64,
    /// Standard deviation of the value; null if the touches say nothing.
    pub deviation: Option<f64>,
}

/// Estimate of the tool centre.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ToolCenterEstimate {
    /// Correction of the tool centre: a pose as sent times it is the true pose.
    pub sent_from_true: Pose,
    /// Offset along the sensor's x, y and z as sent, in metres.
    #[schema(min_items = 3, max_items = 3)]
    pub offset: Vec<Measured>,
    /// Rotation vector about the sensor's x, y and z as sent, in radians.
    #[schema(min_items = 3, max_items = 3)]
    pub turn: Vec<Measured>,
}

/// Images of one touch, observed and predicted, in pascal, row-major in the order that was found.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct CommissionedTouch {
    /// Index of the touch in the request.
    pub reading: u32,
    /// The image that came, in pascal; 0 for a taxel without a value.
    pub observed: Vec<f64>,
    /// The image that the findings predict.
    pub predicted: Vec<f64>,
}

/// Order of the numbers of a quaternion.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum QuaternionOrder {
    /// x, y, z, w, as the API expects.
    Xyzw,
    /// w, x, y, z.
    Wxyz,
}

/// Frames between which a pose maps.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PoseDirection {
    /// From the sensor's frame to the session's, as the API expects.
    SessionFromSensor,
    /// From the session's frame to the sensor's: the inverse.
    SensorFromSession,
}

/// Correction of a sensor's readings, and the sensor as it was measured. Only what was found wrong
/// is corrected; what is undetermined stays as stated.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Passport {
    /// Factor from sent pressures to pascal.
    #[schema(example = 1000.0)]
    pub pressure_factor: f64,
    /// Factor from sent positions to metres.
    #[schema(example = 1.0)]
    pub position_factor: f64,
    /// Order of sent quaternions.
    pub quaternion_order: QuaternionOrder,
    /// Direction of sent poses.
    pub pose_direction: PoseDirection,
    /// Order of the driver's images; it takes the place of the description's.
    pub image_order: ImageOrder,
    /// Correction of the tool centre: a pose as sent times it is the true pose.
    pub sent_from_true: Pose,
    /// Dead taxels, as row-major indices in the sensor frame's order.
    pub dead: Vec<u32>,
    /// Factor on the pressures of the described force curve.
    pub gain: Measured,
    /// Excess of the pressure ratio at full indentation over that at first touch.
    pub stiffening: Measured,
    /// Standard deviation of the point spread, in metres.
    pub point_spread: Measured,
    /// Extent of the covering beyond the array, in metres; null if it has no end within reach.
    pub margin: Option<f64>,
    /// Effect of the covering's end; null if the touches do not determine it.
    pub edge: Option<CoveringEdge>,
    /// Standard deviation of single poses, in metres.
    pub looseness_m: f64,
}

/// What touches of a known object say about a sensor on its robot.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Commissioning {
    /// The sensor.
    pub sensor: Uuid,
    /// Name of the touched object or reference body.
    pub touched: String,
    /// Number of touches with a pressure; the others say nothing.
    pub n_touches: u32,
    /// `wrong` if something needs a correction, `undetermined` if something is open, else `right`.
    pub verdict: FindingVerdict,
    /// The verdict in plain words.
    pub summary: String,
    /// Findings that need a correction.
    pub wrong: Vec<FindingName>,
    /// Findings that these touches do not determine.
    pub undetermined: Vec<FindingName>,
    /// Every finding.
    pub findings: Vec<Finding>,
    /// The tool centre in numbers.
    pub tool_center: ToolCenterEstimate,
    /// Root mean square misfit of a pressure as a share of its touch's largest, with the set-up as
    /// stated.
    pub residual_before: f64,
    /// The same with the set-up as found. Above 0.12 the touches are not understood.
    pub residual_after: f64,
    /// Pose of the object's mesh in the session frame.
    pub session_from_object: Pose,
    /// Images of the touches with a pressure, observed and predicted.
    pub touches: Vec<CommissionedTouch>,
    /// The passport that follows from the findings.
    pub passport: Passport,
    /// Number of the calibration that the passport was stored as; null if it was not applied.
    pub calibration: Option<u32>,
}

/// The passport of a sensor, as stored.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SensorPassport {
    /// The sensor.
    pub sensor: Uuid,
    /// Number of the calibration that brought the passport.
    pub number: u32,
    /// Name of the touched object or reference body.
    pub touched: String,
    /// Number of touches.
    pub n_touches: u32,
    /// Findings that the passport corrects.
    pub wrong: Vec<FindingName>,
    /// Findings that the touches did not determine, which stay as stated.
    pub undetermined: Vec<FindingName>,
    /// Misfit with the set-up as stated, as a share of a touch's largest pressure.
    pub residual_before: f64,
    /// Misfit with the set-up as found.
    pub residual_after: f64,
    /// The corrections, one sentence each.
    pub corrections: Vec<String>,
    /// The passport.
    pub passport: Passport,
    /// When it was applied.
    #[schema(format = DateTime)]
    pub created_at: String,
}

/// A reference body to print and to touch.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReferenceBody {
    /// Name of the body.
    pub name: ReferenceBodyName,
    /// Size along x, y and z, in metres.
    #[schema(min_items = 3, max_items = 3)]
    pub size: Vec<f64>,
    /// What touches of the body tell.
    pub tells: String,
    /// The face that it stands on, which need not be touched.
    pub stands_on: String,
    /// Number of triangles of the mesh.
    pub n_triangles: u32,
}

/// The reference bodies.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReferenceBodies {
    /// The bodies.
    pub items: Vec<ReferenceBody>,
}
