//! Descriptors of appearance on the wire: how a press becomes a feature.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Descriptor that turns a press into a feature.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum Descriptor {
    /// The raw pressures; neither rotation nor shift is removed.
    Vectorize,
    /// Histograms of gradients, rotated to the dominant orientation.
    Sift,
    /// Largest responses of oriented filters in four windows. Yields several features per press, so
    /// it is not for `sva` and `sva_literal`, which assign one appearance to each touch.
    Mr8,
    /// The image rotated to its principal axes.
    MomentNormalized,
    /// Fourier magnitudes of rings; invariant to rotation of the press.
    PolarFourier,
    /// `polar_fourier` with each row divided by the square root of its radius.
    PolarFourierRw,
    /// `polar_fourier` without the relations between neighbouring rings.
    PolarFourierNi,
    /// `polar_fourier` plus components that distinguish a press from its mirror image.
    PolarFourierSigned,
    /// Fourier magnitudes of the image rotated to its principal axes; nearly invariant to rotation
    /// and shift of the press.
    Mnti,
    /// Derivatives at the centre, along the gradient; a control.
    Steerable,
    /// Responses of isotropic filters; a control.
    Schmid,
    /// Energy per spatial frequency, without place and direction; for large arrays.
    PolarSpectrum,
}
