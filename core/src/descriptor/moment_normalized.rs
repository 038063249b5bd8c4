//! Moment normalisation: an image turned so that its major axis lies along +x.
//!
//! Source: section 4.3.2.4, Hu (1962); corrections in `docs/equations.md`: axes about the
//! image centre, the half-turn decided by the sign of μ30 after alignment, then μ21, and the
//! mask applied after turning too, so that its jagged edge does not turn with the image.

use super::disc::{Disc, DiscTaxel};
use super::vectorize::by_columns;
use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// Ratio of third-order to second-order moments below which the former decide nothing.
const AMBIGUOUS_SHARE: f64 = 1e-3;

/// The image masked by its inscribed circle and turned to its principal axes.
#[derive(Clone, Debug, PartialEq)]
pub struct MomentNormalized {
    /// The turned image, in the shape of the original.
    pub image: TactileImage,
    /// True when no third-order moment decided the half-turn: the descriptor may flip.
    pub ambiguous: bool,
}

/// Order of masking and turning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskOrder {
    /// Masks after turning (and for the moments): the circle's jagged edge does not turn.
    TurnFirst,
    /// Masks before turning, as printed: taxels outside the circle turn as zeros.
    MaskFirst,
}

/// Moment normalisation of images of one shape.
#[derive(Clone, Debug)]
pub struct MomentNormalizer {
    disc: Disc,
    taxels: Vec<DiscTaxel>,
    order: MaskOrder,
}

