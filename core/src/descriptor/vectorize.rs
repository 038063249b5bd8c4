//! Vectorize: the image's columns concatenated, the "do-nothing" descriptor.
//!
//! Source: section 4.3.2.1. Neither rotation nor translation is removed.

use crate::reading::TactileImage;

/// The columns of an image, one after the other: `rows` × `cols` numbers, not normalised.
#[must_use]
pub fn vectorize(image: &TactileImage) -> Vec<f64> {
    let columns = 0..image.cols;
    columns.flat_map(|col| (0..image.rows).map(move |row| image.at(row, col))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_follow_each_other() {
        let image = TactileImage { rows: 2, cols: 3, pressures: vec![0., 1., 2., 3., 4., 5.] };
        assert_eq!(vectorize(&image), [0.0, 3.0, 1.0, 4.0, 2.0, 5.0]);
    }
}
