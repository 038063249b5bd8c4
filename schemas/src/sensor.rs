//! Sensors on the wire: where taxels are and how they respond, and the dry-run of a reading.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::warning::Warning;

/// A tactile array sensor that the server knows.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Sensor {
    /// The sensor's id.
    pub id: Uuid,
    /// Its unique name.
    pub name: String,
    /// The preset that it was made from, if any.
    pub preset: Option<String>,
    /// Its geometry and response. Does not change: readings rely on it.
    pub description: SensorDescription,
    /// The number of its newest calibration, which applies to readings that come now; null
    /// when it has none.
    #[serde(default)]
    pub calibration: Option<u32>,
    /// When it was created.
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

/// A new sensor: a preset or a description.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CreateSensor {
    /// Its unique name: 1 to 64 letters, digits, `.`, `_` or `-`.
    #[schema(min_length = 1, max_length = 64, example = "left-finger")]
    pub name: String,
    /// A known sensor. Give either this or `description`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<SensorPreset>,
    /// A description. Give either this or `preset`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<DescribeSensor>,
    /// How the driver's images are turned; replaces that of the preset or description.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_order: Option<ImageOrder>,
}

/// The geometry and response of a new sensor, in metres and pascals, as far as its data sheet
/// says. The answer has everything, defaults filled in.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DescribeSensor {
    /// Where the taxels are.
    pub grid: TaxelGrid,
    /// Thickness of the covering in metres: the deepest indentation it takes.
    #[schema(example = 0.00254)]
    pub covering_thickness: f64,
    /// Standard deviation of the Gaussian point spread in metres; when not given, that of the
    /// covering: 2.22 mm + 0.497 times its thickness (equation 2.5, as `analyses/covering`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 0.003482)]
    pub point_spread: Option<f64>,
    /// Blurred displacement to pressure: 2 to 64 knots that start at (0, 0) and rise; when not
    /// given, a straight line to the saturation at the covering's full thickness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 2, max_items = 64)]
    pub force_curve: Option<Vec<ForceKnot>>,
    /// No taxel reads more than this, in pascal.
    #[schema(example = 20_000.0)]
    pub saturation: f64,
    /// Standard deviation of a reading's additive noise, in pascal; when not given, half a
    /// percent of the saturation, or a step of the converter where that is more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = 100.0)]
    pub noise: Option<f64>,
    /// Step of the analogue-to-digital converter in pascal; 0 for a continuous sensor.
    #[schema(example = 78.125)]
    pub quantisation: f64,
    /// How the driver's images are turned; not at all when not given.
    #[serde(default)]
    pub image_order: ImageOrder,
}

impl From<SensorDescription> for DescribeSensor {
    fn from(known: SensorDescription) -> Self {
        Self {
            grid: known.grid,
            covering_thickness: known.covering_thickness,
            point_spread: Some(known.point_spread),
            force_curve: Some(known.force_curve),
            saturation: known.saturation,
            noise: Some(known.noise),
            quantisation: known.quantisation,
            image_order: known.image_order,
        }
    }
}

/// Sensors that the server knows by name.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub enum SensorPreset {
    /// 6 × 6 taxels at 2 mm, 0–20 kPa, under a 2.54 mm covering.
    #[serde(rename = "digitacts-6x6")]
    Digitacts6x6,
    /// The same under the thinnest covering, 1.016 mm: for letters and other fine shapes.
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
}

impl SensorPreset {
    /// Every preset.
    pub const ALL: [Self; 5] = [
        Self::Digitacts6x6,
        Self::Digitacts6x6Thin,
        Self::Digitacts6x8,
        Self::Fingertip14x14,
        Self::Tekscan26x26,
    ];

    /// The preset's name, as on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Digitacts6x6 => "digitacts-6x6",
            Self::Digitacts6x6Thin => "digitacts-6x6-thin",
            Self::Digitacts6x8 => "digitacts-6x8",
            Self::Fingertip14x14 => "fingertip-14x14",
            Self::Tekscan26x26 => "tekscan-26x26",
        }
    }
}

