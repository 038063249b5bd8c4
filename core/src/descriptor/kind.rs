//! The available descriptors and their names.

use super::mnti::Mnti;
use super::moment_normalized::MomentNormalizer;
use super::mr8::Mr8;
use super::polar_fourier::{PolarFourier, PolarFourierForm};
use super::polar_spectrum::PolarSpectrum;
use super::schmid::Schmid;
use super::sift::Sift;
use super::steerable::Steerable;
use super::vectorize::Vectorize;
use super::{Descriptor, FeatureMatrix};
use crate::reading::TactileImage;

/// A descriptor before planning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptorKind {
    /// The image itself, columns concatenated (section 4.3.2.1): the negative control.
    Vectorize,
    /// Lowe's histograms of gradients of the whole image (section 4.3.2.2).
    Sift,
    /// Largest responses of oriented filters in four windows (section 4.3.2.3): several
    /// features per reading.
    Mr8,
    /// The image turned to its principal axes (section 4.3.2.4).
    MomentNormalized,
    /// Fourier magnitudes of rings and of their sums and differences (section 4.3.2.5.1).
    PolarFourier,
    /// Polar-Fourier, each row divided by the root of its radius (rwPF).
    PolarFourierRw,
    /// Polar-Fourier of the rings alone (niPF).
    PolarFourierNi,
    /// Polar-Fourier and third-order products that distinguish mirror images.
    PolarFourierSigned,
    /// Moment-normalised, translation-invariant (section 4.3.2.5.2).
    Mnti,
    /// Magnitudes of spatial frequencies without position and direction: beyond the dissertation.
    PolarSpectrum,
    /// Derivatives at the centre, steered to the gradient: a control that performed poorly.
    Steerable,
    /// Responses of round filters: a control that performed poorly.
    Schmid,
}

impl DescriptorKind {
    /// Every descriptor.
    pub const ALL: [Self; 12] = [
        Self::Vectorize,
        Self::Sift,
        Self::Mr8,
        Self::MomentNormalized,
        Self::PolarFourier,
        Self::PolarFourierRw,
        Self::PolarFourierNi,
        Self::PolarFourierSigned,
        Self::Mnti,
        Self::PolarSpectrum,
        Self::Steerable,
        Self::Schmid,
    ];

    /// The name in the API.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Vectorize => "vectorize",
            Self::Sift => "sift",
            Self::Mr8 => "mr8",
            Self::MomentNormalized => "moment_normalized",
            Self::PolarFourier => "polar_fourier",
            Self::PolarFourierRw => "polar_fourier_rw",
            Self::PolarFourierNi => "polar_fourier_ni",
            Self::PolarFourierSigned => "polar_fourier_signed",
            Self::Mnti => "mnti",
            Self::PolarSpectrum => "polar_spectrum",
            Self::Steerable => "steerable",
            Self::Schmid => "schmid",
        }
    }

    /// Whether a reading has one feature for every image shape, as methods with one
    /// appearance per touch require.
    #[must_use]
    pub fn gives_one_feature(self) -> bool {
        self != Self::Mr8
    }

    /// Plans the descriptor for images of `rows` × `cols` taxels, at least one of each.
    #[must_use]
    pub fn plan(self, rows: usize, cols: usize) -> Box<dyn Descriptor> {
        let polar = |form| Box::new(PolarFourier::new(rows, cols, form));
        match self {
            Self::Vectorize => Box::new(Vectorize::new(rows, cols)),
            Self::Sift => Box::new(Sift::new(rows, cols)),
            Self::Mr8 => Box::new(Mr8::new(rows, cols)),
            Self::MomentNormalized => Box::new(MomentNormalizer::new(rows, cols)),
            Self::PolarFourier => polar(PolarFourierForm::Interleaved),
            Self::PolarFourierRw => polar(PolarFourierForm::RadiallyWeighted),
            Self::PolarFourierNi => polar(PolarFourierForm::NonInterleaved),
            Self::PolarFourierSigned => polar(PolarFourierForm::Signed),
            Self::Mnti => Box::new(Mnti::new(rows, cols)),
            Self::PolarSpectrum => Box::new(PolarSpectrum::new(rows, cols)),
            Self::Steerable => Box::new(Steerable::new(rows, cols)),
            Self::Schmid => Box::new(Schmid::new(rows, cols)),
        }
    }

    /// The features of one image; to describe many, plan once.
    #[must_use]
    pub fn describe(self, image: &TactileImage) -> FeatureMatrix {
        self.plan(image.rows, image.cols).describe(&[image])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::affinity;
    use crate::descriptor::test_support::{any_image, blob, check_descriptor, mirrored};

    #[test]
    fn every_shape_from_1_to_128_can_be_described() {
        let areas = [(2, 2), (2, 3), (3, 2), (5, 5), (6, 6), (6, 8), (28, 50), (128, 3), (2, 128)];
        let rows = [(1, 2), (1, 8), (8, 1), (1, 128), (128, 1)];
        for (rows, cols) in areas.into_iter().chain(rows) {
            let pressures = (0..rows * cols).map(|n| ((n * n) % 11) as f64 * 500.0).collect();
            check_descriptor(&TactileImage { rows, cols, pressures });
        }
        check_descriptor(&blob(26, 0.4, 0.2, 0.1));
        check_descriptor(&TactileImage { rows: 1, cols: 1, pressures: vec![3.0] });
    }

    #[test]
    fn the_largest_image_can_be_described() {
        let image = blob(128, 0.4, 0.2, 0.1);
        for kind in DescriptorKind::ALL {
            let described = kind.describe(&image);
            let row = described.row(0);
            assert!((affinity(row, row) - 1.0).abs() < 1e-9, "{kind:?}");
        }
    }

    proptest! {
        #[test]
        fn features_have_unit_norm_at_any_intensity(image in any_image(6, 7)) {
            check_descriptor(&image);
        }
    }

    #[test]
    fn images_without_contact_have_zero_features() {
        let image = TactileImage { rows: 6, cols: 6, pressures: vec![0.0; 36] };
        for kind in DescriptorKind::ALL {
            let described = kind.describe(&image);
            assert!(described.values().iter().all(|value| value.abs() < 1e-15), "{kind:?}");
        }
    }

    #[test]
    fn only_some_descriptors_distinguish_mirror_images() {
        let image = blob(12, 0.3, 0.4, 0.2);
        for kind in [DescriptorKind::PolarFourier, DescriptorKind::PolarFourierNi] {
            let described = [kind.describe(&image), kind.describe(&mirrored(&image))];
            let kept = affinity(described[0].row(0), described[1].row(0));
            assert!(kept > 1.0 - 1e-9, "{kind:?}: {kept}");
        }
        let signed = DescriptorKind::PolarFourierSigned;
        let bent = bent_blob();
        let described = [signed.describe(&bent), signed.describe(&mirrored(&bent))];
        let kept = affinity(described[0].row(0), described[1].row(0));
        assert!(kept < 0.99, "{kept}");
    }

    /// An asymmetric letter such as p, which no rotation turns into its mirror image q.
    fn bent_blob() -> TactileImage {
        let drawn = [
            "............",
            "...####.....",
            "...##.##....",
            "...##..##...",
            "...##..##...",
            "...##.##....",
            "...####.....",
            "...##.......",
            "...##.......",
            "...##.......",
            "............",
            "............",
        ];
        let pressure = |mark| if mark == '#' { 5e3 } else { 0.0 };
        let pressures = drawn.concat().chars().map(pressure).collect();
        TactileImage { rows: 12, cols: 12, pressures }
    }
}
