//! The two steps of expectation and maximisation, in parallel and in a fixed order.
//!
//! Features are the columns of a matrix. The E step works on blocks of columns, the M step
//! on components; every sum has one order, whatever the number of threads.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use super::{Component, Mixture};

/// Number of features of one block.
const BLOCK: usize = 512;

/// Share below which a component ignores a feature.
const MIN_SHARE: f64 = 1e-12;

/// A block of features as columns.
pub(super) type Blocks = Vec<DMatrix<f64>>;

/// Membership of the features in the components, and their densities.
pub(super) struct Expectation {
    /// Shares: one matrix a block, features × components.
    pub(super) shares: Vec<DMatrix<f64>>,
    /// ln density of every feature.
    pub(super) log_densities: Vec<f64>,
}

impl Expectation {
    /// The mean of ln density over the features.
    pub(super) fn mean_log_density(&self) -> f64 {
        self.log_densities.iter().sum::<f64>() / self.log_densities.len() as f64
    }
}

/// Features as blocks of columns.
pub(super) fn blocks(features: &[Vec<f64>]) -> Blocks {
    let dimension = features[0].len();
    let block = |part: &[Vec<f64>]| {
        DMatrix::from_iterator(dimension, part.len(), part.iter().flatten().copied())
    };
    features.chunks(BLOCK).map(block).collect()
}

/// The E step: responsibilities by log-sum-exp.
pub(super) fn expect(mixture: &Mixture, blocks: &Blocks) -> Expectation {
    let parts: Vec<(DMatrix<f64>, Vec<f64>)> =
        blocks.par_iter().map(|block| expect_block(mixture, block)).collect();
    let (shares, densities): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    Expectation { shares, log_densities: densities.concat() }
}

fn expect_block(mixture: &Mixture, block: &DMatrix<f64>) -> (DMatrix<f64>, Vec<f64>) {
    let (dimension, n) = block.shape();
    let mut logs = DMatrix::zeros(n, mixture.whitened.len());
    let mut whitened = DMatrix::zeros(dimension, n);
    for (component, part) in mixture.whitened.iter().enumerate() {
        whitened.gemm(1.0, &part.whitening, block, 0.0);
        let mut column = logs.column_mut(component);
        for (log, feature) in column.iter_mut().zip(whitened.as_slice().chunks(dimension)) {
            let offsets = feature.iter().zip(&part.whitened_mean);
            let squared: f64 = offsets.map(|(value, mean)| (value - mean).powi(2)).sum();
            *log = part.log_scale - 0.5 * squared;
        }
    }
    let densities = normalize_rows(&mut logs);
    (logs, densities)
}

/// Turns each row of logs into shares that sum to 1; returns ln of the rows' totals. Runs
/// over columns, in the order of memory.
fn normalize_rows(logs: &mut DMatrix<f64>) -> Vec<f64> {
    let n = logs.nrows();
    let mut max = vec![f64::NEG_INFINITY; n];
    for column in logs.column_iter() {
        max.iter_mut().zip(column.iter()).for_each(|(max, log)| *max = max.max(*log));
    }
    let mut total = vec![0.0; n];
    for mut column in logs.column_iter_mut() {
        for ((log, max), total) in column.iter_mut().zip(&max).zip(&mut total) {
            // exp of less than −60 is below 1e-26: skipping it saves half of the time.
            let offset = *log - max;
            *log = if offset < -60.0 { 0.0 } else { offset.exp() };
            *total += *log;
        }
    }
    for mut column in logs.column_iter_mut() {
        column.iter_mut().zip(&total).for_each(|(share, total)| *share /= total);
    }
    max.iter().zip(&total).map(|(max, total)| max + total.ln()).collect()
}

/// The M step: each component from its features; `None` for one that lost them.
///
/// A covariance's eigenvalues are raised to `floor`, which maximises the likelihood among
/// covariances with no smaller ones: the likelihood still never falls.
pub(super) fn maximize(
    blocks: &Blocks,
    shares: &[DMatrix<f64>],
    floor: f64,
) -> Vec<Option<Component>> {
    let n: usize = blocks.iter().map(DMatrix::ncols).sum();
    (0..shares[0].ncols())
        .into_par_iter()
        .map(|component| maximize_one(blocks, shares, component, n, floor))
        .collect()
}

