//! The choice of k: the vocabulary with the best recognition of a validation set.
//!
//! Source: section 4.4.2.1: accuracy decides, ties are broken by reliability, "the total
//! probability weight allocated to correct classes". Not here: fitting the candidates.

/// Result of one number of classes on the validation set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassCount {
    /// Number of classes.
    pub n_classes: usize,
    /// Share of the trials whose most likely object was the true one.
    pub accuracy: f64,
    /// Mean probability of the true object.
    pub reliability: f64,
}

/// The index of the best candidate: highest accuracy, then reliability, then the first.
#[must_use]
pub fn best_class_count(table: &[ClassCount]) -> Option<usize> {
    let better = |a: &ClassCount, b: &ClassCount| {
        let by_accuracy = a.accuracy.total_cmp(&b.accuracy);
        by_accuracy.then(a.reliability.total_cmp(&b.reliability)).is_gt()
    };
    (0..table.len())
        .reduce(|best, next| if better(&table[next], &table[best]) { next } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(n_classes: usize, accuracy: f64, reliability: f64) -> ClassCount {
        ClassCount { n_classes, accuracy, reliability }
    }

    #[test]
    fn accuracy_decides_and_reliability_breaks_ties() {
        let table = [count(10, 0.9, 0.95), count(20, 0.95, 0.7), count(30, 0.95, 0.8)];
        assert_eq!(best_class_count(&table), Some(2));
        let equal = [count(10, 0.9, 0.5), count(20, 0.9, 0.5)];
        assert_eq!(best_class_count(&equal), Some(0));
        assert_eq!(best_class_count(&[]), None);
    }
}
