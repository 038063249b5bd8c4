//! Classes made of objects: one Gaussian for each training object, one covariance for all.
//!
//! Beyond the dissertation, whose classes do not know the object of a touch. The shares of a
//! feature are then the posterior of linear discriminant analysis (Fisher, 1936), and a
//! histogram gives the objects that an object's touches are classified as. For few readings
//! of an array that sees whole objects. Not here: the axes (`discriminant`).

use nalgebra::DMatrix;

use super::gmm::{Component, Mixture, MixtureError};

/// Shrinkage of the covariance towards a multiple of the identity, which keeps directions
/// without variance from deciding.
const SHRINKAGE: f64 = 1e-3;

/// One component for each object with features, at their mean; all objects have equal weight.
///
/// # Errors
/// [`MixtureError`] when there is no feature, or features do not vary within objects.
pub fn labelled_mixture(objects: &[Vec<Vec<f64>>]) -> Result<Mixture, MixtureError> {
    let objects: Vec<&Vec<Vec<f64>>> = objects.iter().filter(|set| !set.is_empty()).collect();
    let dimension = objects.first().map_or(0, |set| set[0].len());
    let means: Vec<Vec<f64>> = objects.iter().map(|set| mean(set)).collect();
    let share = (objects.len() as f64).recip();
    let mut within = DMatrix::zeros(dimension, dimension);
    for (set, mean) in objects.iter().zip(&means) {
        for feature in *set {
            let offset = DMatrix::from_fn(dimension, 1, |row, _| feature[row] - mean[row]);
            within.ger(share / set.len() as f64, &offset.column(0), &offset.column(0), 1.0);
        }
    }
    let variance = within.trace() / dimension.max(1) as f64;
    within *= 1.0 - SHRINKAGE;
    within += DMatrix::identity(dimension, dimension) * (SHRINKAGE * variance);
    let covariance = within.as_slice().to_vec();
    let component = |mean| Component { weight: share, mean, covariance: covariance.clone() };
    Mixture::new(means.into_iter().map(component).collect())
}

fn mean(features: &[Vec<f64>]) -> Vec<f64> {
    let mut mean = vec![0.0; features[0].len()];
    for feature in features {
        mean.iter_mut().zip(feature).for_each(|(sum, value)| *sum += value);
    }
    mean.iter_mut().for_each(|sum| *sum /= features.len() as f64);
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_have_the_objects_means_and_pooled_scatter() {
        // Offsets ±1 along x in both objects, ±2 along y in the second: variances 1 and 2.
        let square = |x: f64, y: f64| vec![vec![x - 1.0, y], vec![x + 1.0, y]];
        let second = vec![vec![9.0, 3.0], vec![11.0, 3.0], vec![9.0, 7.0], vec![11.0, 7.0]];
        let mixture = labelled_mixture(&[square(0.0, 0.0), second]).unwrap();
        let [first, second] = mixture.components() else { panic!("one component an object") };
        assert_eq!((first.weight, second.weight), (0.5, 0.5));
        assert_eq!((&first.mean[..], &second.mean[..]), (&[0.0, 0.0][..], &[10.0, 5.0][..]));
        let expected = [1.0, 0.0, 0.0, 2.0];
        for (found, expected) in first.covariance.iter().zip(expected) {
            // A thousandth of the mean variance, 1.5, is mixed in.
            assert!((found - expected).abs() < 1e-3, "{found} and {expected}");
        }
        assert_eq!(first.covariance, second.covariance);
        // Half way along x at equal distances along y: the covariance gives equal shares.
        let shares = mixture.responsibilities(&[5.0, 2.5]);
        assert!((shares[0] - 0.5).abs() < 1e-9);
    }

    #[test]
    fn no_features_or_no_scatter_are_refused() {
        assert_eq!(labelled_mixture(&[]), Err(MixtureError::Empty));
        let still = vec![vec![vec![1.0, 2.0]; 3]; 2];
        assert_eq!(labelled_mixture(&still), Err(MixtureError::Covariance { component: 0 }));
    }
}
