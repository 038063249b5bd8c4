//! Bilinear sampling of an image between its taxels, planned once for a shape.

/// Up to four taxels and their weights; outside the image the pressure is 0 Pa.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sample {
    taxels: [u32; 4],
    weights: [f64; 4],
}

impl Sample {
    /// Plans a sample at a fractional row and column of an image `cols` wide. Only the taxels
    /// (row, col) that satisfy `inside` exist.
    pub(super) fn bilinear(
        row: f64,
        col: f64,
        cols: usize,
        inside: impl Fn(i64, i64) -> bool,
    ) -> Self {
        let (r0, c0) = (row.floor(), col.floor());
        let (fr, fc) = (row - r0, col - c0);
        let corners = [
            (0, 0, (1.0 - fr) * (1.0 - fc)),
            (0, 1, (1.0 - fr) * fc),
            (1, 0, fr * (1.0 - fc)),
            (1, 1, fr * fc),
        ];
        let mut sample = Self::default();
        for (corner, (down, right, weight)) in corners.into_iter().enumerate() {
            let (r, c) = (r0 as i64 + down, c0 as i64 + right);
            if inside(r, c) {
                sample.taxels[corner] = (r * cols as i64 + c) as u32;
                sample.weights[corner] = weight;
            }
        }
        sample
    }

    /// The interpolated value.
    pub(super) fn of(&self, pressures: &[f64]) -> f64 {
        let part = |corner: usize| self.weights[corner] * pressures[self.taxels[corner] as usize];
        (part(0) + part(1)) + (part(2) + part(3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_interpolate_taxels_and_vanish_outside() {
        let image = [1.0, 2.0, 3.0, 4.0]; // 2 × 2
        let at = |row, col| {
            Sample::bilinear(row, col, 2, |r, c| (0..2).contains(&r) && (0..2).contains(&c))
                .of(&image)
        };
        assert!((at(0.0, 0.25) - 1.25).abs() < 1e-12);
        assert!((at(0.5, 0.5) - 2.5).abs() < 1e-12);
        assert!((at(-0.5, 0.0) - 0.5).abs() < 1e-12); // half of 1, half of nothing
        assert!(at(3.0, 3.0).abs() < 1e-12);
    }
}
