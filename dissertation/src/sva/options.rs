//! Options of the filter: the service's settings, and those of the dissertation.

use crate::filter::pose_bins::{Lattice, PoseBins};
use crate::filter::sparse::ProductRule;
use crate::rotation_grid::RotationGrid;
use crate::sva::priors::MatchPriors;
use crate::sva::refine::Refinement;
use palpate_core::units::MM;

/// Multiplicity of a pair's evidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PairWeight {
    /// As printed (equation 5.13): (t, i) and (i, t) both count, though they are the same
    /// evidence.
    BothOrders,
    /// Every pair counts once.
    Once,
}

/// The pose that represents a histogram bin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinPose {
    /// The centre of the bin, as printed (section 5.5.1.2).
    Center,
    /// The mean of the poses of the evidence in it.
    Mean,
}

/// Options of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SvaOptions {
    /// The histogram's bins.
    pub bins: PoseBins,
    /// The pose that represents a bin.
    pub bin_pose: BinPose,
    /// Product of the pairs' distributions.
    pub rule: ProductRule,
    /// Priors of classes and distances in a match.
    pub priors: MatchPriors,
    /// Multiplicity of a pair.
    pub pair_weight: PairWeight,
    /// Tolerance on the cosine of the normals' angles with the pair's axis, beyond which
    /// pairs do not match; `None` as printed.
    pub normal_tolerance: Option<f64>,
    /// σ_init of section 5.4.3.2, rad.
    pub sigma_init: f64,
    /// Step between sampled rotations about a pair's axis, rad.
    pub turn_step: f64,
    /// Range of sampled rotations, in deviations to each side of the mean.
    pub turn_reach: f64,
    /// Maximum number of earlier readings with which a new one is paired.
    pub partners_max: usize,
    /// Maximum number of bins per object.
    pub bins_max: usize,
    /// Refinement of poses within their bins; `None` as printed.
    pub refinement: Option<Refinement>,
}

impl Default for SvaOptions {
    /// The service's settings (`docs/equations.md`, chapter 5).
    fn default() -> Self {
        Self {
            bins: PoseBins {
                edge: 8.0 * MM,
                rotations: RotationGrid::CubedHypersphere { n: 6 },
                workspace: 400.0 * MM,
                lattice: Lattice::Space,
            },
            bin_pose: BinPose::Mean,
            rule: ProductRule::Floored { floor: 0.05 },
            priors: MatchPriors::Even,
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
                lattice: Lattice::Space,
            },
            bin_pose: BinPose::Center,
            rule: ProductRule::Strict,
            pair_weight: PairWeight::BothOrders,
            normal_tolerance: None,
            // A strict product needs the tails: a rotation that is not sampled is impossible.
            turn_step: 0.25,
            turn_reach: 5.0,
            // More than any trial of the dissertation; the cost of a session must be bounded.
            partners_max: 128,
            bins_max: usize::MAX,
            refinement: None,
            ..Self::default()
        }
    }

    /// The same filter on poses in the plane, as on raised letters (section 5.5.2): 21 × 21 bins
    /// over ±10 mm.
    #[must_use]
    pub fn in_plane(self) -> Self {
        let workspace = 20.0 * MM;
        let edge = workspace / 21.0;
        let bins = PoseBins { edge, workspace, lattice: Lattice::Plane, ..self.bins };
        Self { bins, ..self }
    }
}
