//! Moment normalisation: an image turned so that its major axis lies along +x.
//!
//! Source: section 4.3.2.4, Hu (1962); corrections in `docs/equations.md`: axes about the
//! image centre, and the half-turn decided by the sign of μ30 after alignment, then μ21.

use super::disc::{Disc, DiscTaxel};
use super::vectorize::by_columns;
use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// A third-order moment smaller than this share of the second-order ones decides nothing.
const AMBIGUOUS_SHARE: f64 = 1e-3;

/// The image masked by its inscribed circle and turned to its principal axes.
#[derive(Clone, Debug, PartialEq)]
pub struct MomentNormalized {
    /// The turned image, in the shape of the original.
    pub image: TactileImage,
    /// True when no third-order moment could tell a half-turn: the descriptor may flip.
    pub ambiguous: bool,
}

/// Moment normalisation of images of one shape.
#[derive(Clone, Debug)]
pub struct MomentNormalizer {
    disc: Disc,
    taxels: Vec<DiscTaxel>,
}

impl MomentNormalizer {
    /// Plans for images of `rows` × `cols` taxels.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        let disc = Disc { rows, cols };
        Self { disc, taxels: disc.taxels() }
    }

    /// Turns an image to its principal axes about the image centre, by bilinear interpolation.
    #[must_use]
    pub fn normalize(&self, image: &TactileImage) -> MomentNormalized {
        let mut masked = vec![0.0; image.pressures.len()];
        let mut pressures = masked.clone();
        let ambiguous = self.turn(&image.pressures, &mut masked, &mut pressures);
        MomentNormalized { image: TactileImage { pressures, ..*image }, ambiguous }
    }

    /// Writes the turned image, row-major, and says whether the half-turn was ambiguous;
    /// `masked` is room for one more image.
    pub(super) fn turn(&self, image: &[f64], masked: &mut [f64], turned: &mut [f64]) -> bool {
        masked.fill(0.0);
        for inside in &self.taxels {
            masked[inside.taxel] = image[inside.taxel];
        }
        let (angle, ambiguous) = self.principal_angle(masked);
        let (sin, cos) = angle.sin_cos();
        let (center_row, center_col) = self.disc.center();
        for row in 0..self.disc.rows {
            for col in 0..self.disc.cols {
                let (u, v) = self.disc.about_center(row, col);
                let (x, y) = (cos * u - sin * v, sin * u + cos * v);
                turned[row * self.disc.cols + col] =
                    self.bilinear(masked, y + center_row, x + center_col);
            }
        }
        ambiguous
    }

    /// The direction of the major axis (rad) with its half-turn decided, and whether it
    /// could not be.
    fn principal_angle(&self, masked: &[f64]) -> (f64, bool) {
        let (mut m11, mut m20, mut m02) = (0.0, 0.0, 0.0);
        for &DiscTaxel { taxel, x, y } in &self.taxels {
            m11 += masked[taxel] * (x * y);
            m20 += masked[taxel] * (x * x);
            m02 += masked[taxel] * (y * y);
        }
        let angle = 0.5 * (2.0 * m11).atan2(m20 - m02);
        let (sin, cos) = angle.sin_cos();
        let (mut m30, mut m21) = (0.0, 0.0);
        for &DiscTaxel { taxel, x, y } in &self.taxels {
            let (u, v) = (cos * x + sin * y, -sin * x + cos * y);
            m30 += masked[taxel] * (u * u * u);
            m21 += masked[taxel] * (u * u * v);
        }
        let radius = self.disc.diameter() as f64 / 2.0;
        let decisive = AMBIGUOUS_SHARE * (m20 + m02) * radius;
        let (sign, ambiguous) = match (m30.abs() > decisive, m21.abs() > decisive) {
            (true, _) => (m30, false),
            (false, true) => (m21, false),
            (false, false) => (1.0, true),
        };
        (if sign < 0.0 { angle + std::f64::consts::PI } else { angle }, ambiguous)
    }

    fn bilinear(&self, image: &[f64], row: f64, col: f64) -> f64 {
        let (rows, cols) = (self.disc.rows as i64, self.disc.cols as i64);
        let (r0, c0) = (row.floor(), col.floor());
        let (fr, fc) = (row - r0, col - c0);
        let (r0, c0) = (r0 as i64, c0 as i64);
        let at = |r: i64, c: i64| {
            let inside = r >= 0 && c >= 0 && r < rows && c < cols;
            if inside { image[(r * cols + c) as usize] } else { 0.0 }
        };
        (1.0 - fr) * ((1.0 - fc) * at(r0, c0) + fc * at(r0, c0 + 1))
            + fr * ((1.0 - fc) * at(r0 + 1, c0) + fc * at(r0 + 1, c0 + 1))
    }
}

impl Descriptor for MomentNormalizer {
    fn shape(&self) -> (usize, usize) {
        (self.disc.rows, self.disc.cols)
    }

    fn dimension(&self) -> usize {
        self.disc.rows * self.disc.cols
    }

    fn write(&self, image: &TactileImage, workspace: &mut Workspace, features: &mut [f64]) {
        let n = self.dimension();
        let (masked, turned) = workspace.lend(2 * n, 0).0.split_at_mut(n);
        self.turn(&image.pressures, masked, turned);
        by_columns(turned, self.disc.cols, features);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::test_support::{
        any_image, blob, check_quarter_turn, feature, turned_affinity,
    };
    use crate::descriptor::{DescriptorKind, affinity};

    #[test]
    fn quarter_turns_give_the_same_image() {
        let straight = feature(DescriptorKind::MomentNormalized, &blob(6, 0.3, 0.0, 0.0));
        for quarter in 1..4 {
            let image = blob(6, 0.3 + f64::from(quarter) * FRAC_PI_2, 0.0, 0.0);
            let turned = feature(DescriptorKind::MomentNormalized, &image);
            assert!(affinity(&straight, &turned) > 1.0 - 1e-9, "{quarter} quarters");
        }
    }

    #[test]
    fn a_symmetric_image_is_flagged_as_ambiguous() {
        let pressures: Vec<f64> = (0..36)
            .map(|n| {
                let (x, y) = (f64::from(n % 6) - 2.5, f64::from(n / 6) - 2.5);
                (-0.5 * (x * x / 4.0 + y * y)).exp()
            })
            .collect();
        let image = TactileImage { rows: 6, cols: 6, pressures };
        let normalizer = MomentNormalizer::new(6, 6);
        assert!(normalizer.normalize(&image).ambiguous);
        assert!(!normalizer.normalize(&blob(6, 0.0, 0.0, 0.0)).ambiguous);
    }

    proptest! {
        #[test]
        fn any_image_keeps_its_descriptor_in_a_quarter_turn(image in any_image(6, 6)) {
            prop_assume!(!MomentNormalizer::new(6, 6).normalize(&image).ambiguous);
            check_quarter_turn(DescriptorKind::MomentNormalized, &image, 1e-6);
        }

        #[test]
        fn rotation_of_a_smooth_image_changes_little(angle in -3.1..3.1_f64) {
            let kept = turned_affinity(DescriptorKind::MomentNormalized, angle);
            prop_assert!(kept > 0.99, "{kept}");
        }
    }
}
