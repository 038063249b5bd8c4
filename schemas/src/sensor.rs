//! Sensors on the wire: taxel geometry, response, and the dry run of a reading.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::coupling::{Coupling, SensorKnowledge, SensorRanges};
use crate::labels::{Labels, LabelsSchema};
use crate::layout::{Layout, Taxel};
use crate::pose::Point;
use crate::warning::Warning;

/// A tactile array sensor.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Sensor {
    /// The sensor's id.
    pub id: Uuid,
    /// Unique name of the sensor.
    pub name: String,
    /// The preset the sensor was created from, if any.
    pub preset: Option<String>,
    /// Its labels.
    #[serde(default)]
    #[schema(value_type = LabelsSchema)]
    pub labels: Labels,
    /// Geometry and response. Immutable, because stored readings rely on it.
    pub description: SensorDescription,
    /// How values become images; null for taxels on a grid.
    #[serde(default)]
    pub layout: Option<Layout>,
    /// The owner's trust in the description.
    #[serde(default)]
    pub sensor_knowledge: SensorKnowledge,
    /// Number of the newest calibration, which applies to new readings; null if there is none.
    #[serde(default)]
    pub calibration: Option<u32>,
    /// Number of the calibration that brought the passport which applies to new readings; null if
    /// the sensor was not commissioned.
    #[serde(default)]
    pub passport: Option<u32>,
    /// When the sensor was created.
    #[schema(format = DateTime)]
    pub created_at: String,
}

/// A page of sensors.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SensorPage {
    /// The sensors, oldest first.
    pub items: Vec<Sensor>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// A new sensor, from a preset or a description.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateSensor {
    /// Unique name: 1 to 64 letters, digits, `.`, `_` or `-`.
    #[schema(min_length = 1, max_length = 64, example = "left-finger")]
    pub name: String,
    /// Preset of a known sensor. Excludes `description`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<SensorPreset>,
    /// Description of the sensor. Excludes `preset`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<DescribeSensor>,
    /// Orientation of the driver's images; overrides that of the preset or description.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_order: Option<ImageOrder>,
    /// Coupling of the covering and the taxels; overrides that of the preset or description.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coupling: Option<Coupling>,
    /// Trust in the description. Default: `data_sheet`. State `measured` only for a sensor whose
    /// numbers were measured, or for a simulation of exactly this description.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_knowledge: Option<SensorKnowledge>,
    /// Labels for searches: at most 16, as `PUT …/labels` describes them.
    #[serde(default, skip_serializing_if = "Labels::is_empty")]
    #[schema(value_type = LabelsSchema)]
    pub labels: Labels,
}

/// Geometry and response of a new sensor, in metres and pascals. The answer contains the defaults
/// of omitted fields.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DescribeSensor {
    /// Grid of the taxels. Required unless there are `taxels`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<TaxelGrid>,
    /// Taxels that are not on a grid, such as those of a curved fingertip, in the order of a reading's
    /// values. With `grid`, one taxel near each of its places, row by row, or the grid of a
    /// described sensor's images. Kept in single precision.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 80)]
    pub taxels: Option<Vec<Taxel>>,
    /// Thickness of the covering in metres, which is also the deepest indentation.
    #[schema(example = 0.00254)]
    pub covering_thickness: f64,
    /// Standard deviation of the Gaussian point spread in metres. Default: from the covering, 2.22
    /// mm + 0.497 × thickness (equation 2.5, as in `analyses/covering`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.003482)]
    pub point_spread: Option<f64>,
    /// Maps blurred displacement to pressure: 2 to 64 rising knots from (0, 0). Default: a straight
    /// line up to `saturation` at the full thickness of the covering.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 2, max_items = 64)]
    pub force_curve: Option<Vec<ForceKnot>>,
    /// Largest pressure that a taxel reports, in pascal.
    #[schema(example = 20_000.0)]
    pub saturation: f64,
    /// Standard deviation of a reading's additive noise, in pascal. Default: 0.5 % of `saturation`,
    /// or one step of the converter if that is more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 100.0)]
    pub noise: Option<f64>,
    /// Step of the analogue-to-digital converter in pascal; 0 for a continuous sensor.
    #[schema(example = 78.125)]
    pub quantisation: f64,
    /// Orientation of the driver's images. Default: that of the sensor frame.
    #[serde(default)]
    pub image_order: ImageOrder,
    /// Spread, edge and cross-talk beyond one Gaussian.
    #[serde(default)]
    pub coupling: Coupling,
    /// Ranges of what the description leaves open, each in place of its default. Not with
    /// `sensor_knowledge` `measured`, which leaves nothing open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ranges: Option<SensorRanges>,
}