impl MomentNormalizer {
    /// Plans for images of `rows` × `cols` taxels.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        Self::with_mask(rows, cols, MaskOrder::TurnFirst)
    }

    /// Plans for images of `rows` × `cols` taxels with the given mask order.
    #[must_use]
    pub fn with_mask(rows: usize, cols: usize, order: MaskOrder) -> Self {
        let disc = Disc { rows, cols };
        Self { disc, taxels: disc.taxels(), order }
    }

    /// Turns an image to its principal axes about the image centre, by bilinear interpolation.
    #[must_use]
    pub fn normalize(&self, image: &TactileImage) -> MomentNormalized {
        let mut pressures = vec![0.0; image.pressures.len()];
        let ambiguous = self.turn(&image.pressures, &mut pressures);
        MomentNormalized { image: TactileImage { pressures, ..*image }, ambiguous }
    }

    /// Writes the turned image, row-major and zero outside the circle; returns whether the
    /// half-turn was ambiguous.
    pub(super) fn turn(&self, image: &[f64], turned: &mut [f64]) -> bool {
        let (angle, ambiguous) = self.principal_angle(image);
        let (sin, cos) = angle.sin_cos();
        let (center_row, center_col) = self.disc.center();
        turned.fill(0.0);
        if self.order == MaskOrder::MaskFirst {
            self.turn_masked(image, (sin, cos), turned);
            return ambiguous;
        }
        for &DiscTaxel { taxel, x: u, y: v } in &self.taxels {
            let (x, y) = (cos * u - sin * v, sin * u + cos * v);
            turned[taxel] = self.bilinear(image, y + center_row, x + center_col);
        }
        ambiguous
    }

    /// Masks the image, then turns all of it, as printed: taxels beyond the circle receive
    /// the values turned into them.
    fn turn_masked(&self, image: &[f64], (sin, cos): (f64, f64), turned: &mut [f64]) {
        let mut masked = vec![0.0; image.len()];
        for inside in &self.taxels {
            masked[inside.taxel] = image[inside.taxel];
        }
        let (center_row, center_col) = self.disc.center();
        for (taxel, value) in turned.iter_mut().enumerate() {
            let (u, v) = self.disc.about_center(taxel / self.disc.cols, taxel % self.disc.cols);
            let (x, y) = (cos * u - sin * v, sin * u + cos * v);
            *value = self.bilinear(&masked, y + center_row, x + center_col);
        }
    }

    /// The direction of the major axis (rad) with its half-turn decided, and whether that was
    /// ambiguous.
    fn principal_angle(&self, image: &[f64]) -> (f64, bool) {
        let (mut m11, mut m20, mut m02) = (0.0, 0.0, 0.0);
        for &DiscTaxel { taxel, x, y } in &self.taxels {
            m11 += image[taxel] * (x * y);
            m20 += image[taxel] * (x * x);
            m02 += image[taxel] * (y * y);
        }
        let angle = 0.5 * (2.0 * m11).atan2(m20 - m02);
        let (sin, cos) = angle.sin_cos();
        let (mut m30, mut m21) = (0.0, 0.0);
        for &DiscTaxel { taxel, x, y } in &self.taxels {
            let (u, v) = (cos * x + sin * y, -sin * x + cos * y);
            m30 += image[taxel] * (u * u * u);
            m21 += image[taxel] * (u * u * v);
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

    /// Bilinear between taxels; beyond the array, by at most half a taxel, the nearest taxel
    /// counts.
    fn bilinear(&self, image: &[f64], row: f64, col: f64) -> f64 {
        let (rows, cols) = (self.disc.rows as i64, self.disc.cols as i64);
        let (r0, c0) = (row.floor(), col.floor());
        let (fr, fc) = (row - r0, col - c0);
        let (r0, c0) = (r0 as i64, c0 as i64);
        let at =
            |r: i64, c: i64| image[(r.clamp(0, rows - 1) * cols + c.clamp(0, cols - 1)) as usize];
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
        let turned = workspace.lend(self.dimension(), 0).0;
        self.turn(&image.pressures, turned);
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

    #[test]
    fn a_uniform_touch_stays_uniform_at_any_angle() {
        // The slope determines the angle; the circle is full to its edge before and after. A
        // mask that turned with the image would leave holes of up to a half at the edge.
        for angle in [0.2_f64, 0.5, 0.9] {
            let (sin, cos) = angle.sin_cos();
            let at = |n: usize| {
                let (x, y) = ((n % 6) as f64 - 2.5, (n / 6) as f64 - 2.5);
                let along = cos * x + sin * y;
                1_000.0 + along + 0.1 * along * along
            };
            let image = TactileImage { rows: 6, cols: 6, pressures: (0..36).map(at).collect() };
            let normalizer = MomentNormalizer::new(6, 6);
            let turned = normalizer.normalize(&image).image;
            for inside in &normalizer.taxels {
                assert!((turned.pressures[inside.taxel] / 1_000.0 - 1.0).abs() < 0.02);
            }
            assert!(turned.pressures[0].abs() < 1e-12); // a corner
        }
    }

    #[test]
    fn masking_before_turning_leaves_holes_at_the_edge() {
        // The printed order: a uniform touch at an oblique angle is no longer uniform, since
        // zeros of the corners turn into the circle.
        let at = |n: usize| {
            let (x, y) = ((n % 6) as f64 - 2.5, (n / 6) as f64 - 2.5);
            let along = 0.5_f64.cos() * x + 0.5_f64.sin() * y;
            1_000.0 + along + 0.1 * along * along
        };
        let image = TactileImage { rows: 6, cols: 6, pressures: (0..36).map(at).collect() };
        let printed = MomentNormalizer::with_mask(6, 6, MaskOrder::MaskFirst);
        let turned = printed.normalize(&image).image;
        let inside = printed.taxels.iter().map(|inside| turned.pressures[inside.taxel]);
        let least = inside.fold(f64::INFINITY, f64::min);
        assert!((500.0..950.0).contains(&least), "{least}");
        // The middle stays uniform.
        assert!((turned.pressures[14] / 1_000.0 - 1.0).abs() < 0.02);
    }

    proptest! {
        #[test]
        fn quarter_turns_keep_the_descriptor(image in any_image(6, 6)) {
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
