//! Times of requests: at constant intervals, or as from independent robots (Poisson).

use std::time::Duration;

use palpate_core::rng::{Purpose, Stream};
use serde::Serialize;

/// Distribution of the times of requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arrivals {
    /// Constant intervals.
    #[default]
    Constant,
    /// Independent, exponentially distributed intervals: bursts and pauses.
    Poisson,
}

/// The times at which requests are due, counted from the start of a step.
#[derive(Debug)]
pub(super) struct Schedule {
    rate: f64,
    arrivals: Arrivals,
    stream: Stream,
    n: u64,
    at: f64,
}

impl Schedule {
    /// `rate` requests per second, above 0.
    pub(super) fn new(rate: f64, arrivals: Arrivals, seed: u64, step: u64) -> Self {
        let stream = Stream::new(seed, Purpose::Arrivals, 2 * step);
        Self { rate, arrivals, stream, n: 0, at: 0.0 }
    }

    /// Time of the next request.
    pub(super) fn next(&mut self) -> Duration {
        let at = match self.arrivals {
            // Not a running sum: an hour of small steps would end elsewhere.
            Arrivals::Constant => self.n as f64 / self.rate,
            Arrivals::Poisson => {
                // 1 - u lies in (0, 1], so its logarithm is finite.
                self.at -= (1.0 - self.stream.uniform(0.0, 1.0)).ln() / self.rate;
                self.at
            }
        };
        self.n += 1;
        Duration::from_secs_f64(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_intervals_stay_exact_after_an_hour() {
        let mut schedule = Schedule::new(300.0, Arrivals::Constant, 1, 0);
        let last = (0..=300 * 3600).map(|_| schedule.next()).last().unwrap();
        assert_eq!(last, Duration::from_secs(3600));
    }

    #[test]
    fn poisson_arrivals_have_their_rate_and_spread() {
        let mut schedule = Schedule::new(50.0, Arrivals::Poisson, 101, 0);
        let at: Vec<f64> = (0..20_000).map(|_| schedule.next().as_secs_f64()).collect();
        let gaps: Vec<f64> = at.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
        let variance = gaps.iter().map(|gap| (gap - mean).powi(2)).sum::<f64>() / gaps.len() as f64;
        // An exponential distribution's deviation is its mean, here 20 ms; the error of the mean
        // of 20,000 of them is 0.7 %.
        assert!((mean / 0.02 - 1.0).abs() < 0.03, "{mean}");
        assert!((variance.sqrt() / mean - 1.0).abs() < 0.05, "{variance}");
        let mut again = Schedule::new(50.0, Arrivals::Poisson, 101, 0);
        assert!((again.next().as_secs_f64() - at[0]).abs() < 1e-12);
    }
}
