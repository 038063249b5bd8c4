//! Analyses on the wire: questions that are answered without storing anything.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Coverings to compare, by thickness or by point spread.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AnalyseCoverings {
    /// Width of a sensing element (the sensor's pitch), in metres.
    #[schema(example = 0.002)]
    pub element_width: f64,
    /// Thicknesses of coverings, in metres. Give either these or `spreads`; with neither, the
    /// dissertation's four are compared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 50, example = json!([0.001016, 0.00254]))]
    pub thicknesses: Option<Vec<f64>>,
    /// Standard deviations of Gaussian point spreads, in metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 50)]
    pub spreads: Option<Vec<f64>>,
    /// Force resolutions as parts of the impulse; 25 from 0.001 to 0.5 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 50)]
    pub force_resolutions: Option<Vec<f64>>,
}

/// How coverings compare.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct CoveringAnalysis {
    /// Width of a sensing element, in metres.
    pub element_width: f64,
    /// The smallest point spread that avoids aliasing, in metres.
    pub aliasing_spread: f64,
    /// The coverings, as they were asked for.
    pub coverings: Vec<CoveringTradeOff>,
    /// The sharpest covering that avoids aliasing, as an index into `coverings`; null when
    /// none does.
    pub recommended: Option<u32>,
    /// The recommendation in words.
    pub reason: String,
}

/// What one covering gives and costs.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct CoveringTradeOff {
    /// Thickness in metres; null when no polyurethane covering is so sharp.
    pub thickness: Option<f64>,
    /// Standard deviation of the point spread, in metres.
    pub spread: f64,
    /// The same in element widths.
    pub spread_in_widths: f64,
    /// The deepest displacement that can be felt, in metres: the thickness.
    pub depth_range: Option<f64>,
    /// Whether frequencies that the elements cannot tell apart are suppressed.
    pub avoids_aliasing: bool,
    /// What can be told apart at each force resolution.
    pub acuity: Vec<SpatialAcuity>,
}

/// What can be told apart at one force resolution.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SpatialAcuity {
    /// The smallest step of force as a part of the impulse.
    pub force_resolution: f64,
    /// Different images while a point moves over one element, of 51 places.
    pub representations: u32,
    /// Distance in metres from which two points differ from one of twice the force; null when
    /// they never do.
    pub two_point_distance: Option<f64>,
}
