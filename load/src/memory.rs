//! The server's resident memory while it is under load.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use palpate_client::Client;
use serde::Serialize;

/// Interval between samples.
const EVERY: Duration = Duration::from_secs(1);
/// The metric in `/metrics`, in bytes.
const METRIC: &str = "process_resident_memory_bytes";
/// Inverse of the share of the samples at either end over which the median is taken.
const END_SHARE: usize = 10;

/// Source of the server's resident memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MemorySource {
    /// From its metrics.
    Metrics,
    /// From `/proc`, for a server on this machine.
    Process {
        /// The process's id.
        pid: u32,
    },
}

/// Memory at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds since the start of sampling.
    pub at_s: f64,
    /// Resident bytes.
    pub bytes: f64,
}

/// Development of memory over a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// Number of samples.
    pub samples: usize,
    /// Median of the first tenth of the samples.
    pub begin_bytes: f64,
    /// Median of the last tenth of the samples.
    pub end_bytes: f64,
    /// Maximum.
    pub max_bytes: f64,
    /// Difference of the end and the start.
    pub growth_bytes: f64,
    /// Slope of the least-squares line through all samples, bytes per second.
    pub slope_bytes_per_s: f64,
}

impl Growth {
    /// Growth over samples in order of time; `None` for fewer than two.
    #[must_use]
    pub fn of(samples: &[Sample]) -> Option<Self> {
        if samples.len() < 2 {
            return None;
        }
        let n_end = samples.len().div_ceil(END_SHARE);
        let begin_bytes = median(&samples[..n_end]);
        let end_bytes = median(&samples[samples.len() - n_end..]);
        let n = samples.len() as f64;
        let mean_at = samples.iter().map(|sample| sample.at_s).sum::<f64>() / n;
        let mean_bytes = samples.iter().map(|sample| sample.bytes).sum::<f64>() / n;
        let both: f64 = samples.iter().map(|s| (s.at_s - mean_at) * (s.bytes - mean_bytes)).sum();
        let along: f64 = samples.iter().map(|s| (s.at_s - mean_at).powi(2)).sum();
        Some(Self {
            samples: samples.len(),
            begin_bytes,
            end_bytes,
            max_bytes: samples.iter().map(|sample| sample.bytes).fold(0.0, f64::max),
            growth_bytes: end_bytes - begin_bytes,
            slope_bytes_per_s: if along > 0.0 { both / along } else { 0.0 },
        })
    }
}

fn median(samples: &[Sample]) -> f64 {
    let mut bytes: Vec<f64> = samples.iter().map(|sample| sample.bytes).collect();
    bytes.sort_by(f64::total_cmp);
    f64::midpoint(bytes[(bytes.len() - 1) / 2], bytes[bytes.len() / 2])
}

/// Does some work and samples the memory meanwhile; failed samples are left out.
pub(super) async fn watch<T>(
    client: &Client,
    source: &MemorySource,
    work: impl Future<Output = T>,
) -> (T, Vec<Sample>) {
    let begun = Instant::now();
    let mut samples = Vec::new();
    let mut ticks = tokio::time::interval(EVERY);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut work = std::pin::pin!(work);
    loop {
        tokio::select! {
            done = &mut work => return (done, samples),
            _ = ticks.tick() => {}
        }
        tokio::select! {
            done = &mut work => return (done, samples),
            bytes = read(client, source) => {
                let at_s = begun.elapsed().as_secs_f64();
                samples.extend(bytes.map(|bytes| Sample { at_s, bytes }));
            }
        }
    }
}

async fn read(client: &Client, source: &MemorySource) -> Option<f64> {
    match source {
        MemorySource::Metrics => of_metrics(&client.metrics().await.ok()?),
        MemorySource::Process { pid } => {
            let status = PathBuf::from(format!("/proc/{pid}/status"));
            of_status(&std::fs::read_to_string(status).ok()?)
        }
    }
}

/// The gauge's value in Prometheus's text.
fn of_metrics(text: &str) -> Option<f64> {
    text.lines().find_map(|line| line.strip_prefix(METRIC)?.trim().parse().ok())
}

/// `VmRSS` of a process's status, which is in units of 1024 bytes.
fn of_status(text: &str) -> Option<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let units: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(units * 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{found}, {expected}");
    }

    #[test]
    fn steady_growth_shows_at_both_ends_and_in_the_slope() {
        let at = |n: u32| Sample { at_s: f64::from(n), bytes: 1e6 + 500.0 * f64::from(n) };
        let samples: Vec<Sample> = (0..100).map(at).collect();
        let growth = Growth::of(&samples).unwrap();
        // Medians of 0 to 9 and of 90 to 99: 4.5 and 94.5.
        close(growth.begin_bytes, 1e6 + 500.0 * 4.5);
        close(growth.growth_bytes, 500.0 * 90.0);
        close(growth.slope_bytes_per_s, 500.0);
        close(growth.max_bytes, 1e6 + 500.0 * 99.0);
        assert_eq!(Growth::of(&samples[..1]), None);
    }

    #[test]
    fn a_short_peak_is_not_growth() {
        let mut samples = vec![Sample { at_s: 0.0, bytes: 2e6 }; 50];
        samples[25].bytes = 9e6;
        let growth = Growth::of(&samples).unwrap();
        close(growth.growth_bytes, 0.0);
        close(growth.max_bytes, 9e6);
    }

    #[test]
    fn memory_is_parsed_from_metrics_and_proc() {
        let metrics = "# TYPE process_resident_memory_bytes gauge\n\
            process_resident_memory_bytes 1.25e8\npalpate_store_bytes 3\n";
        assert_eq!(of_metrics(metrics), Some(1.25e8));
        assert_eq!(of_metrics("palpate_store_bytes 3\n"), None);
        let status = "Name:\tpalpate\nVmRSS:\t   20480 kB\n";
        assert_eq!(of_status(status), Some(20_480.0 * 1024.0));
    }
}