/// The geometry and response of a sensor, in metres and pascals.
///
/// Frame: origin at the centre of the covering's free surface, +z out of the sensor towards
/// the object, +x along columns, +y along rows.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorDescription {
    /// Where the taxels are.
    pub grid: TaxelGrid,
    /// Thickness of the covering in metres: the deepest indentation it takes.
    #[schema(example = 0.00254)]
    pub covering_thickness: f64,
    /// Standard deviation of the Gaussian point spread in metres.
    #[schema(example = 0.003482)]
    pub point_spread: f64,
    /// Blurred displacement to pressure: 2 to 64 knots that start at (0, 0) and rise.
    #[schema(min_items = 2, max_items = 64)]
    pub force_curve: Vec<ForceKnot>,
    /// No taxel reads more than this, in pascal.
    #[schema(example = 20_000.0)]
    pub saturation: f64,
    /// Standard deviation of a reading's additive noise, in pascal.
    #[schema(example = 100.0)]
    pub noise: f64,
    /// Step of the analogue-to-digital converter in pascal; 0 for a continuous sensor.
    #[schema(example = 78.125)]
    pub quantisation: f64,
    /// How the driver's images are turned; not at all when not given.
    #[serde(default)]
    pub image_order: ImageOrder,
}

/// A rectangular grid of square taxels.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TaxelGrid {
    /// Number of rows, along +y.
    #[schema(minimum = 2, maximum = 128, example = 6)]
    pub rows: u32,
    /// Number of columns, along +x.
    #[schema(minimum = 2, maximum = 128, example = 6)]
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
    /// The pressure that a taxel reports there, in pascal.
    pub pressure: f64,
}

/// How the driver's image relates to the sensor frame's row-major order.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageOrder {
    /// The driver sends columns where we expect rows.
    #[serde(default)]
    pub transposed: bool,
    /// The driver's first row is our last.
    #[serde(default)]
    pub rows_reversed: bool,
    /// The driver's first column is our last.
    #[serde(default)]
    pub cols_reversed: bool,
}

/// How the server understands a reading; nothing is stored.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ReadingCheck {
    /// Rows of the image below.
    pub rows: u32,
    /// Columns of the image below.
    pub cols: u32,
    /// The image in the sensor frame's order, row-major, in pascal: turned as the sensor's
    /// `image_order` says, missing taxels filled in from their neighbours.
    pub image: Vec<f64>,
    /// Taxels without a value, as indices into `image`.
    pub missing: Vec<u32>,
    /// Taxels at the sensor's saturation, as indices into `image`.
    pub saturated: Vec<u32>,
    /// Taxels that touch something: above half of the largest pressure, and above the noise.
    pub contact: Vec<u32>,
    /// The largest pressure in pascal.
    pub max_pressure: f64,
    /// The centre of pressure in the sensor frame (z = 0); null without contact.
    pub centroid_in_sensor: Option<Point>,
    /// The same point in the session frame; null without contact or without a pose.
    pub centroid_in_session: Option<Point>,
    /// Where the sensor looks: its +z, towards the object, in the session frame; null without
    /// a pose.
    pub sensor_z_in_session: Option<Point>,
    /// The number of the calibration that would correct the reading, as it did `image`; null
    /// when the sensor has none.
    #[serde(default)]
    pub calibration: Option<u32>,
    /// Taxels that the calibration leaves out (dead or cross-wired), as indices into `image`.
    #[serde(default)]
    pub unusable: Vec<u32>,
    /// What is unusual about the reading, in words; `warnings` are among them.
    pub hints: Vec<String>,
    /// What is probably a mistake, such as pressures in kPa or positions in millimetres.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// A point in metres, or a direction of length 1.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Point {
    /// Along +x.
    pub x: f64,
    /// Along +y.
    pub y: f64,
    /// Along +z.
    pub z: f64,
}
