//! Vectorize: the image's columns concatenated, the "do-nothing" descriptor.
//!
//! Source: section 4.3.2.1. It is invariant to neither rotation nor translation: the negative
//! control.

use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// Vectorize for images of one shape.
#[derive(Clone, Copy, Debug)]
pub struct Vectorize {
    rows: usize,
    cols: usize,
}

impl Vectorize {
    /// Plans for images of `rows` × `cols` taxels.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        Self { rows, cols }
    }
}

impl Descriptor for Vectorize {
    fn shape(&self) -> (usize, usize) {
        (self.rows, self.cols)
    }

    fn dimension(&self) -> usize {
        self.rows * self.cols
    }

    fn write(&self, image: &TactileImage, _: &mut Workspace, features: &mut [f64]) {
        by_columns(&image.pressures, self.cols, features);
    }
}

/// A row-major image `cols` wide, written column by column.
pub(super) fn by_columns(image: &[f64], cols: usize, columns: &mut [f64]) {
    let rows = image.len() / cols;
    for (row, line) in image.chunks_exact(cols).enumerate() {
        for (col, value) in line.iter().enumerate() {
            columns[col * rows + row] = *value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::DescriptorKind;
    use crate::descriptor::test_support::{blob, feature, turned_affinity};

    #[test]
    fn columns_are_concatenated() {
        let image = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]; // 2 × 3
        let mut columns = [0.0; 6];
        by_columns(&image, 3, &mut columns);
        assert_eq!(columns.as_slice(), [0.0, 3.0, 1.0, 4.0, 2.0, 5.0].as_slice());
    }

    #[test]
    fn a_quarter_turn_changes_the_feature() {
        // The control of all rotation properties: this one must not hold.
        let kept = turned_affinity(DescriptorKind::Vectorize, std::f64::consts::FRAC_PI_2);
        assert!(kept < 0.8, "{kept}");
        let image = blob(6, 0.0, 0.0, 0.0);
        assert_eq!(feature(DescriptorKind::Vectorize, &image).len(), 36);
    }
}
