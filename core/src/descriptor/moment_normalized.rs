//! Moment normalisation: an image turned so that its major axis lies along +x.
//!
//! Source: section 4.3.2.4, Hu (1962); corrections in `docs/equations.md`: axes about the
//! image centre, and the half-turn decided by the sign of μ30 after alignment, then μ21.

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

/// Turns an image to its principal axes about the image centre, by bilinear interpolation.
#[must_use]
pub fn moment_normalize(image: &TactileImage) -> MomentNormalized {
    let masked = mask_circle(image);
    let m11 = moment(&masked, 0.0, |x, y| x * y);
    let m20 = moment(&masked, 0.0, |x, _| x * x);
    let m02 = moment(&masked, 0.0, |_, y| y * y);
    let angle = 0.5 * (2.0 * m11).atan2(m20 - m02);
    let m30 = moment(&masked, angle, |x, _| x * x * x);
    let m21 = moment(&masked, angle, |x, y| x * x * y);
    let radius = image.rows.min(image.cols) as f64 / 2.0;
    let decisive = AMBIGUOUS_SHARE * (m20 + m02) * radius;
    let (sign, ambiguous) = match (m30.abs() > decisive, m21.abs() > decisive) {
        (true, _) => (m30, false),
        (false, true) => (m21, false),
        (false, false) => (1.0, true),
    };
    let angle = if sign < 0.0 { angle + std::f64::consts::PI } else { angle };
    MomentNormalized { image: turn(&masked, angle), ambiguous }
}

/// Sum of pressure · weight(x, y), with (x, y) about the image centre in taxels, in axes
/// turned by `angle` (rad).
fn moment(image: &TactileImage, angle: f64, weight: impl Fn(f64, f64) -> f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let mut sum = 0.0;
    for row in 0..image.rows {
        for col in 0..image.cols {
            let (x, y) = from_center(image, row, col);
            sum += image.at(row, col) * weight(cos * x + sin * y, -sin * x + cos * y);
        }
    }
    sum
}

fn from_center(image: &TactileImage, row: usize, col: usize) -> (f64, f64) {
    let center = |n: usize| (n as f64 - 1.0) / 2.0;
    (col as f64 - center(image.cols), row as f64 - center(image.rows))
}

fn mask_circle(image: &TactileImage) -> TactileImage {
    let radius = image.rows.min(image.cols) as f64 / 2.0;
    let mut masked = image.clone();
    for row in 0..image.rows {
        for col in 0..image.cols {
            let (x, y) = from_center(image, row, col);
            if x * x + y * y > radius * radius {
                masked.pressures[row * image.cols + col] = 0.0;
            }
        }
    }
    masked
}

/// The image seen in axes turned by `angle` (rad): bilinear, 0 outside.
fn turn(image: &TactileImage, angle: f64) -> TactileImage {
    let (sin, cos) = angle.sin_cos();
    let center = |n: usize| (n as f64 - 1.0) / 2.0;
    let mut pressures = Vec::with_capacity(image.pressures.len());
    for row in 0..image.rows {
        for col in 0..image.cols {
            let (u, v) = from_center(image, row, col);
            let (x, y) = (cos * u - sin * v, sin * u + cos * v);
            pressures.push(bilinear(image, y + center(image.rows), x + center(image.cols)));
        }
    }
    TactileImage { pressures, ..*image }
}

fn bilinear(image: &TactileImage, row: f64, col: f64) -> f64 {
    let (r0, c0) = (row.floor(), col.floor());
    let (fr, fc) = (row - r0, col - c0);
    let at = |r: f64, c: f64| {
        let inside = r >= 0.0 && c >= 0.0 && r < image.rows as f64 && c < image.cols as f64;
        if inside { image.at(r as usize, c as usize) } else { 0.0 }
    };
    (1.0 - fr) * ((1.0 - fc) * at(r0, c0) + fc * at(r0, c0 + 1.0))
        + fr * ((1.0 - fc) * at(r0 + 1.0, c0) + fc * at(r0 + 1.0, c0 + 1.0))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;
    use crate::descriptor::test_images::blob;
    use crate::descriptor::{affinity, normalize};

    #[test]
    fn quarter_turns_give_the_same_image() {
        let describe = |angle| {
            let mut feature = moment_normalize(&blob(6, angle, 0.0, 0.0)).image.pressures;
            normalize(&mut feature);
            feature
        };
        let straight = describe(0.3);
        for quarter in 1..4 {
            let turned = describe(0.3 + f64::from(quarter) * FRAC_PI_2);
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
        assert!(moment_normalize(&image).ambiguous);
        assert!(!moment_normalize(&blob(6, 0.0, 0.0, 0.0)).ambiguous);
    }
}
