//! Probabilities in the log domain: the only functions that exponentiate a total.
//!
//! Arguments and results are natural logarithms unless the name says otherwise.

/// ln Σ exp(x), stable for any finite inputs; −∞ for an empty sum.
#[must_use]
pub fn log_sum_exp(logs: impl Iterator<Item = f64> + Clone) -> f64 {
    let max = logs.clone().fold(f64::NEG_INFINITY, f64::max);
    if max == f64::NEG_INFINITY {
        return max;
    }
    max + logs.map(|log| (log - max).exp()).sum::<f64>().ln()
}

/// Turns unnormalised logs into probabilities that sum to 1; uniform when all are −∞.
#[must_use]
pub fn normalize(logs: &[f64]) -> Vec<f64> {
    let total = log_sum_exp(logs.iter().copied());
    if total == f64::NEG_INFINITY {
        return vec![(logs.len().max(1) as f64).recip(); logs.len()];
    }
    logs.iter().map(|log| (log - total).exp()).collect()
}

/// The entropy of probabilities that sum to 1, in bits.
#[must_use]
pub fn entropy_bits(probabilities: &[f64]) -> f64 {
    let terms = probabilities.iter().filter(|p| **p > 0.0).map(|p| p * p.log2());
    // Zero entropy is +0, also in print.
    (-terms.sum::<f64>()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn very_small_probabilities_keep_their_ratio() {
        // ln 3 apart at −5,000: 3/4 and 1/4.
        let shares = normalize(&[-5_000.0, -5_000.0 - 3.0_f64.ln()]);
        assert!((shares[0] - 0.75).abs() < 1e-12 && (shares[1] - 0.25).abs() < 1e-12);
    }

    #[test]
    fn four_equal_choices_are_two_bits() {
        assert!((entropy_bits(&[0.25; 4]) - 2.0).abs() < 1e-12);
        assert!(entropy_bits(&[1.0, 0.0]).to_bits() == 0.0_f64.to_bits());
    }

    #[test]
    fn all_impossible_is_uniform() {
        assert_eq!(normalize(&[f64::NEG_INFINITY; 2]), [0.5, 0.5]);
    }
}
