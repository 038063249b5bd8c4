//! Quality of stated probabilities on sessions whose true object is known.
//!
//! Probabilities of answers are those by the default prior of "none of these"; losses, calibration
//! and stops are by an even one, since half of the trials are of unknown objects.

use palpate_core::belief::answer::StopRule;

use super::replay::{Step, Trial};

/// Accepted risks at which stops are counted.
pub const RISKS: [f64; 2] = [0.05, 0.01];

/// Number of bins of the calibration error, of equal width.
const BINS: usize = 10;

/// Least probability in a logarithmic loss: a single session must not decide.
const PROBABILITY_MIN: f64 = 1e-6;

/// What beliefs were worth.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    /// Share of sessions of known objects whose last belief named the object.
    pub accuracy: f64,
    /// Mean probability of "none of these" at the end of sessions of known objects.
    pub unknown_of_known: f64,
    /// The same of unknown objects: those that the catalogue lacks, and known ones without their
    /// object in the catalogue.
    pub unknown_of_unknown: f64,
    /// Mean −ln probability of the truth, over the touches of a trial, the trials of a session,
    /// and all sessions.
    pub log_loss: f64,
    /// Mean difference between the probability of the likeliest answer and the share of right
    /// answers with about this probability, over the beliefs after all touches.
    pub calibration_error: f64,
    /// Stops at [`RISKS`].
    pub stops: [Stops; RISKS.len()],
}

/// What a stop rule does at an accepted risk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// The accepted risk.
    pub risk: f64,
    /// Number of trials.
    pub n_trials: usize,
    /// Number of trials that stopped.
    pub n_stopped: usize,
    /// Number of those whose answer was wrong.
    pub n_wrong: usize,
    /// Mean number of touches until a stop; 0 without any.
    pub touches: f64,
}

/// Quality of trials, each with the stop rule that it is judged by.
pub(super) fn quality(trials: &[Trial], rule: impl Fn(&Trial) -> StopRule) -> Quality {
    let last = |is_known: bool| {
        let of_kind = trials.iter().filter(move |trial| trial.task.is_known == is_known);
        of_kind.filter_map(|trial| trial.steps.last())
    };
    let losses = losses(trials);
    Quality {
        accuracy: mean(last(true).map(|step| f64::from(u8::from(step.is_right())))),
        unknown_of_known: mean(last(true).map(|step| step.unknown)),
        unknown_of_unknown: mean(last(false).map(|step| step.unknown)),
        log_loss: mean(losses.into_iter().map(|(_, loss)| loss)),
        calibration_error: calibration_error(trials),
        stops: RISKS.map(|risk| stops(trials, risk, &rule)),
    }
}

/// Mean loss of each session that touched something, by its index.
pub(super) fn losses(trials: &[Trial]) -> Vec<(usize, f64)> {
    let surprise = |step: &Step| -step.at_even_prior().truth.max(PROBABILITY_MIN).ln();
    let of_trial = |trial: &Trial| mean(trial.steps.iter().map(surprise));
    let felt: Vec<&Trial> = trials.iter().filter(|trial| !trial.steps.is_empty()).collect();
    let of_session = |trials: &[&Trial]| {
        (trials[0].task.session, mean(trials.iter().map(|trial| of_trial(trial))))
    };
    felt.chunk_by(|a, b| a.task.session == b.task.session).map(of_session).collect()
}

fn calibration_error(trials: &[Trial]) -> f64 {
    let mut bins = [(0.0, 0.0); BINS];
    let steps = || trials.iter().flat_map(|trial| &trial.steps).map(Step::at_even_prior);
    for step in steps() {
        let p = step.likeliest();
        let bin = &mut bins[((p * BINS as f64) as usize).min(BINS - 1)];
        *bin = (bin.0 + p, bin.1 + f64::from(u8::from(step.is_right())));
    }
    let n = steps().count().max(1) as f64;
    bins.iter().map(|(stated, right)| (stated - right).abs()).sum::<f64>() / n
}

/// The first belief of a trial whose likeliest answer is as probable as demanded.
pub(super) fn stop(trial: &Trial, is_enough: impl Fn(f64) -> bool) -> Option<Step> {
    trial.steps.iter().map(Step::at_even_prior).find(|step| is_enough(step.likeliest()))
}

fn stops(trials: &[Trial], risk: f64, rule: &impl Fn(&Trial) -> StopRule) -> Stops {
    let stopped = |trial: &Trial| stop(trial, |p| rule(trial).risk(p) <= risk);
    let stopped: Vec<Step> = trials.iter().filter_map(stopped).collect();
    Stops {
        risk,
        n_trials: trials.len(),
        n_stopped: stopped.len(),
        n_wrong: stopped.iter().filter(|step| !step.is_right()).count(),
        touches: mean(stopped.iter().map(|step| step.n_touches as f64)),
    }
}

/// The mean; 0 of nothing.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), value| (sum + value, n + 1));
    sum / n.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::replay::Task;

    /// A trial whose probabilities of the likeliest object, at the default prior, are these; the
    /// rest is "none of these".
    fn trial(session: usize, is_known: bool, best: &[f64]) -> Trial {
        let step = |(index, best): (usize, &f64)| Step {
            n_touches: index + 1,
            truth: if is_known { *best } else { 1.0 - best },
            best: *best,
            is_best_true: is_known,
            unknown: 1.0 - best,
            is_known,
        };
        let steps = best.iter().enumerate().map(step).collect();
        Trial { task: Task { session, is_known }, samples: Vec::new(), steps }
    }

    #[test]
    fn quality_is_that_computed_by_hand() {
        // At an even prior 0.95 is a half, odds of 19 : 1 divided by 19, and 0.4 is 0.4 : 11.4.
        let trials = [trial(0, true, &[0.95, 1.0]), trial(0, false, &[0.95, 0.4])];
        let found = quality(&trials, |_| StopRule { excess: 1e-9 });
        assert!((found.accuracy - 1.0).abs() < 1e-12);
        assert!(found.unknown_of_known.abs() < 1e-12);
        assert!((found.unknown_of_unknown - 0.6).abs() < 1e-12);
        // −ln of ½, 1, ½ and 11.4/11.8.
        let unknown = 11.4f64 / 11.8;
        let loss = (2.0 * 2f64.ln() - unknown.ln()) / 4.0;
        assert!((found.log_loss - loss).abs() < 1e-12, "{found:?}");
        // Two beliefs of a half, right once (a tie is "none of these"), and two sure ones that are
        // right: nothing off, and 0.4/11.8 off in one of four.
        assert!((found.calibration_error - (1.0 - unknown) / 4.0).abs() < 1e-12, "{found:?}");
        let expected = Stops { risk: 0.05, n_trials: 2, n_stopped: 2, n_wrong: 0, touches: 2.0 };
        assert_eq!(found.stops[0], Stops { risk: 0.05, ..expected });
        assert_eq!((found.stops[1].n_stopped, found.stops[1].n_wrong), (1, 0));
    }

    #[test]
    fn sessions_weigh_alike_whatever_their_trials() {
        let trials = [trial(0, true, &[1.0]), trial(0, false, &[0.95]), trial(1, false, &[0.95])];
        let found = losses(&trials);
        assert_eq!((found[0].0, found[1].0), (0, 1));
        assert!((found[0].1 - 0.5 * 2f64.ln()).abs() < 1e-12, "{found:?}");
        assert!((found[1].1 - 2f64.ln()).abs() < 1e-12, "{found:?}");
    }
}