impl From<SensorDescription> for DescribeSensor {
    fn from(known: SensorDescription) -> Self {
        Self {
            grid: Some(known.grid),
            taxels: known.taxels,
            covering_thickness: known.covering_thickness,
            point_spread: Some(known.point_spread),
            force_curve: Some(known.force_curve),
            saturation: known.saturation,
            noise: Some(known.noise),
            quantisation: known.quantisation,
            image_order: known.image_order,
            coupling: known.coupling,
            ranges: known.ranges,
        }
    }
}

/// A sensor that the server knows by name.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub enum SensorPreset {
    /// 6 × 6 taxels at 2 mm, 0–20 kPa, under a covering of 2.54 mm.
    #[serde(rename = "digitacts-6x6")]
    Digitacts6x6,
    /// `Digitacts6x6` under the thinnest covering, 1.016 mm: for letters and other fine shapes.
    #[serde(rename = "digitacts-6x6-thin")]
    Digitacts6x6Thin,
    /// 6 × 8 taxels at 2 mm: two physical modules.
    #[serde(rename = "digitacts-6x8")]
    Digitacts6x8,
    /// 14 × 14 taxels over 12 mm: the density of a human fingertip.
    #[serde(rename = "fingertip-14x14")]
    Fingertip14x14,
    /// 26 × 26 taxels over 12 mm: the density of a Tekscan sensor.
    #[serde(rename = "tekscan-26x26")]
    Tekscan26x26,
    /// XELA uSkin uSPa 44: 4 × 4 taxels at 4.7 mm in a soft skin.
    #[serde(rename = "xela-uskin-4x4")]
    XelaUskin4x4,
    /// Contactile PapillArray: 3 × 3 separate pillars, 7 mm apart.
    #[serde(rename = "contactile-papillarray-3x3")]
    ContactilePapillarray3x3,
    /// One module of PPS DigiTacts: 6 × 4 elements of 1.8 mm with gaps of 0.1 mm.
    #[serde(rename = "pps-digitacts-6x4")]
    PpsDigitacts6x4,
    /// Two modules of PPS DigiTacts side by side: 6 × 8 elements.
    #[serde(rename = "pps-digitacts-6x8")]
    PpsDigitacts6x8,
    /// GelSight Mini as 18 × 24 heights at 0.775 mm; 10 Pa stand for 1 µm.
    #[serde(rename = "gelsight-mini-18x24")]
    GelsightMini18x24,
    /// DIGIT as 16 × 19 heights at 1 mm; 10 Pa stand for 1 µm.
    #[serde(rename = "digit-16x19")]
    Digit16x19,
    /// Fingertip of the iCub's hand: 12 taxels on a curved skin; +z is the normal of its pad.
    #[serde(rename = "icub-fingertip-12")]
    IcubFingertip12,
    /// Fingertip for simulations: 24 taxels on a cap of 10 mm radius.
    #[serde(rename = "fingertip-curved-24")]
    FingertipCurved24,
}

impl SensorPreset {
    /// Every preset.
    pub const ALL: [Self; 13] = [
        Self::Digitacts6x6,
        Self::Digitacts6x6Thin,
        Self::Digitacts6x8,
        Self::Fingertip14x14,
        Self::Tekscan26x26,
        Self::XelaUskin4x4,
        Self::ContactilePapillarray3x3,
        Self::PpsDigitacts6x4,
        Self::PpsDigitacts6x8,
        Self::GelsightMini18x24,
        Self::Digit16x19,
        Self::IcubFingertip12,
        Self::FingertipCurved24,
    ];

    /// Name of the preset on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Digitacts6x6 => "digitacts-6x6",
            Self::Digitacts6x6Thin => "digitacts-6x6-thin",
            Self::Digitacts6x8 => "digitacts-6x8",
            Self::Fingertip14x14 => "fingertip-14x14",
            Self::Tekscan26x26 => "tekscan-26x26",
            Self::XelaUskin4x4 => "xela-uskin-4x4",
            Self::ContactilePapillarray3x3 => "contactile-papillarray-3x3",
            Self::PpsDigitacts6x4 => "pps-digitacts-6x4",
            Self::PpsDigitacts6x8 => "pps-digitacts-6x8",
            Self::GelsightMini18x24 => "gelsight-mini-18x24",
            Self::Digit16x19 => "digit-16x19",
            Self::IcubFingertip12 => "icub-fingertip-12",
            Self::FingertipCurved24 => "fingertip-curved-24",
        }
    }
}

