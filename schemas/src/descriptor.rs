//! Descriptors of appearance on the wire: how a press becomes a feature.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How a press becomes a feature.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Descriptor {
    /// The pressures themselves: neither turns nor shifts are removed.
    Vectorize,
    /// Histograms of gradients, turned to the dominant orientation.
    Sift,
    /// Largest responses of oriented filters in four windows: several features a press, so not
    /// for methods that give each touch one appearance (`sva`, `sva_literal`).
    Mr8,
    /// The image turned to its principal axes.
    MomentNormalized,
    /// Fourier magnitudes of rings: does not change when the press is turned.
    PolarFourier,
    /// `polar_fourier` with each row divided by the root of its radius.
    PolarFourierRw,
    /// `polar_fourier` without the relations of neighbouring rings.
    PolarFourierNi,
    /// `polar_fourier` and what tells a press from its mirror image.
    PolarFourierSigned,
    /// Fourier magnitudes of the image turned to its principal axes: changes little when the
    /// press is turned or shifted.
    Mnti,
    /// Derivatives at the centre along the gradient: a control.
    Steerable,
    /// Responses of round filters: a control.
    Schmid,
    /// Strengths of spatial frequencies without place and direction, for large arrays.
    PolarSpectrum,
}
