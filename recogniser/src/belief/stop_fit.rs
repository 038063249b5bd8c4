//! Fit of the stop rule to sessions: how often the first answer that looks sure enough is wrong.
//! Equation R31 of docs/recogniser.md.

use palpate_core::belief::answer::StopRule;

use super::quality::stop;
use super::replay::Trial;

/// Doubts 1 − p at which trials are stopped.
const DOUBTS: [f64; 7] = [0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005];

/// Deviation of the prior of the logarithm of the excess.
const DEVIATION: f64 = std::f64::consts::LN_2;

/// Least and largest excess.
const EXCESS: [f64; 2] = [0.05, 1.0];

/// Number of steps between these.
const N_STEPS: usize = 60;

/// Risks are kept this far from 0 and 1, so that one stop does not decide.
const RISK_MIN: f64 = 1e-3;

/// The stop rule under which stops at every doubt are wrong as often as they were; `before` is
/// the rule that few trials leave as it is.
pub(super) fn stop_rule(trials: &[&Trial], before: StopRule) -> StopRule {
    let stopped = |doubt: f64| {
        let steps = trials.iter().filter_map(|trial| stop(trial, |p| 1.0 - p <= doubt));
        let counts = steps.fold([0.0, 0.0], |[wrong, right], step| match step.is_right() {
            true => [wrong, right + 1.0],
            false => [wrong + 1.0, right],
        });
        (doubt, counts)
    };
    let stopped = DOUBTS.map(stopped);
    let log_posterior = |excess: f64| {
        let rule = StopRule { excess };
        let log_likelihood = stopped.iter().map(|(doubt, [wrong, right])| {
            let risk = rule.risk(1.0 - doubt).clamp(RISK_MIN, 1.0 - RISK_MIN);
            wrong * risk.ln() + right * (1.0 - risk).ln()
        });
        // The same trials stop at every doubt, so they count once.
        let log_likelihood = log_likelihood.sum::<f64>() / DOUBTS.len() as f64;
        log_likelihood - 0.5 * ((excess / before.excess).ln() / DEVIATION).powi(2)
    };
    let [low, high] = EXCESS;
    let excess = |step: usize| low * (high / low).powf(step as f64 / N_STEPS as f64);
    let tried = (0..=N_STEPS).map(excess).map(|excess| (excess, log_posterior(excess)));
    let start = (before.excess, log_posterior(before.excess));
    let best = tried.fold(start, |best, found| if found.1 > best.1 { found } else { best });
    StopRule { excess: best.0 }
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::{Purpose, Stream};

    use super::*;
    use crate::belief::replay::{Step, Task};

    const DOUBT: f64 = 0.004;

    /// Trials whose first belief leaves little doubt; the answer is wrong with the risk that a rule
    /// of this excess states for it.
    fn trials(n: usize, excess: f64) -> Vec<Trial> {
        let mut stream = Stream::new(4, Purpose::Sampling, 0);
        let mut one = |session: usize| {
            let risk = StopRule { excess }.risk(1.0 - DOUBT);
            let unknown = DOUBT / (19.0 * (1.0 - DOUBT) + DOUBT);
            let is_best_true = stream.uniform(0.0, 1.0) > risk;
            // By the default prior, so that "none of these" has this probability by an even one.
            let step = Step {
                n_touches: 1,
                truth: 1.0,
                best: 1.0 - unknown,
                is_best_true,
                unknown,
                is_known: true,
            };
            Trial { task: Task { session, is_known: true }, samples: Vec::new(), steps: vec![step] }
        };
        (0..n).map(&mut one).collect()
    }

    fn fitted(n: usize, excess: f64) -> f64 {
        let all = trials(n, excess);
        stop_rule(&all.iter().collect::<Vec<_>>(), StopRule::default()).excess
    }

    #[test]
    fn trials_that_stop_wrong_raise_the_excess() {
        let [few, default, many] = [0.06, 0.2, 0.6].map(|excess| fitted(400, excess));
        assert!(few < default && default < many, "{few} {default} {many}");
        assert!(many > 0.25, "{many}");
    }

    #[test]
    fn without_trials_the_stop_rule_stays() {
        assert!((fitted(0, 0.6) - StopRule::default().excess).abs() < 1e-12);
    }
}
