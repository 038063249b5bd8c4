//! Recognition methods on the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Recognition method.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Surface matching: pairs of touches propose poses, all touches verify them, and the best are
    /// refined. Also detects objects that are not in the catalogue. Needs a version trained with
    /// surfaces (the default); accepts readings of any sensor.
    #[default]
    Surface,
    /// Spatially varying appearance with the corrections of `docs/equations.md`.
    Sva,
    /// Spatially varying appearance as the dissertation prints it, for its figures.
    SvaLiteral,
    /// Contact and pressure maps over the poses of a bounded prior. Needs a version trained with
    /// `geometric`; accepts readings of any sensor.
    Geometric,
    /// Contact maps with the dissertation's histogram filter, for its figures.
    GeometricHistogram,
    /// Contact maps with the dissertation's particle filter, for its figures.
    GeometricParticles,
    /// Bags of features: identity only, no pose. Needs a version trained with `appearance`. Poses
    /// are optional, and the object may move between touches.
    Appearance,
    /// Bags of features with the rule as the dissertation prints it, for its figures.
    AppearanceLiteral,
}

impl Method {
    /// Its name, as on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::Sva => "sva",
            Self::SvaLiteral => "sva_literal",
            Self::Geometric => "geometric",
            Self::GeometricHistogram => "geometric_histogram",
            Self::GeometricParticles => "geometric_particles",
            Self::Appearance => "appearance",
            Self::AppearanceLiteral => "appearance_literal",
        }
    }

    /// Whether it needs contact maps, and a prior over poses.
    #[must_use]
    pub fn is_geometric(self) -> bool {
        matches!(self, Self::Geometric | Self::GeometricHistogram | Self::GeometricParticles)
    }

    /// Whether it compares appearance alone: it needs no poses, and the object may move.
    #[must_use]
    pub fn is_appearance(self) -> bool {
        matches!(self, Self::Appearance | Self::AppearanceLiteral)
    }
}
