//! How the filter works: the service's own resolutions, and those of the dissertation.

use crate::filter::pose_bins::PoseBins;
use crate::filter::sparse::ProductRule;
use crate::rotation_grid::RotationGrid;
use crate::sva::refine::Refinement;
use palpate_core::units::MM;

/// How often the evidence of a pair counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PairWeight {
    /// As printed (equation 5.13): (t, i) and (i, t) both count, though they say the same.
    BothOrders,
    /// Every pair counts once.
    Once,
}

/// Which pose stands for a histogram bin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinPose {
    /// The centre of the bin, as printed (section 5.5.1.2).
    Center,
    /// The mean of the poses that evidence named within it.
    Mean,
}

/// How the filter works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SvaOptions {
    /// The histogram's bins.
    pub bins: PoseBins,
    /// Where in a bin its pose is.
    pub bin_pose: BinPose,
    /// How pairs are multiplied.
    pub rule: ProductRule,
    /// How often a pair counts.
    pub pair_weight: PairWeight,
    /// Pairs whose normals make other angles with their axis (difference of cosines) do not
    /// match; `None` as printed.
    pub normal_tolerance: Option<f64>,
    /// σ_init of section 5.4.3.2, rad.
    pub sigma_init: f64,
    /// Distance between sampled turns about a pair's axis, rad.
    pub turn_step: f64,
    /// How many deviations to each side of the mean turn are sampled.
    pub turn_reach: f64,
    /// A new reading is paired with at most this many earlier ones.
    pub partners_max: usize,
    /// At most this many bins are kept for an object.
    pub bins_max: usize,
    /// How answered poses are refined within their bins; `None` as printed.
    pub refinement: Option<Refinement>,
}

impl Default for SvaOptions {
    /// The service's own resolutions (`docs/equations.md`, chapter 5).
    fn default() -> Self {
        Self {
            bins: PoseBins {
                edge: 8.0 * MM,
                rotations: RotationGrid::CubedHypersphere { n: 6 },
                workspace: 400.0 * MM,
            },
            bin_pose: BinPose::Mean,
            rule: ProductRule::Floored { floor: 0.05 },
            pair_weight: PairWeight::Once,
            normal_tolerance: Some(0.25),
            sigma_init: 0.1,
            turn_step: 0.4,
            turn_reach: 2.0,
            partners_max: 16,
            bins_max: 4_000,
            refinement: Some(Refinement::default()),
        }
    }
}

impl SvaOptions {
    /// As the dissertation prints it: 50³ × 9³ bins, strict products of both orders.
    #[must_use]
    pub fn literal() -> Self {
        Self {
            bins: PoseBins {
                edge: 8.0 * MM,
                rotations: RotationGrid::Rodrigues { n: 9 },
                workspace: 400.0 * MM,
            },
            bin_pose: BinPose::Center,
            rule: ProductRule::Strict,
            pair_weight: PairWeight::BothOrders,
            normal_tolerance: None,
            // A strict product needs the tails: a turn that is not sampled is impossible.
            turn_step: 0.25,
            turn_reach: 5.0,
            // More than any trial of the dissertation; what a session costs must be bounded.
            partners_max: 128,
            bins_max: usize::MAX,
            refinement: None,
            ..Self::default()
        }
    }
}
