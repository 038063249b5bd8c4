//! Measures of stated probabilities: detection of unknown objects, calibration, the stop rule.
//!
//! The sessions are played in `unknown`. Intervals are Wilson's (1927) at 95 %.

use palpate_core::belief::answer::{assured, stopping_risk};

/// Statement after one touch of one session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stated {
    /// The probability of the answer, which may be "none of these".
    pub best: f64,
    /// The probability of "none of these".
    pub unknown: f64,
    /// Probability of the answer that the stop rule uses.
    pub assured: f64,
    /// Whether the answer is right.
    pub is_right: bool,
}

impl Stated {
    /// The statement of these probabilities: one per object, that of "none of these" last.
    /// `truth` is the index of the true one. `untold_prior` is the prior of "none of these" if
    /// it is the service's default.
    #[must_use]
    pub fn new(probabilities: &[f64], truth: usize, untold_prior: Option<f64>) -> Self {
        let unknown = probabilities.last().copied().unwrap_or(0.0);
        let known = probabilities.split_last().map_or(&[][..], |(_, known)| known);
        let known = known.iter().copied().fold(0.0, f64::max);
        let all = probabilities.iter().enumerate();
        let (named, best) =
            all.fold((0, -1.0), |top, new| if *new.1 > top.1 { (new.0, *new.1) } else { top });
        let assured = assured(known, unknown, untold_prior);
        Self { best, unknown, assured, is_right: named == truth }
    }
}

/// Area under the ROC curve: probability that a random positive scores above a random negative,
/// ties counted half (Mann and Whitney, 1947); NaN without positives or without negatives.
#[must_use]
pub fn auroc(scored: &[(f64, bool)]) -> f64 {
    let mut sorted = scored.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut wins, mut below, mut positives) = (0.0, 0.0, 0.0);
    for ties in sorted.chunk_by(|a, b| a.0.total_cmp(&b.0).is_eq()) {
        let up = ties.iter().filter(|one| one.1).count() as f64;
        let down = ties.len() as f64 - up;
        wins += up * (below + 0.5 * down);
        below += down;
        positives += up;
    }
    wins / (positives * below)
}

/// One bin of a reliability diagram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// Number of statements.
    pub count: usize,
    /// Their mean stated probability.
    pub stated: f64,
    /// The share of them that is right.
    pub right: f64,
}

/// Statements by their probability, in `n_bins` bins of equal width; empty bins are left out.
#[must_use]
pub fn reliability(statements: &[Stated], n_bins: usize) -> Vec<Bin> {
    let bin_of = |one: &&Stated| ((one.best * n_bins as f64) as usize).min(n_bins - 1);
    let bins = (0..n_bins).map(|bin| {
        let within: Vec<&Stated> = statements.iter().filter(|one| bin_of(one) == bin).collect();
        let count = within.len();
        let right = within.iter().filter(|one| one.is_right).count();
        let stated: f64 = within.iter().map(|one| one.best).sum();
        Bin { count, stated: stated / count as f64, right: right as f64 / count as f64 }
    });
    bins.filter(|bin| bin.count > 0).collect()
}

/// Expected calibration error: mean distance between stated probability and share right, over
/// bins weighted by their counts (Guo et al., 2017).
#[must_use]
pub fn expected_calibration_error(bins: &[Bin]) -> f64 {
    let total: usize = bins.iter().map(|bin| bin.count).sum();
    let sum: f64 = bins.iter().map(|bin| bin.count as f64 * (bin.stated - bin.right).abs()).sum();
    sum / total as f64
}

/// Wilson's interval of a share at 95 %, of `hits` among `n`; all of 0 to 1 when `n` is 0.
#[must_use]
pub fn wilson(hits: usize, n: usize) -> (f64, f64) {
    const Z: f64 = 1.959_964;
    if n == 0 {
        return (0.0, 1.0);
    }
    let (share, n) = (hits as f64 / n as f64, n as f64);
    let scale = 1.0 + Z * Z / n;
    let middle = (share + 0.5 * Z * Z / n) / scale;
    let half = Z * (share * (1.0 - share) / n + 0.25 * Z * Z / (n * n)).sqrt() / scale;
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

/// Number of sessions whose doubt, 1 − `assured`, falls to at most `doubt` at some touch, and
/// the number of these that are wrong at the first such touch. The stop rule is fitted to these
/// counts.
#[must_use]
pub fn crossings(sessions: &[Vec<Stated>], doubt: f64) -> (usize, usize) {
    let first = |steps: &Vec<Stated>| {
        steps.iter().find(|step| 1.0 - step.assured <= doubt).map(|step| step.is_right)
    };
    let found: Vec<bool> = sessions.iter().filter_map(first).collect();
    (found.len(), found.iter().filter(|is_right| !**is_right).count())
}

/// Results of sessions under the stop rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// Sessions that stopped.
    pub stopped: usize,
    /// Sessions that stopped with a wrong answer.
    pub wrong: usize,
    /// Sessions in all.
    pub sessions: usize,
    /// Mean touches at the stop; NaN when none stopped.
    pub touches_mean: f64,
}

