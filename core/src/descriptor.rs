//! Descriptors: what a tactile image looks like, as a vector of unit length.
//!
//! Source: section 4.3.2. Intensity invariance of all of them is L2 normalisation.
//! Not here: classes of appearance (`vocabulary`).

pub mod mnti;
pub mod moment_normalized;
pub mod vectorize;

use crate::reading::TactileImage;

/// The descriptors that exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptorKind {
    /// The image itself, columns concatenated (section 4.3.2.1): the negative control.
    Vectorize,
    /// Moment-normalised, translation-invariant (section 4.3.2.5.2).
    Mnti,
}

impl DescriptorKind {
    /// Describes an image by a vector of norm 1, or of zeros when nothing was touched.
    ///
    /// Equal image shapes give equal lengths: rows × cols for Vectorize, about half of that
    /// for MNTI.
    #[must_use]
    pub fn describe(self, image: &TactileImage) -> Vec<f64> {
        let mut feature = match self {
            Self::Vectorize => vectorize::vectorize(image),
            Self::Mnti => mnti::mnti(image),
        };
        normalize(&mut feature);
        feature
    }
}

/// Scales a vector to norm 1; a vector of (nearly) nothing becomes zeros.
pub fn normalize(vector: &mut [f64]) {
    let norm = vector.iter().map(|value| value * value).sum::<f64>().sqrt();
    let scale = if norm > 1e-12 { norm.recip() } else { 0.0 };
    vector.iter_mut().for_each(|value| *value *= scale);
}

/// The inner product of two features: their affinity, clamped to −1 ..= 1 (section 5.3.2).
#[must_use]
pub fn affinity(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>().clamp(-1.0, 1.0)
}

#[cfg(test)]
pub(crate) mod test_images {
    //! Analytic tactile images for tests of invariance.

    use crate::reading::TactileImage;

    /// An off-centre elongated blob with a tail, turned by `angle` (rad) and moved by
    /// `(dx, dy)` taxels, on a `side` × `side` array.
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
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::test_images::blob;
    use super::*;

    /// What every descriptor owes: unit norm, finite, indifferent to intensity.
    #[track_caller]
    fn check_descriptor(kind: DescriptorKind, angle: f64, gain: f64) {
        let image = blob(6, angle, 0.0, 0.0);
        let mut stronger = image.clone();
        stronger.pressures.iter_mut().for_each(|pressure| *pressure *= gain);
        let (a, b) = (kind.describe(&image), kind.describe(&stronger));
        assert!(a.iter().all(|value| value.is_finite()));
        assert!((affinity(&a, &a) - 1.0).abs() < 1e-9, "{kind:?}");
        assert!(affinity(&a, &b) > 1.0 - 1e-9, "{kind:?} at gain {gain}");
    }

    proptest! {
        #[test]
        fn descriptors_have_unit_norm_and_ignore_intensity(angle in -3.0..3.0_f64, gain in 0.1..50.0_f64) {
            check_descriptor(DescriptorKind::Vectorize, angle, gain);
            check_descriptor(DescriptorKind::Mnti, angle, gain);
        }
    }

    #[test]
    fn nothing_touched_is_all_zeros() {
        let image = TactileImage { rows: 6, cols: 6, pressures: vec![0.0; 36] };
        for kind in [DescriptorKind::Vectorize, DescriptorKind::Mnti] {
            assert!(kind.describe(&image).iter().all(|value| value.abs() < 1e-15));
        }
    }
}
