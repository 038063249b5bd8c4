//! Report of a run: its steps, the peak, the throughput beyond saturation, and broken bounds.

use serde::Serialize;

use super::LoadConfig;
use super::memory::Growth;
use super::step::StepReport;

/// Bounds of a run; missing ones always hold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Bound on the 99th percentile of accepted requests in every step, milliseconds.
    pub p99_max_ms: Option<f64>,
    /// Bound on the throughput beyond saturation, as a share of the peak.
    pub share_min: Option<f64>,
    /// Bound on the growth of memory over the soak, or the last step without one, bytes.
    pub growth_max_bytes: Option<f64>,
}

/// A whole run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoadReport {
    /// Seed of all randomness.
    pub seed: u64,
    /// The configuration.
    pub mix: String,
    /// Number of robots.
    pub sessions: usize,
    /// Readings after which they start another session.
    pub readings_per_session: u32,
    /// Whether they waited as long as `Retry-After` said.
    pub polite: bool,
    /// The steps.
    pub steps: Vec<StepReport>,
    /// The long step at overload, if there was one.
    pub soak: Option<StepReport>,
    /// Verdict over all steps.
    pub verdict: Verdict,
}

/// Verdict over all steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Largest number of accepted readings per second of a step.
    pub peak_readings_per_s: f64,
    /// Largest number of accepted requests per second of a step.
    pub peak_accepted_per_s: f64,
    /// The rate at which the readings peaked.
    pub peak_rate: f64,
    /// Smallest number of readings per second at a higher rate than that, as a share of the
    /// peak; null when no higher rate was tried.
    pub share_beyond: Option<f64>,
    /// Whether a step went beyond the server's capacity: a twentieth or more of the due
    /// requests were not accepted.
    pub is_saturated: bool,
    /// Largest 99th percentile of a step's accepted requests, milliseconds; null without any.
    pub p99_ms: Option<f64>,
    /// Development of memory over the soak, or over the last step without one.
    pub memory: Option<Growth>,
    /// Answers not explained by overload: other statuses and missing answers.
    pub unexpected: u64,
}

/// Share of accepted requests below which a step was beyond saturation.
const ACCEPTED_SHARE: f64 = 0.95;

impl LoadReport {
    pub(super) fn new(
        config: &LoadConfig,
        steps: Vec<StepReport>,
        soak: Option<StepReport>,
    ) -> Self {
        let verdict = Verdict::of(&steps, soak.as_ref());
        Self {
            seed: config.seed,
            mix: config.mix.to_string(),
            sessions: config.sessions,
            readings_per_session: config.readings_per_session,
            polite: config.polite,
            steps,
            soak,
            verdict,
        }
    }

    /// Broken bounds, in words. A bound without data is broken too.
    #[must_use]
    pub fn broken(&self, bounds: &Bounds) -> Vec<String> {
        let verdict = &self.verdict;
        let mut broken = Vec::new();
        if let Some(max) = bounds.p99_max_ms {
            match verdict.p99_ms {
                Some(found) if found <= max => {}
                Some(found) => broken.push(format!(
                    "p99 of accepted requests is {found:.1} ms, at most {max} ms were wanted"
                )),
                None => broken.push("no request was accepted, so there is no p99".to_owned()),
            }
        }
        if let Some(min) = bounds.share_min {
            match verdict.share_beyond {
                Some(found) if found >= min => {}
                Some(found) => broken.push(format!(
                    "throughput beyond saturation is {found:.2} of the peak, at least {min} was \
                     wanted"
                )),
                None => broken.push(
                    "no rate above the peak's was tried, so nobody can tell what is left beyond \
                     saturation"
                        .to_owned(),
                ),
            }
        }
        if let Some(max) = bounds.growth_max_bytes {
            match verdict.memory.map(|memory| memory.growth_bytes) {
                Some(found) if found <= max => {}
                Some(found) => broken.push(format!(
                    "memory grew by {:.1} MB, at most {:.1} MB were wanted",
                    found / 1e6,
                    max / 1e6
                )),
                None => broken.push(
                    "the server's memory is not known: give --pid for a server on this machine"
                        .to_owned(),
                ),
            }
        }
        broken
    }
}

