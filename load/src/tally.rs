//! Results of requests, in counts and times.

use std::collections::BTreeSet;
use std::time::Duration;

use hdrhistogram::Histogram;
use palpate_client::Error;
use serde::Serialize;

use super::operation::Operation;

/// Maximum latency in microseconds, ten minutes; latencies have three digits.
const LATENCY_MAX_US: u64 = 600_000_000;
const DIGITS: u8 = 3;
/// Maximum number of different failure messages kept.
const MESSAGES_MAX: usize = 5;

/// Result of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// Success.
    Accepted,
    /// Refused as overload (429 or 503), perhaps with a time of a retry.
    Refused { status: u16, retry_after: Option<Duration> },
    /// Another status.
    Other { status: u16, message: String },
    /// No answer.
    Lost { message: String },
}

impl Answer {
    /// The result that a client's error stands for.
    pub(super) fn of(error: &Error) -> Self {
        match error.status() {
            Some(status @ (429 | 503)) => {
                Self::Refused { status, retry_after: error.retry_after() }
            }
            Some(status) => Self::Other { status, message: error.to_string() },
            None => Self::Lost { message: error.to_string() },
        }
    }
}

/// Number of requests by result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Requests that were due.
    pub offered: u64,
    /// Requests that were sent.
    pub sent: u64,
    /// Requests with success (2xx).
    pub accepted: u64,
    /// Requests refused with 429.
    pub refused_429: u64,
    /// Requests refused with 503.
    pub refused_503: u64,
    /// Requests answered with another status.
    pub other: u64,
    /// Requests without an answer: time-outs, broken connections.
    pub errors: u64,
    /// Requests not sent because too many were under way.
    pub not_sent: u64,
    /// Requests not sent because no robot could: all wait for their sessions or for a retry.
    pub held_back: u64,
}

/// Latencies in milliseconds, from the moment at which a request was due.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Latency {
    /// Median.
    pub p50_ms: f64,
    /// 90th percentile.
    pub p90_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
    /// 99.9th percentile.
    pub p999_ms: f64,
    /// Maximum.
    pub max_ms: f64,
}

/// Results of the requests of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OperationReport {
    /// The kind.
    pub operation: Operation,
    /// Number of requests by result.
    #[serde(flatten)]
    pub counts: Counts,
    /// Latency of accepted requests; null without any.
    pub accepted_latency: Option<Latency>,
}

/// The requests of one kind.
struct Kind {
    counts: Counts,
    accepted: Histogram<u64>,
}

/// All measured requests of a step.
pub(super) struct Tally {
    kinds: Vec<Kind>,
    refused: Histogram<u64>,
    messages: BTreeSet<String>,
    lag_max: Duration,
    /// Accepted requests and readings answered during the measurement.
    in_window: [u64; 2],
}

impl Tally {
    pub(super) fn new() -> anyhow::Result<Self> {
        let kinds: anyhow::Result<Vec<Kind>> = Operation::ALL
            .iter()
            .map(|_| Ok(Kind { counts: Counts::default(), accepted: histogram()? }))
            .collect();
        Ok(Self {
            kinds: kinds?,
            refused: histogram()?,
            messages: BTreeSet::new(),
            lag_max: Duration::ZERO,
            in_window: [0; 2],
        })
    }

    fn counts(&mut self, operation: Operation) -> &mut Counts {
        &mut self.kinds[operation as usize].counts
    }

    /// Registers a request that could not be sent because too many are under way.
    pub(super) fn not_sent(&mut self, operation: Operation) {
        let counts = self.counts(operation);
        counts.offered += 1;
        counts.not_sent += 1;
    }

    /// Registers a request that no robot could send.
    pub(super) fn held_back(&mut self, operation: Operation) {
        let counts = self.counts(operation);
        counts.offered += 1;
        counts.held_back += 1;
    }

    /// Registers a sent request, `lag` after it was due.
    pub(super) fn sent(&mut self, operation: Operation, lag: Duration) {
        let counts = self.counts(operation);
        counts.offered += 1;
        counts.sent += 1;
        self.lag_max = self.lag_max.max(lag);
    }

    /// Registers an answer, `latency` after its request was due.
    pub(super) fn answered(&mut self, operation: Operation, answer: &Answer, latency: Duration) {
        let micros = (latency.as_micros() as u64).min(LATENCY_MAX_US);
        let counts = self.counts(operation);
        match answer {
            Answer::Accepted => {
                counts.accepted += 1;
                self.kinds[operation as usize].accepted.saturating_record(micros);
            }
            Answer::Refused { status, .. } => {
                match status {
                    429 => counts.refused_429 += 1,
                    _ => counts.refused_503 += 1,
                }
                self.refused.saturating_record(micros);
            }
            Answer::Other { message, .. } => {
                counts.other += 1;
                self.note(message);
            }
            Answer::Lost { message } => {
                counts.errors += 1;
                self.note(message);
            }
        }
    }

