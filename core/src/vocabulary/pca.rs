//! Principal components: features projected onto their directions of largest variance.
//!
//! Source: section 4.3.1.1.1; the kept share of the variance is settled in
//! `docs/equations.md`. Nothing is whitened. Not here: normalising projections
//! (`descriptor::normalize`), which inner products need.

use nalgebra::{DMatrix, SymmetricEigen};
use thiserror::Error;

use crate::descriptor::FeatureMatrix;

/// Fraction of the largest variance below which a component is a rounding error.
const VARIANCE_MIN: f64 = 1e-12;

/// Number of components to keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Keep {
    /// The fewest that together hold this share of the variance, above 0 and up to 1.
    Share(f64),
    /// This number, or all if there are fewer.
    Number(usize),
}

impl Default for Keep {
    /// 99 % of the variance.
    fn default() -> Self {
        Self::Share(0.99)
    }
}

/// Error of features without principal components.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum PcaError {
    /// There are too few features.
    #[error("{found} features, expected at least 2")]
    TooFew {
        /// Number of features.
        found: usize,
    },
    /// All features are equal.
    #[error("all features are equal, expected some that differ")]
    Equal,
    /// A value is not finite.
    #[error("feature {row} has a value that is not finite")]
    NotFinite {
        /// The first row with such a value.
        row: usize,
    },
    /// The share is out of range.
    #[error("share of variance is {found}, expected above 0 and up to 1")]
    Share {
        /// The given share.
        found: f64,
    },
    /// No component would be kept.
    #[error("0 components, expected at least 1")]
    NoComponent,
}

/// An affine map to principal components and back.
#[derive(Clone, Debug, PartialEq)]
pub struct Pca {
    mean: Vec<f64>,
    /// Directions of norm 1, one after the other, by falling variance.
    components: Vec<f64>,
    variances: Vec<f64>,
    total_variance: f64,
}

impl Pca {
    /// Fits the components of the rows of a matrix.
    ///
    /// With fewer features than dimensions the eigenvectors are those of the features' inner
    /// products, which span the same directions. A component's largest entry is positive.
    ///
    /// # Errors
    /// [`PcaError`] for fewer than two features, features that are equal or not finite, and for a share
    /// or a number that would keep nothing.
    pub fn fit(features: &FeatureMatrix, keep: Keep) -> Result<Self, PcaError> {
        check(features, keep)?;
        let (n, dimension) = (features.n_rows(), features.dimension());
        let mean = features.mean();
        let centered =
            DMatrix::from_fn(n, dimension, |row, col| features.row(row)[col] - mean[col]);
        let scale = (n as f64 - 1.0).recip();
        let total_variance = centered.norm_squared() * scale;
        let wide = n < dimension;
        let products =
            if wide { &centered * centered.transpose() } else { centered.tr_mul(&centered) };
        let eigen = SymmetricEigen::new(products * scale);
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let largest = eigen.eigenvalues[order[0]];
        if largest <= VARIANCE_MIN * mean.iter().map(|value| value * value).sum::<f64>() {
            return Err(PcaError::Equal);
        }
        order.retain(|index| eigen.eigenvalues[*index] > VARIANCE_MIN * largest);
        let spectrum: Vec<f64> = order.iter().map(|index| eigen.eigenvalues[*index]).collect();
        order.truncate(n_kept(&spectrum, total_variance, keep));
        let mut components = Vec::with_capacity(order.len() * dimension);
        for index in &order {
            let vector = eigen.eigenvectors.column(*index);
            let mut direction = if wide { centered.tr_mul(&vector) } else { vector.clone_owned() };
            direction.normalize_mut();
            components.extend_from_slice(with_sign(direction.as_mut_slice()));
        }
        Ok(Self { mean, components, variances: spectrum[..order.len()].to_vec(), total_variance })
    }

    /// Restores a fit from its mean, its components one after the other, their variances in
    /// falling order, and the total variance. `None` when these are inconsistent.
    #[must_use]
    pub fn from_parts(
        mean: Vec<f64>,
        components: Vec<f64>,
        variances: Vec<f64>,
        total_variance: f64,
    ) -> Option<Self> {
        let fits = !mean.is_empty()
            && !variances.is_empty()
            && components.len() == mean.len() * variances.len()
            && mean.iter().chain(&components).all(|value| value.is_finite())
            && variances.is_sorted_by(|a, b| a >= b)
            && variances.iter().chain([&total_variance]).all(|v| v.is_finite() && *v > 0.0);
        fits.then_some(Self { mean, components, variances, total_variance })
    }