fn maximize_one(
    blocks: &Blocks,
    shares: &[DMatrix<f64>],
    component: usize,
    n: usize,
    floor: f64,
) -> Option<Component> {
    let dimension = blocks[0].nrows();
    let members = || {
        blocks.iter().zip(shares).flat_map(move |(block, shares)| {
            let shares = shares.column(component);
            (0..block.ncols())
                .map(move |index| (block.column(index), shares[index]))
                .filter(|(_, share)| *share > MIN_SHARE)
        })
    };
    let (mut mass, mut mean, mut n_members) = (0.0, DVector::zeros(dimension), 0);
    for (feature, share) in members() {
        mass += share;
        mean.axpy(share, &feature, 1.0);
        n_members += 1;
    }
    if mass < 1.0 {
        return None;
    }
    mean /= mass;
    let mut offsets = DMatrix::zeros(dimension, n_members);
    for (mut offset, (feature, share)) in offsets.column_iter_mut().zip(members()) {
        let root = (share / mass).sqrt();
        for ((value, feature), mean) in offset.iter_mut().zip(feature.iter()).zip(mean.iter()) {
            *value = root * (feature - mean);
        }
    }
    let mut covariance = DMatrix::zeros(dimension, dimension);
    covariance.gemm(1.0, &offsets, &offsets.transpose(), 0.0);
    let covariance = raise_eigenvalues(covariance, floor);
    Some(Component {
        weight: mass / n as f64,
        mean: mean.as_slice().to_vec(),
        covariance: covariance.as_slice().to_vec(),
    })
}

/// The nearest symmetric matrix with eigenvalues of at least `floor`.
pub(super) fn raise_eigenvalues(covariance: DMatrix<f64>, floor: f64) -> DMatrix<f64> {
    let symmetric = 0.5 * (&covariance + covariance.transpose());
    let lowered = &symmetric - DMatrix::identity(symmetric.nrows(), symmetric.ncols()) * floor;
    if lowered.cholesky().is_some() {
        return symmetric; // all eigenvalues are above the floor
    }
    let mut eigen = SymmetricEigen::new(symmetric);
    eigen.eigenvalues.iter_mut().for_each(|value| *value = value.max(floor));
    let raised = eigen.recompose();
    0.5 * (&raised + raised.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raised_eigenvalues_keep_their_axes() {
        // (1 1; 1 1) has eigenvalues 2 along (1, 1) and 0 along (1, −1); 0 becomes 0.5.
        let raised = raise_eigenvalues(DMatrix::from_element(2, 2, 1.0), 0.5);
        let expected = DMatrix::from_row_slice(2, 2, &[1.25, 0.75, 0.75, 1.25]);
        assert!((raised - expected).norm() < 1e-12);
    }

    #[test]
    fn blocks_and_single_features_agree() {
        let part = |weight, mean: [f64; 2], covariance: [f64; 4]| Component {
            weight,
            mean: mean.to_vec(),
            covariance: covariance.to_vec(),
        };
        let mixture = Mixture::new(vec![
            part(0.3, [0.0, 1.0], [2.0, 0.3, 0.3, 0.5]),
            part(0.7, [1.0, -1.0], [1.0, 0.0, 0.0, 3.0]),
        ])
        .unwrap();
        let features: Vec<Vec<f64>> =
            (0..1_100).map(|n| vec![f64::from(n) / 300.0 - 2.0, f64::from(n % 7) - 3.0]).collect();
        let found = expect(&mixture, &blocks(&features));
        for (index, feature) in features.iter().enumerate() {
            let shares = mixture.responsibilities(feature);
            let row = found.shares[index / BLOCK].row(index % BLOCK);
            assert!((row[0] - shares[0]).abs() < 1e-12 && (row[1] - shares[1]).abs() < 1e-12);
            let density = mixture.log_density(feature);
            assert!((found.log_densities[index] - density).abs() < 1e-10);
        }
    }

    #[test]
    fn components_have_mean_and_covariance_of_their_features() {
        // Four features with share 1: mean (1, 0), variance 1 along x, 4 along y.
        let features = vec![vec![0.0, 2.0], vec![2.0, 2.0], vec![0.0, -2.0], vec![2.0, -2.0]];
        let parts = maximize(&blocks(&features), &[DMatrix::from_element(4, 1, 1.0)], 1e-6);
        let part = parts[0].as_ref().unwrap();
        assert!((part.weight - 1.0).abs() < 1e-12);
        assert_eq!(part.mean, [1.0, 0.0]);
        assert_eq!(part.covariance, [1.0, 0.0, 0.0, 4.0]);
    }
}
