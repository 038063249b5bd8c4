//! Test images and the check shared by all descriptors.

use proptest::prelude::*;

use super::{DescriptorKind, affinity};
use crate::reading::TactileImage;

/// An off-centre elongated blob with a tail, turned by `angle` (rad) and moved by
/// `(dx, dy)` sixths of the side, on a `side` × `side` array.
pub(crate) fn blob(side: usize, angle: f64, dx: f64, dy: f64) -> TactileImage {
    let center = (side as f64 - 1.0) / 2.0;
    let unit = side as f64 / 6.0;
    let (sin, cos) = angle.sin_cos();
    let value = |row: usize, col: usize| {
        let (x, y) = ((col as f64 - center) / unit - dx, (row as f64 - center) / unit - dy);
        let (u, v) = (cos * x + sin * y, -sin * x + cos * y);
        let body = (-0.5 * ((u / 1.6).powi(2) + (v / 0.8).powi(2))).exp();
        let head = 0.8 * (-0.5 * (((u - 1.4) / 0.7).powi(2) + (v / 0.7).powi(2))).exp();
        5_000.0 * (body + head)
    };
    let pressures = (0..side * side).map(|n| value(n / side, n % side)).collect();
    TactileImage { rows: side, cols: side, pressures }
}

/// Images of independent pressures, Pa.
pub(crate) fn any_image(rows: usize, cols: usize) -> impl Strategy<Value = TactileImage> {
    prop::collection::vec(0.0..9_000.0_f64, rows * cols).prop_map(move |pressures| TactileImage {
        rows,
        cols,
        pressures,
    })
}

/// An image turned by 90°: its columns become rows.
pub(crate) fn quarter_turned(image: &TactileImage) -> TactileImage {
    let (rows, cols) = (image.cols, image.rows);
    let pressures = (0..rows * cols).map(|n| image.at(cols - 1 - n % cols, n / cols)).collect();
    TactileImage { rows, cols, pressures }
}

/// An image with left and right exchanged.
pub(crate) fn mirrored(image: &TactileImage) -> TactileImage {
    let cols = image.cols;
    let from = |n: usize| image.at(n / cols, cols - 1 - n % cols);
    TactileImage { pressures: (0..image.pressures.len()).map(from).collect(), ..*image }
}

/// The only feature of an image.
pub(crate) fn feature(kind: DescriptorKind, image: &TactileImage) -> Vec<f64> {
    let described = kind.describe(image);
    assert_eq!(described.n_rows(), 1, "{kind:?}");
    described.row(0).to_vec()
}

/// The affinity of a smooth image's feature to that of the image turned by `angle` (rad).
pub(crate) fn turned_affinity(kind: DescriptorKind, angle: f64) -> f64 {
    affinity(&feature(kind, &blob(26, 0.0, 0.0, 0.0)), &feature(kind, &blob(26, angle, 0.0, 0.0)))
}

/// Checks the laws of a descriptor: features of the promised number and length, finite and of
/// norm 1 or zero; equal in a batch and alone, and at any intensity.
#[track_caller]
pub(crate) fn check_descriptor(image: &TactileImage) {
    let mut stronger = image.clone();
    stronger.pressures.iter_mut().for_each(|pressure| *pressure *= 7.0);
    let other = mirrored(image);
    for kind in DescriptorKind::ALL {
        let plan = kind.plan(image.rows, image.cols);
        let batch = plan.describe(&[&other, image, &stronger]);
        let per_image = plan.features_per_image();
        assert_eq!(batch.n_rows(), 3 * per_image, "{kind:?}");
        assert_eq!(batch.dimension(), plan.dimension(), "{kind:?}");
        assert!(per_image == 1 || !kind.gives_one_feature(), "{kind:?}");
        let alone = kind.describe(image);
        for feature in 0..per_image {
            let (a, b) = (batch.row(per_image + feature), batch.row(2 * per_image + feature));
            assert_eq!(batch.owners()[per_image + feature], 1);
            assert!(a.iter().all(|value| value.is_finite()), "{kind:?}");
            assert_eq!(a, alone.row(feature), "{kind:?} depends on the batch");
            let square = a.iter().map(|value| value * value).sum::<f64>();
            assert!((square - 1.0).abs() < 1e-9 || square < 1e-20, "{kind:?}: {square}");
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{kind:?} and intensity");
        }
    }
}

/// Checks that an image and its quarter turns have the same feature, up to `tolerance` in the
/// affinity.
#[track_caller]
pub(crate) fn check_quarter_turn(kind: DescriptorKind, image: &TactileImage, tolerance: f64) {
    let straight = feature(kind, image);
    let mut turned = image.clone();
    for quarter in 1..4 {
        turned = quarter_turned(&turned);
        let kept = affinity(&straight, &feature(kind, &turned));
        assert!(kept > 1.0 - tolerance, "{kind:?} keeps {kept} after {quarter} quarters");
    }
}