/// Geometry and response of a sensor, in metres and pascals.
///
/// Frame: origin at the centre of the covering's free surface, +z out of the sensor towards the
/// object, +x along columns, +y along rows.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorDescription {
    /// Grid of the images, and of the taxels unless they are listed.
    pub grid: TaxelGrid,
    /// Taxels that are not exactly on the grid; null if they are.
    #[serde(default)]
    #[schema(min_items = 1, max_items = 80)]
    pub taxels: Option<Vec<Taxel>>,
    /// Thickness of the covering in metres, which is also the deepest indentation.
    #[schema(example = 0.00254)]
    pub covering_thickness: f64,
    /// Standard deviation of the Gaussian point spread in metres.
    #[schema(example = 0.003482)]
    pub point_spread: f64,
    /// Maps blurred displacement to pressure: 2 to 64 rising knots from (0, 0).
    #[schema(min_items = 2, max_items = 64)]
    pub force_curve: Vec<ForceKnot>,
    /// Largest pressure that a taxel reports, in pascal.
    #[schema(example = 20_000.0)]
    pub saturation: f64,
    /// Standard deviation of a reading's additive noise, in pascal.
    #[schema(example = 100.0)]
    pub noise: f64,
    /// Step of the analogue-to-digital converter in pascal; 0 for a continuous sensor.
    #[schema(example = 78.125)]
    pub quantisation: f64,
    /// Orientation of the driver's images. Default: that of the sensor frame.
    #[serde(default)]
    pub image_order: ImageOrder,
    /// Spread, edge and cross-talk beyond one Gaussian.
    #[serde(default)]
    pub coupling: Coupling,
    /// Ranges from which trainings draw sensors, with defaults; null if the sensor is `measured`.
    #[serde(default)]
    pub ranges: Option<SensorRanges>,
}

/// A rectangular grid of square taxels. A single taxel or a single row has no image of a surface:
/// readings of it give a position and a rough direction only.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TaxelGrid {
    /// Number of rows, along +y.
    #[schema(minimum = 1, maximum = 128, example = 6)]
    pub rows: u32,
    /// Number of columns, along +x.
    #[schema(minimum = 1, maximum = 128, example = 6)]
    pub cols: u32,
    /// Distance between the centres of neighbouring taxels, in metres.
    #[schema(example = 0.002)]
    pub pitch: f64,
    /// Side of one taxel's sensing area in metres; at most the pitch.
    #[schema(example = 0.0018)]
    pub taxel_width: f64,
}

/// One knot of a force curve.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceKnot {
    /// Displacement of the covering in metres.
    pub displacement: f64,
    /// Pressure that a taxel reports at this displacement, in pascal.
    pub pressure: f64,
}

/// Orientation of the driver's image relative to the row-major order of the sensor frame.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageOrder {
    /// Whether the driver sends columns as rows.
    #[serde(default)]
    pub transposed: bool,
    /// Whether the driver's first row is the frame's last.
    #[serde(default)]
    pub rows_reversed: bool,
    /// Whether the driver's first column is the frame's last.
    #[serde(default)]
    pub cols_reversed: bool,
}

/// The server's interpretation of a reading.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingCheck {
    /// Number of rows of `image`.
    pub rows: u32,
    /// Number of columns of `image`.
    pub cols: u32,
    /// The image in the order of the sensor frame, row-major, in pascal: oriented by the sensor's
    /// `image_order`, with missing taxels interpolated from their neighbours.
    pub image: Vec<f64>,
    /// Taxels without a value, as indices into `image`.
    pub missing: Vec<u32>,
    /// Saturated taxels, as indices into `image`.
    pub saturated: Vec<u32>,
    /// Taxels in contact: above half the largest pressure and above the noise.
    pub contact: Vec<u32>,
    /// The largest pressure in pascal.
    pub max_pressure: f64,
    /// Centre of pressure in the sensor frame (z = 0); null without contact.
    pub centroid_in_sensor: Option<Point>,
    /// Centre of pressure in the session frame; null without contact or without a pose.
    pub centroid_in_session: Option<Point>,
    /// The sensor's +z direction, towards the object, in the session frame; null without a pose.
    pub sensor_z_in_session: Option<Point>,
    /// Number of the calibration applied to `image`; null if the sensor has none.
    #[serde(default)]
    pub calibration: Option<u32>,
    /// Number of the calibration whose passport corrected image and pose; null if none did.
    #[serde(default)]
    pub passport: Option<u32>,
    /// Taxels that the calibration or the passport excludes (dead or cross-wired), as indices into
    /// `image`.
    #[serde(default)]
    pub unusable: Vec<u32>,
    /// Anything unusual about the reading, in words, including `warnings`.
    pub hints: Vec<String>,
    /// Probable mistakes, such as pressures in kPa or positions in millimetres.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}
