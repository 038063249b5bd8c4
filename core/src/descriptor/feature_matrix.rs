//! Features of a batch of readings: one row each, with the index of its reading.
//!
//! Row-major. A reading may own several rows (MR-8); rows of one reading are adjacent.

/// Features of equal length, each with the index of the reading that owns it.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureMatrix {
    dimension: usize,
    values: Vec<f64>,
    owners: Vec<usize>,
}

impl FeatureMatrix {
    /// A matrix of `owners.len()` rows of `dimension` values each.
    ///
    /// # Panics
    /// When `dimension` is 0 or there are not `dimension` values for each owner.
    #[must_use]
    pub fn from_parts(dimension: usize, values: Vec<f64>, owners: Vec<usize>) -> Self {
        assert!(dimension > 0, "a feature has at least one value");
        assert_eq!(values.len(), dimension * owners.len(), "each owner has one row of values");
        Self { dimension, values, owners }
    }

    /// One feature per reading (a client's own, for example); `None` when there is none, or
    /// when they are empty or differ in length.
    #[must_use]
    pub fn from_rows(rows: &[Vec<f64>]) -> Option<Self> {
        let dimension = rows.first()?.len();
        let even = dimension > 0 && rows.iter().all(|row| row.len() == dimension);
        even.then(|| Self::from_parts(dimension, rows.concat(), (0..rows.len()).collect()))
    }

    /// Number of features.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.owners.len()
    }

    /// Length of a feature.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// One feature.
    #[must_use]
    pub fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.dimension..(row + 1) * self.dimension]
    }

    /// All features in order.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.dimension)
    }

    /// The index of the reading of each row.
    #[must_use]
    pub fn owners(&self) -> &[usize] {
        &self.owners
    }

    /// All values, row-major.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The mean feature; zeros when there is none.
    #[must_use]
    pub fn mean(&self) -> Vec<f64> {
        let mut mean = vec![0.0; self.dimension];
        for row in self.rows() {
            mean.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
        let n = self.n_rows().max(1) as f64;
        mean.iter_mut().for_each(|sum| *sum /= n);
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_adjacent_and_have_a_mean() {
        let matrix =
            FeatureMatrix::from_parts(2, vec![1.0, 2.0, 3.0, 4.0, 5.0, 0.0], vec![0, 0, 1]);
        assert_eq!((matrix.n_rows(), matrix.dimension()), (3, 2));
        assert_eq!(matrix.row(1), [3.0, 4.0]);
        assert_eq!(matrix.mean(), [3.0, 2.0]); // (1 + 3 + 5) / 3, (2 + 4 + 0) / 3
        assert_eq!(matrix.owners(), [0, 0, 1]);
    }

    #[test]
    fn vectors_of_different_lengths_are_refused() {
        let rows = vec![vec![1.0, 2.0], vec![3.0, 4.0]];
        assert!(FeatureMatrix::from_rows(&rows).unwrap().rows().eq(&rows));
        assert_eq!(FeatureMatrix::from_rows(&[vec![1.0], vec![]]), None);
        assert_eq!(FeatureMatrix::from_rows(&[vec![]]), None);
        assert_eq!(FeatureMatrix::from_rows(&[]), None);
    }
}