    /// Registers an accepted request answered during the measurement, whenever it was due.
    pub(super) fn accepted_in_window(&mut self, operation: Operation) {
        self.in_window[0] += 1;
        self.in_window[1] += u64::from(operation == Operation::Reading);
    }

    fn note(&mut self, message: &str) {
        if self.messages.len() < MESSAGES_MAX {
            self.messages.insert(message.to_owned());
        }
    }

    /// Accepted requests, and readings among them, answered during the measurement.
    pub(super) fn in_window(&self) -> [u64; 2] {
        self.in_window
    }

    pub(super) fn total(&self) -> Counts {
        self.kinds.iter().fold(Counts::default(), |sum, Kind { counts, .. }| Counts {
            offered: sum.offered + counts.offered,
            sent: sum.sent + counts.sent,
            accepted: sum.accepted + counts.accepted,
            refused_429: sum.refused_429 + counts.refused_429,
            refused_503: sum.refused_503 + counts.refused_503,
            other: sum.other + counts.other,
            errors: sum.errors + counts.errors,
            not_sent: sum.not_sent + counts.not_sent,
            held_back: sum.held_back + counts.held_back,
        })
    }

    pub(super) fn accepted_latency(&self) -> anyhow::Result<Option<Latency>> {
        let mut all = histogram()?;
        for kind in &self.kinds {
            all.add(&kind.accepted)?;
        }
        Ok(latency(&all))
    }

    pub(super) fn refused_latency(&self) -> Option<Latency> {
        latency(&self.refused)
    }

    pub(super) fn operations(&self) -> Vec<OperationReport> {
        let kinds = Operation::ALL.iter().zip(&self.kinds);
        kinds
            .filter(|(_, kind)| kind.counts.offered > 0)
            .map(|(operation, kind)| OperationReport {
                operation: *operation,
                counts: kind.counts,
                accepted_latency: latency(&kind.accepted),
            })
            .collect()
    }

    pub(super) fn messages(&self) -> Vec<String> {
        self.messages.iter().cloned().collect()
    }

    pub(super) fn lag_max(&self) -> Duration {
        self.lag_max
    }
}

fn histogram() -> anyhow::Result<Histogram<u64>> {
    Ok(Histogram::new_with_max(LATENCY_MAX_US, DIGITS)?)
}

fn latency(histogram: &Histogram<u64>) -> Option<Latency> {
    let at = |quantile| histogram.value_at_quantile(quantile) as f64 / 1e3;
    (!histogram.is_empty()).then(|| Latency {
        p50_ms: at(0.5),
        p90_ms: at(0.9),
        p99_ms: at(0.99),
        p999_ms: at(0.999),
        max_ms: histogram.max() as f64 / 1e3,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_due_request_has_one_result() {
        let mut tally = Tally::new().unwrap();
        let ms = Duration::from_millis;
        for n in 1..=100 {
            tally.sent(Operation::Reading, ms(0));
            tally.answered(Operation::Reading, &Answer::Accepted, ms(n));
        }
        let refused = Answer::Refused { status: 503, retry_after: None };
        let lost = Answer::Lost { message: "gone".to_owned() };
        for answer in [&refused, &lost] {
            tally.sent(Operation::Create, ms(7));
            tally.answered(Operation::Create, answer, ms(500));
        }
        tally.not_sent(Operation::Belief);
        tally.held_back(Operation::Belief);
        let total = tally.total();
        assert_eq!((total.offered, total.sent, total.accepted), (104, 102, 100));
        assert_eq!((total.refused_503, total.errors, total.refused_429), (1, 1, 0));
        assert_eq!((total.not_sent, total.held_back), (1, 1));
        // Refused requests do not affect the latency of accepted ones: 99 of 1 to 100 ms.
        let accepted = tally.accepted_latency().unwrap().unwrap();
        assert!((accepted.p99_ms - 99.0).abs() < 0.1, "{accepted:?}");
        assert!((tally.refused_latency().unwrap().p50_ms - 500.0).abs() < 0.5);
        assert_eq!((tally.messages(), tally.lag_max()), (vec!["gone".to_owned()], ms(7)));
    }
}
