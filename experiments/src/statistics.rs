//! Summaries of samples.

use std::collections::BTreeMap;

use palpate_core::rng::{Purpose, Stream};

/// Draws of a bootstrap.
const DRAWS: u64 = 2_000;

/// The mean; NaN without values.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The `share` quantile (0 to 1) by linear interpolation; NaN without values.
#[must_use]
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = share * last as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    low + (high - low) * at.fract()
}

/// The median; NaN without values.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// The standard error of the mean over groups: its deviation if the groups, such as objects or
/// simulated sensors, were drawn again. Each value names its group; NaN for fewer than two
/// groups.
///
/// Trials of one group share its object, its readings or its sensor, so that more of them do not
/// reduce this error.
#[must_use]
pub fn standard_error_over_groups(values: impl IntoIterator<Item = (u64, f64)>) -> f64 {
    let mut sums: BTreeMap<u64, (f64, f64)> = BTreeMap::new();
    for (group, value) in values {
        let sum = sums.entry(group).or_default();
        *sum = (sum.0 + value, sum.1 + 1.0);
    }
    if sums.len() < 2 {
        return f64::NAN;
    }
    let means: Vec<f64> = sums.values().map(|(sum, n)| sum / n).collect();
    let (middle, n) = (mean(&means), means.len() as f64);
    let variance = means.iter().map(|value| (value - middle).powi(2)).sum::<f64>() / (n - 1.0);
    (variance / n).sqrt()
}

/// The interval in which 95 % of a statistic of `n` cases lies when cases are drawn again with
/// replacement (Efron, 1979). `statistic` gets the drawn cases' indices.
pub fn bootstrap_95(n: usize, seed: u64, statistic: impl Fn(&[usize]) -> f64) -> [f64; 2] {
    let drawn = |draw| {
        let mut stream = Stream::new(seed, Purpose::Bootstrap, draw);
        statistic(&(0..n).map(|_| stream.index(n)).collect::<Vec<usize>>())
    };
    let drawn: Vec<f64> = (0..DRAWS).map(drawn).collect();
    [quantile(&drawn, 0.025), quantile(&drawn, 0.975)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bootstrap_of_the_mean_is_as_wide_as_its_deviation() {
        // 0 and 1 in equal numbers: the mean of 400 has deviation 0.5/20, so ±1.96 · 0.025.
        let values: Vec<f64> = (0..400).map(|n| f64::from(n % 2)).collect();
        let of = |cases: &[usize]| mean(&cases.iter().map(|n| values[*n]).collect::<Vec<_>>());
        let [low, high] = bootstrap_95(400, 101, of);
        assert!((high - low - 0.098).abs() < 0.01, "{low} {high}");
        assert!((0.5 * (low + high) - 0.5).abs() < 0.005, "{low} {high}");
    }

    #[test]
    fn the_error_over_groups_does_not_shrink_with_trials() {
        // Means of the groups 1, 0.5 and 0: deviation 0.5, over √3. Trials of a group that
        // agree add nothing.
        let once = [(1, 1.0), (2, 0.5), (3, 0.0)];
        let often = once.iter().copied().cycle().take(300);
        for error in [standard_error_over_groups(once), standard_error_over_groups(often)] {
            assert!((error - 0.5 / 3.0_f64.sqrt()).abs() < 1e-12, "{error}");
        }
        assert!(standard_error_over_groups([(1, 0.5), (1, 1.0)]).is_nan());
    }

    #[test]
    fn quantiles_interpolate() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert!((median(&values) - 2.5).abs() < 1e-12);
        assert!((quantile(&values, 1.0) - 4.0).abs() < 1e-12);
        assert!((mean(&values) - 2.5).abs() < 1e-12);
        assert!(median(&[]).is_nan());
    }
}
