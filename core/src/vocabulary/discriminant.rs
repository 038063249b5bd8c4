//! Linear discriminants: axes along which objects differ more than touches of one object.
//!
//! Source: Fisher (1936), Rao (1948); the dissertation names it as a more aggressive
//! reduction than PCA (footnote 2 of section 4.3.1) and does not use it: it is beyond print.
//! In the reduced space touches of one object have (nearly) unit covariance.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

/// Axes onto which features are projected: y = axes · (x − mean).
#[derive(Clone, Debug, PartialEq)]
pub struct Discriminant {
    /// The mean of the objects' means.
    pub mean: Vec<f64>,
    /// One axis a row, the most discriminating first.
    pub axes: Vec<Vec<f64>>,
}

impl Discriminant {
    /// Projects a feature onto the axes.
    #[must_use]
    pub fn project(&self, feature: &[f64]) -> Vec<f64> {
        let along = |axis: &Vec<f64>| {
            let terms = axis.iter().zip(feature).zip(&self.mean);
            terms.map(|((axis, value), mean)| axis * (value - mean)).sum()
        };
        self.axes.iter().map(along).collect()
    }
}

/// The axes that separate objects; every object has equal weight, whatever its number of
/// features. At most `n_axes`, and fewer than there are objects.
///
/// `shrinkage` (0 to 1) moves the covariance within objects towards a multiple of the
/// identity, which is needed for few features. `None` when no axis separates objects: fewer
/// than two objects with features, or features that do not vary.
#[must_use]
pub fn find_discriminants(
    objects: &[Vec<Vec<f64>>],
    n_axes: usize,
    shrinkage: f64,
) -> Option<Discriminant> {
    let objects: Vec<&Vec<Vec<f64>>> = objects.iter().filter(|set| !set.is_empty()).collect();
    let n_objects = objects.len();
    let dimension = objects.first()?.first()?.len();
    let means: Vec<DVector<f64>> = objects.iter().map(|set| mean(set, dimension)).collect();
    let center = means.iter().sum::<DVector<f64>>() / n_objects as f64;
    let mut within = DMatrix::zeros(dimension, dimension);
    let mut between = DMatrix::zeros(dimension, dimension);
    for (set, mean) in objects.iter().zip(&means) {
        for feature in *set {
            let offset = DVector::from_column_slice(feature) - mean;
            within.ger(1.0 / (set.len() * n_objects) as f64, &offset, &offset, 1.0);
        }
        let offset = mean - &center;
        between.ger(1.0 / n_objects as f64, &offset, &offset, 1.0);
    }
    let variance = within.trace() / dimension as f64;
    // A small amount keeps directions without any variance from deciding.
    let share = shrinkage.clamp(1e-6, 1.0);
    within *= 1.0 - share;
    within += DMatrix::identity(dimension, dimension) * (share * variance);
    let factor = Cholesky::new(within)?.unpack();
    let whitening = factor.solve_lower_triangular(&DMatrix::identity(dimension, dimension))?;
    let eigen = SymmetricEigen::new(&whitening * between * whitening.transpose());
    let mut order: Vec<usize> = (0..dimension).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]).then(a.cmp(b)));
    let axes: Vec<Vec<f64>> = order
        .into_iter()
        .take(n_axes.min(n_objects - 1))
        .filter(|column| eigen.eigenvalues[*column] > 1e-9)
        .map(|column| {
            (whitening.transpose() * eigen.eigenvectors.column(column)).as_slice().to_vec()
        })
        .collect();
    (!axes.is_empty()).then(|| Discriminant { mean: center.as_slice().to_vec(), axes })
}

fn mean(features: &[Vec<f64>], dimension: usize) -> DVector<f64> {
    let mut sum = DVector::zeros(dimension);
    for feature in features {
        sum += DVector::from_column_slice(feature);
    }
    sum / features.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    /// Two objects 1 apart along x; noise of 0.1 along x and 5 along y.
    fn objects() -> Vec<Vec<Vec<f64>>> {
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        let mut touches = |center: f64| -> Vec<Vec<f64>> {
            (0..500).map(|_| vec![center + 0.1 * stream.normal(), 5.0 * stream.normal()]).collect()
        };
        vec![touches(0.0), touches(1.0)]
    }

    #[test]
    fn the_axis_separates_objects_not_scatter_within_them() {
        let found = find_discriminants(&objects(), 5, 0.0).unwrap();
        assert_eq!(found.axes.len(), 1); // two objects differ along one axis
        // Within an object the projection has deviation 1: objects are 10 apart.
        let apart = found.project(&[1.0, 0.0])[0] - found.project(&[0.0, 0.0])[0];
        assert!((apart.abs() - 10.0).abs() < 0.5, "{apart}");
        let aside = found.project(&[0.0, 5.0])[0] - found.project(&[0.0, 0.0])[0];
        assert!(aside.abs() < 1.0, "{aside}");
    }

    #[test]
    fn objects_that_do_not_differ_have_no_axes() {
        assert_eq!(find_discriminants(&objects()[..1], 5, 0.1), None);
        assert_eq!(find_discriminants(&vec![vec![vec![1.0, 2.0]; 5]; 3], 5, 0.1), None);
        assert_eq!(find_discriminants(&[], 5, 0.1), None);
    }
}
