//! Findings in general: a choice with its probability, and the consequence of a finding.

/// Probability from which a choice counts as determined. Chosen: one undetected error in twenty
/// is what the goals of the experiment `commissioning` permit.
pub const DETERMINED: f64 = 0.95;

/// One of several discrete possibilities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice<T> {
    /// The likeliest possibility.
    pub value: T,
    /// Its probability against the others.
    pub probability: f64,
    /// The possibility that the set-up states.
    pub stated: T,
}

/// Consequence of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The set-up is as stated.
    Right,
    /// The set-up differs from what is stated; the value says how to correct it.
    Wrong,
    /// These touches cannot tell.
    Undetermined,
}

impl<T: PartialEq> Choice<T> {
    /// Whether the choice is as stated, another one, or undetermined.
    pub fn verdict(&self) -> Verdict {
        match (self.probability >= DETERMINED, self.value == self.stated) {
            (false, _) => Verdict::Undetermined,
            (true, true) => Verdict::Right,
            (true, false) => Verdict::Wrong,
        }
    }
}

/// Probabilities of alternatives from their log-likelihoods and prior weights (linear).
#[must_use]
pub fn posterior(alternatives: &[(f64, f64)]) -> Vec<f64> {
    let logs: Vec<f64> = alternatives.iter().map(|(log, prior)| log + prior.ln()).collect();
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = logs.iter().map(|log| (log - most).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_posterior_is_likelihood_times_prior() {
        // 2 · 0.5 against 1 · 0.25: four to one.
        let found = posterior(&[(2.0_f64.ln() - 900.0, 0.5), (-900.0, 0.25)]);
        assert!((found[0] - 0.8).abs() < 1e-12 && (found[1] - 0.2).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn an_unlikely_choice_is_undetermined() {
        let choice = |value, probability| Choice { value, probability, stated: 1 }.verdict();
        assert_eq!(choice(1, 0.97), Verdict::Right);
        assert_eq!(choice(2, 0.97), Verdict::Wrong);
        assert_eq!(choice(2, 0.9), Verdict::Undetermined);
    }
}