impl Verdict {
    fn of(steps: &[StepReport], soak: Option<&StepReport>) -> Self {
        let all = || steps.iter().chain(soak);
        let peak = all().max_by(|a, b| a.readings_per_s.total_cmp(&b.readings_per_s));
        let Some(peak) = peak else { return Self::default() };
        let share = |step: &StepReport| step.readings_per_s / peak.readings_per_s;
        let beyond = all().filter(|step| step.rate > peak.rate && peak.readings_per_s > 0.0);
        let last = soak.or(steps.last());
        Self {
            peak_readings_per_s: peak.readings_per_s,
            peak_accepted_per_s: all().map(|step| step.accepted_per_s).fold(0.0, f64::max),
            peak_rate: peak.rate,
            share_beyond: beyond.map(share).min_by(f64::total_cmp),
            is_saturated: all().any(|step| {
                (step.counts.accepted as f64) < ACCEPTED_SHARE * step.counts.offered as f64
            }),
            p99_ms: all()
                .filter_map(|step| step.accepted_latency)
                .map(|latency| latency.p99_ms)
                .max_by(f64::total_cmp),
            memory: last.and_then(|step| step.memory),
            unexpected: all().map(|step| step.counts.other + step.counts.errors).sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Arrivals, Counts, Latency, Mix};
    use super::*;

    fn step(rate: f64, readings_per_s: f64, p99_ms: f64) -> StepReport {
        let accepted = (10.0 * readings_per_s) as u64;
        let offered = (10.0 * rate) as u64;
        StepReport {
            rate,
            seconds: 10.0,
            accepted_per_s: readings_per_s,
            readings_per_s,
            counts: Counts { offered, accepted, ..Counts::default() },
            accepted_latency: Some(Latency { p99_ms, ..Latency::default() }),
            refused_latency: None,
            operations: Vec::new(),
            sender_lag_max_ms: 0.0,
            messages: Vec::new(),
            memory: None,
        }
    }

    fn report(steps: Vec<StepReport>, soak: Option<StepReport>) -> LoadReport {
        let config = LoadConfig {
            seed: 1,
            catalogue: String::new(),
            method: None,
            belief: palpate_schemas::BeliefDetail::Full,
            rates: Vec::new(),
            arrivals: Arrivals::Constant,
            duration: std::time::Duration::ZERO,
            warmup: std::time::Duration::ZERO,
            soak: None,
            sessions: 1,
            readings_per_session: 1,
            mix: Mix::default(),
            in_flight_max: 1,
            polite: false,
        };
        LoadReport::new(&config, steps, soak)
    }

    #[test]
    fn share_beyond_saturation_is_the_worst_above_the_peak() {
        let steps = vec![
            step(100.0, 100.0, 5.0),
            step(200.0, 190.0, 20.0),
            step(400.0, 171.0, 600.0),
            step(800.0, 152.0, 700.0),
        ];
        let verdict = report(steps, None).verdict;
        assert!((verdict.peak_rate - 200.0).abs() < 1e-9);
        // 152 of 190.
        assert!((verdict.share_beyond.unwrap() - 0.8).abs() < 1e-9, "{verdict:?}");
        assert!((verdict.p99_ms.unwrap() - 700.0).abs() < 1e-9);
        assert!(verdict.is_saturated);
    }

    #[test]
    fn without_a_higher_rate_there_is_no_share() {
        let verdict = report(vec![step(50.0, 50.0, 5.0), step(100.0, 99.0, 5.0)], None).verdict;
        assert_eq!((verdict.share_beyond, verdict.is_saturated), (None, false));
    }

    #[test]
    fn broken_bounds_are_named_with_found_and_expected() {
        let mut soak = step(300.0, 95.0, 50.0);
        let growth = Growth {
            samples: 9,
            begin_bytes: 1e8,
            end_bytes: 1.5e8,
            max_bytes: 1.6e8,
            growth_bytes: 5e7,
            slope_bytes_per_s: 1e5,
        };
        soak.memory = Some(growth);
        let report = report(vec![step(100.0, 100.0, 5.0)], Some(soak));
        let bounds =
            Bounds { p99_max_ms: Some(49.0), share_min: Some(0.96), growth_max_bytes: Some(4.9e7) };
        let broken = report.broken(&bounds).join("\n");
        assert!(broken.contains("is 50.0 ms, at most 49 ms"), "{broken}");
        assert!(broken.contains("is 0.95 of the peak, at least 0.96"), "{broken}");
        assert!(broken.contains("grew by 50.0 MB, at most 49.0 MB"), "{broken}");
        let kept =
            Bounds { p99_max_ms: Some(50.0), share_min: Some(0.95), growth_max_bytes: Some(5e7) };
        assert_eq!(report.broken(&kept), Vec::<String>::new());
    }

    #[test]
    fn a_bound_without_data_is_broken() {
        let bounds =
            Bounds { p99_max_ms: None, share_min: Some(0.1), growth_max_bytes: Some(1e12) };
        assert_eq!(report(vec![step(1.0, 1.0, 1.0)], None).broken(&bounds).len(), 2);
    }
}