/// Stops each session (its statements touch by touch) at the first touch after which
/// the risk of stopping at the answer ([`stopping_risk`]) is at most `risk`.
#[must_use]
pub fn stops(sessions: &[Vec<Stated>], risk: f64) -> Stops {
    let (mut stopped, mut wrong, mut touches) = (0, 0, 0);
    for steps in sessions {
        if let Some(at) = steps.iter().position(|step| stopping_risk(step.assured) <= risk) {
            stopped += 1;
            wrong += usize::from(!steps[at].is_right);
            touches += at + 1;
        }
    }
    let touches_mean = touches as f64 / stopped as f64;
    Stops { stopped, wrong, sessions: sessions.len(), touches_mean }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stated(best: f64, is_right: bool) -> Stated {
        Stated { best, unknown: 0.0, assured: best, is_right }
    }

    #[test]
    fn the_area_counts_pairs_in_the_right_order() {
        // Positives 0.9, 0.4; negatives 0.5, 0.4, 0.1: of 6 pairs 3 + 1½ are in order.
        let scored = [(0.9, true), (0.4, true), (0.5, false), (0.4, false), (0.1, false)];
        assert!((auroc(&scored) - 4.5 / 6.0).abs() < 1e-12);
        assert!(auroc(&scored[..2]).is_nan());
    }

    #[test]
    fn calibration_error_is_the_weighed_distance_of_the_bins() {
        // Ten bins: 0.82 and 0.88 in one (mean 0.85, half right), 0.25 wrong, 1.0 right.
        let all = [stated(0.82, true), stated(0.88, false), stated(0.25, false), stated(1.0, true)];
        let bins = reliability(&all, 10);
        assert_eq!(bins.iter().map(|bin| bin.count).collect::<Vec<_>>(), [1, 2, 1]);
        assert!((bins[1].stated - 0.85).abs() < 1e-12 && (bins[1].right - 0.5).abs() < 1e-12);
        let expected = (0.25 + 2.0 * 0.35 + 0.0) / 4.0;
        assert!((expected_calibration_error(&bins) - expected).abs() < 1e-12);
    }

    #[test]
    fn the_interval_is_the_one_that_wilson_gives() {
        // 5 of 50 at z = 1.96: 0.0435 to 0.2136.
        let (low, high) = wilson(5, 50);
        assert!((low - 0.0435).abs() < 1e-4 && (high - 0.2136).abs() < 1e-4, "{low} {high}");
        assert!(wilson(0, 100).0.abs() < 1e-12);
        assert_eq!(wilson(0, 0), (0.0, 1.0));
    }

    #[test]
    fn a_session_stops_at_the_first_touch_that_is_sure_enough() {
        let sessions = [
            vec![stated(0.5, false), stated(0.92, false), stated(0.99, true)],
            vec![stated(0.95, true), stated(0.2, false), stated(0.3, false)],
            vec![stated(0.5, true); 3],
        ];
        let found = stops(&sessions, 0.1);
        assert_eq!((found.stopped, found.wrong, found.sessions), (2, 1, 3));
        assert!((found.touches_mean - 1.5).abs() < 1e-12);
        assert!(stops(&sessions, 0.001).touches_mean.is_nan());
    }

    #[test]
    fn the_likeliest_answer_is_stated_first_of_equals() {
        let stated = Stated::new(&[0.1, 0.4, 0.5], 2, Some(0.05));
        assert!((stated.unknown - 0.5).abs() < 1e-12 && stated.is_right, "{stated:?}");
        assert!((stated.assured - 0.5).abs() < 1e-12, "{stated:?}");
        let even = Stated::new(&[0.4, 0.4, 0.2], 1, Some(0.5));
        assert!((even.best - 0.4).abs() < 1e-12 && !even.is_right, "{even:?}");
        // Nineteen times the odds of none of these: 0.8 of 0.8 + 0.1 + 1.9.
        let rare = Stated::new(&[0.8, 0.1, 0.1], 0, Some(0.05));
        assert!((rare.assured - 0.8 / 2.8).abs() < 1e-12, "{rare:?}");
    }

    #[test]
    fn first_crossings_are_those_who_stop_at_a_doubt() {
        let sessions = [
            vec![stated(0.5, false), stated(0.92, false), stated(0.99, true)],
            vec![stated(0.95, true), stated(0.2, false), stated(0.3, false)],
        ];
        assert_eq!(crossings(&sessions, 0.1), (2, 1));
        assert_eq!(crossings(&sessions, 0.02), (1, 0));
    }
}