    /// Length of a feature.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.mean.len()
    }

    /// Number of components.
    #[must_use]
    pub fn n_components(&self) -> usize {
        self.variances.len()
    }

    /// The mean feature.
    #[must_use]
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The components one after the other, each of norm 1.
    #[must_use]
    pub fn components(&self) -> &[f64] {
        &self.components
    }

    /// The variance along each component, falling.
    #[must_use]
    pub fn variances(&self) -> &[f64] {
        &self.variances
    }

    /// The total variance of the features.
    #[must_use]
    pub fn total_variance(&self) -> f64 {
        self.total_variance
    }

    /// The share of the variance in the components, up to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        (self.variances.iter().sum::<f64>() / self.total_variance).min(1.0)
    }

    /// The coordinates of features along the components, with the same owners.
    ///
    /// # Panics
    /// When the features have another dimension.
    #[must_use]
    pub fn project(&self, features: &FeatureMatrix) -> FeatureMatrix {
        let mut values = Vec::with_capacity(features.n_rows() * self.n_components());
        for row in features.rows() {
            self.project_into(row, &mut values);
        }
        FeatureMatrix::from_parts(self.n_components(), values, features.owners().to_vec())
    }

    /// The coordinates of one feature along the components.
    ///
    /// # Panics
    /// When the feature has another dimension.
    #[must_use]
    pub fn project_one(&self, feature: &[f64]) -> Vec<f64> {
        let mut values = Vec::with_capacity(self.n_components());
        self.project_into(feature, &mut values);
        values
    }

    /// The feature at coordinates along the components, the nearest to the projected one.
    ///
    /// # Panics
    /// When there is not one coordinate for each component.
    #[must_use]
    pub fn back_project(&self, coordinates: &[f64]) -> Vec<f64> {
        assert_eq!(coordinates.len(), self.n_components(), "each component has a coordinate");
        let mut feature = self.mean.clone();
        let components = self.components.chunks_exact(self.dimension());
        for (coordinate, component) in coordinates.iter().zip(components) {
            feature.iter_mut().zip(component).for_each(|(sum, along)| *sum += coordinate * along);
        }
        feature
    }

    fn project_into(&self, feature: &[f64], coordinates: &mut Vec<f64>) {
        assert_eq!(feature.len(), self.dimension(), "a feature is of the fitted dimension");
        coordinates.extend(self.components.chunks_exact(self.dimension()).map(|component| {
            let parts = feature.iter().zip(&self.mean).zip(component);
            parts.map(|((value, mean), along)| (value - mean) * along).sum::<f64>()
        }));
    }
}

fn check(features: &FeatureMatrix, keep: Keep) -> Result<(), PcaError> {
    match keep {
        Keep::Share(found) if !(found > 0.0 && found <= 1.0) => {
            return Err(PcaError::Share { found });
        }
        Keep::Number(0) => return Err(PcaError::NoComponent),
        Keep::Share(_) | Keep::Number(_) => {}
    }
    if features.n_rows() < 2 {
        return Err(PcaError::TooFew { found: features.n_rows() });
    }
    let finite = |row: &[f64]| row.iter().all(|value| value.is_finite());
    match features.rows().position(|row| !finite(row)) {
        Some(row) => Err(PcaError::NotFinite { row }),
        None => Ok(()),
    }
}

/// Number of the falling variances to keep, at least one.
fn n_kept(variances: &[f64], total: f64, keep: Keep) -> usize {
    match keep {
        Keep::Number(n) => n.min(variances.len()),
        Keep::Share(share) => {
            let mut sum = 0.0;
            // A share of 1 is reached but for rounding.
            let enough = share * total * (1.0 - 1e-12);
            let reached = variances.iter().position(|variance| {
                sum += variance;
                sum >= enough
            });
            reached.map_or(variances.len(), |last| last + 1)
        }
    }
}

