//! Analyses on the wire: computations on the request alone. Nothing is stored.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Coverings to compare, given by thickness or by point spread.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AnalyseCoverings {
    /// Width of a sensing element (the sensor's pitch), in metres.
    #[schema(example = 0.002)]
    pub element_width: f64,
    /// Thicknesses of the coverings, in metres. Excludes `spreads`. Default: the dissertation's
    /// four.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 50, example = json!([0.001016, 0.00254]))]
    pub thicknesses: Option<Vec<f64>>,
    /// Standard deviations of Gaussian point spreads, in metres. Excludes `thicknesses`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 50)]
    pub spreads: Option<Vec<f64>>,
    /// Force resolutions, as fractions of the impulse. Default: 25 values from 0.001 to 0.5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 50)]
    pub force_resolutions: Option<Vec<f64>>,
}

/// Comparison of coverings.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct CoveringAnalysis {
    /// Width of a sensing element, in metres.
    pub element_width: f64,
    /// The smallest point spread that avoids aliasing, in metres.
    pub aliasing_spread: f64,
    /// The coverings, in the order of the request.
    pub coverings: Vec<CoveringTradeOff>,
    /// Index into `coverings` of the sharpest one that avoids aliasing; null if none does.
    pub recommended: Option<u32>,
    /// The recommendation, as a sentence.
    pub reason: String,
}

/// Benefits and costs of one covering.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct CoveringTradeOff {
    /// Thickness in metres; null if no polyurethane covering has so small a point spread.
    pub thickness: Option<f64>,
    /// Standard deviation of the point spread, in metres.
    pub spread: f64,
    /// The point spread in element widths.
    pub spread_in_widths: f64,
    /// Largest displacement that can be measured, in metres: the thickness.
    pub depth_range: Option<f64>,
    /// Whether the covering suppresses the frequencies that the elements would alias.
    pub avoids_aliasing: bool,
    /// Spatial acuity at each force resolution.
    pub acuity: Vec<SpatialAcuity>,
}

/// Spatial acuity at one force resolution.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SpatialAcuity {
    /// Smallest step of force, as a fraction of the impulse.
    pub force_resolution: f64,
    /// Number of distinct images as a point moves over one element, out of 51 positions.
    pub representations: u32,
    /// Distance in metres at which two points can be told from one point of twice the force; null
    /// if they never can.
    pub two_point_distance: Option<f64>,
}