/// The direction or its opposite, whichever has a positive largest entry (the first of equal
/// ones).
fn with_sign(direction: &mut [f64]) -> &[f64] {
    let largest = direction.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let first = direction.iter().find(|value| value.abs() > largest * (1.0 - 1e-9));
    if first.is_some_and(|value| *value < 0.0) {
        direction.iter_mut().for_each(|value| *value = -*value);
    }
    direction
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::rng::{Purpose, Stream};

    fn matrix(rows: &[&[f64]]) -> FeatureMatrix {
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
        FeatureMatrix::from_rows(&rows).unwrap()
    }

    #[track_caller]
    fn close(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near, "{found:?}, expected {expected:?}");
    }

    /// Mean (1, 2); along (3, 4)/5 the offsets are ±10, along (4, −3)/5 they are ±5.
    fn cross() -> FeatureMatrix {
        matrix(&[&[7.0, 10.0], &[-5.0, -6.0], &[5.0, -1.0], &[-3.0, 5.0]])
    }

    #[test]
    fn a_cross_has_its_arms_as_components() {
        let pca = Pca::fit(&cross(), Keep::Share(1.0)).unwrap();
        close(pca.mean(), &[1.0, 2.0]);
        close(pca.components(), &[0.6, 0.8, 0.8, -0.6]);
        close(pca.variances(), &[200.0 / 3.0, 50.0 / 3.0]); // Σ offset² / (4 − 1)
        close(pca.project(&cross()).values(), &[10.0, 0.0, -10.0, 0.0, 0.0, 5.0, 0.0, -5.0]);
        close(&pca.back_project(&[10.0, 5.0]), &[11.0, 7.0]); // (1, 2) + (6, 8) + (4, −3)
    }

    #[test]
    fn the_share_sets_the_number_of_components() {
        // The long arm holds 200 of 250.
        let n = |keep| Pca::fit(&cross(), keep).unwrap().n_components();
        assert_eq!([n(Keep::Share(0.79)), n(Keep::Share(0.81))], [1, 2]);
        assert_eq!([n(Keep::Number(1)), n(Keep::Number(9))], [1, 2]);
        let share = Pca::fit(&cross(), Keep::Number(1)).unwrap().share();
        assert!((share - 0.8).abs() < 1e-12);
    }

    #[test]
    fn few_features_have_at_most_one_component_less() {
        // Two features: the only direction is from one to the other, (2, 0, −1, 2)/3.
        let two = matrix(&[&[3.0, 1.0, 0.0, 5.0], &[1.0, 1.0, 1.0, 3.0]]);
        let pca = Pca::fit(&two, Keep::Share(1.0)).unwrap();
        close(pca.components(), &[2.0 / 3.0, 0.0, -1.0 / 3.0, 2.0 / 3.0]);
        close(pca.variances(), &[4.5]); // 2 · 1.5² / (2 − 1)
        close(&pca.back_project(&pca.project_one(two.row(0))), two.row(0));
    }

    #[test]
    fn features_without_components_are_refused() {
        let fit = |rows: &[&[f64]], keep| Pca::fit(&matrix(rows), keep).unwrap_err();
        assert_eq!(fit(&[&[1.0]], Keep::default()), PcaError::TooFew { found: 1 });
        assert_eq!(fit(&[[0.1, 0.2].as_slice(); 5], Keep::default()), PcaError::Equal);
        assert_eq!(fit(&[[0.0].as_slice(); 5], Keep::default()), PcaError::Equal);
        let odd: [&[f64]; 2] = [&[1.0], &[f64::NAN]];
        assert_eq!(fit(&odd, Keep::default()), PcaError::NotFinite { row: 1 });
        assert_eq!(fit(&odd, Keep::Number(0)), PcaError::NoComponent);
        assert_eq!(fit(&odd, Keep::Share(1.5)), PcaError::Share { found: 1.5 });
    }

    #[test]
    fn stored_parts_restore_the_fit_and_broken_ones_are_refused() {
        let pca = Pca::fit(&cross(), Keep::default()).unwrap();
        let parts = |variances: Vec<f64>| {
            let (mean, components) = (pca.mean().to_vec(), pca.components().to_vec());
            Pca::from_parts(mean, components, variances, pca.total_variance())
        };
        assert_eq!(parts(pca.variances().to_vec()), Some(pca.clone()));
        assert_eq!(parts(vec![1.0]), None);
        assert_eq!(parts(vec![1.0, 2.0]), None);
        assert_eq!(parts(vec![1.0, -2.0]), None);
    }

    fn random(n: usize, dimension: usize, seed: u64) -> FeatureMatrix {
        let mut stream = Stream::new(seed, Purpose::Shape, 0);
        let mut row = || (0..dimension).map(|col| stream.normal() * (col + 1) as f64).collect();
        let rows: Vec<Vec<f64>> = (0..n).map(|_| row()).collect();
        FeatureMatrix::from_rows(&rows).unwrap()
    }

    proptest! {
        #[test]
        fn components_are_orthonormal_and_projections_uncorrelated(
            n in 3..30_usize, dimension in 2..12_usize, seed in 0..1000_u64,
        ) {
            // Covers both ways to the components: fewer and more features than dimensions.
            let features = random(n, dimension, seed);
            let pca = Pca::fit(&features, Keep::Share(1.0)).unwrap();
            let k = pca.n_components();
            prop_assert_eq!(k, dimension.min(n - 1));
            let projected = pca.project(&features);
            for (a, b) in (0..k).flat_map(|a| (0..k).map(move |b| (a, b))) {
                let direction = |i: usize| &pca.components()[i * dimension..(i + 1) * dimension];
                let inner: f64 = direction(a).iter().zip(direction(b)).map(|(x, y)| x * y).sum();
                let unit = f64::from(u8::from(a == b));
                prop_assert!((inner - unit).abs() < 1e-8);
                let covariance =
                    projected.rows().map(|row| row[a] * row[b]).sum::<f64>() / (n as f64 - 1.0);
                prop_assert!((covariance - unit * pca.variances()[a]).abs() < 1e-8 * pca.total_variance());
            }
            for (row, coordinates) in features.rows().zip(projected.rows()) {
                let back = pca.back_project(coordinates);
                prop_assert!(row.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-8));
            }
        }

        #[test]
        fn signs_do_not_depend_on_the_order_of_features(seed in 0..1000_u64) {
            let features = random(20, 5, seed);
            let mut rows: Vec<Vec<f64>> = features.rows().map(<[f64]>::to_vec).collect();
            rows.reverse();
            let reversed = FeatureMatrix::from_rows(&rows).unwrap();
            let fit = |features| Pca::fit(features, Keep::Share(1.0)).unwrap();
            let (a, b) = (fit(&features), fit(&reversed));
            prop_assert!(a.components().iter().zip(b.components()).all(|(a, b)| (a - b).abs() < 1e-6));
        }
    }
}
