//! Figures of a soak: the bytes over time, and their summary.

use std::fmt;
use std::time::Duration;

use anyhow::Context;
use palpate_sim::plot::{Line, Panel, svg};
use reqwest::{Client, Method};
use serde::Serialize;
use serde_json::json;

use super::mix::Acknowledged;
use crate::Args;
use crate::http::send;

/// Share of the run that is warm-up: until the first sessions are removed.
const WARM_UP: f64 = 1.0 / 6.0;
const MB: f64 = 1e6;
/// Maximum points of a drawn curve.
const POINTS_MAX: usize = 600;

/// The bytes at one time.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Sample {
    /// Seconds since the start of the mix.
    at_s: f64,
    readings: u64,
    stored: f64,
    live: f64,
    compactions: f64,
    memory: f64,
}

impl Sample {
    fn ratio(&self) -> f64 {
        self.stored / self.live
    }

    /// The sample in words.
    pub(super) fn words(&self) -> String {
        format!(
            "{} readings, {:.0} MB stored, {:.0} MB live, ratio {:.2}, {} compactions",
            self.readings,
            self.stored / MB,
            self.live / MB,
            self.ratio(),
            self.compactions
        )
    }
}

/// Reads a sample from the metrics.
pub(super) async fn sample(
    keeper: &Client,
    url: &str,
    at_s: f64,
    readings: u64,
) -> anyhow::Result<Sample> {
    let metrics = send(keeper, Method::GET, format!("{url}/metrics"), None).await.done();
    let metrics = metrics.context("the server shows no metrics")?;
    let text = metrics.as_str().context("metrics are text")?;
    let value = |name: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        let value: Option<f64> = line.and_then(|value| value.trim().parse().ok());
        value.with_context(|| format!("the server has no metric {name}"))
    };
    Ok(Sample {
        at_s,
        readings,
        stored: value("palpate_store_bytes")?,
        live: value("palpate_store_live_bytes")?,
        compactions: value("palpate_store_compactions_total")?,
        memory: value("process_resident_memory_bytes")?,
    })
}

/// Summary of a soak.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Figures {
    acknowledged_lost: u64,
    store_bytes_per_live_byte: f64,
    store_bytes_beyond_4_live: f64,
    growth_mb_per_hour: f64,
    live_growth_mb_per_hour: f64,
    restart_ready_s: f64,
    longest_write_pause_ms: f64,
    longest_write_pause_at_s: f64,
    write_pauses_above_250_ms: u64,
    longest_request_ms: f64,
    readings_written: u64,
    readings_kept_before: u64,
    requests_refused: u64,
    searches_by_label: u64,
    longest_search_ms: f64,
    compactions: f64,
    live_mb_at_end: f64,
    stored_mb_at_end: f64,
    live_mb_after_restart: f64,
    stored_mb_after_restart: f64,
    memory_mb_max: f64,
    memory_growth_mb_per_hour: f64,
    samples: usize,
    minutes: f64,
    seed: u64,
    slack_mb: u64,
}

impl fmt::Display for Figures {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&json!(self).to_string())
    }
}

impl Figures {
    pub(super) fn of(
        args: &Args,
        acknowledged: &Acknowledged,
        samples: &[Sample],
        restart_ready: Duration,
        acknowledged_lost: u64,
        after: &Sample,
    ) -> Self {
        let end = samples.last().map_or(0.0, |sample| sample.at_s);
        let warm = || samples.iter().filter(|sample| sample.at_s >= end * WARM_UP);
        let largest = |value: fn(&Sample) -> f64| warm().map(value).fold(0.0, f64::max);
        let counts = acknowledged.counts();
        let last = samples.last().unwrap_or(after);
        Self {
            acknowledged_lost,
            store_bytes_per_live_byte: largest(Sample::ratio),
            store_bytes_beyond_4_live: largest(|sample| sample.stored - 4.0 * sample.live),
            growth_mb_per_hour: growth(samples, end, |sample| sample.stored - sample.live),
            live_growth_mb_per_hour: growth(samples, end, |sample| sample.live),
            restart_ready_s: restart_ready.as_secs_f64(),
            longest_write_pause_ms: counts.longest_pause.as_secs_f64() * 1e3,
            longest_write_pause_at_s: counts.longest_pause_at.as_secs_f64(),
            write_pauses_above_250_ms: counts.long_pauses,
            longest_request_ms: counts.longest_request.as_secs_f64() * 1e3,
            readings_written: counts.readings,
            readings_kept_before: args.kept,
            requests_refused: counts.refused,
            searches_by_label: counts.searches,
            longest_search_ms: counts.longest_search.as_secs_f64() * 1e3,
            compactions: last.compactions,
            live_mb_at_end: last.live / MB,
            stored_mb_at_end: last.stored / MB,
            live_mb_after_restart: after.live / MB,
            stored_mb_after_restart: after.stored / MB,
            memory_mb_max: samples.iter().map(|s| s.memory).fold(0.0, f64::max) / MB,
            memory_growth_mb_per_hour: growth(samples, end, |sample| sample.memory),
            samples: samples.len(),
            minutes: end / 60.0,
            seed: args.seed,
            slack_mb: args.slack_mb,
        }
    }

    /// Total of the faults; must be 0 in every run, however short.
    pub(crate) fn faults(&self) -> u64 {
        self.acknowledged_lost
    }

    /// The figures and all samples as JSON.
    pub(super) fn with_samples(&self, samples: &[Sample]) -> String {
        json!({ "figures": self, "samples": samples }).to_string()
    }
}

/// Growth in the last half, MB an hour: from the minimum of its first quarter to that of its
/// second. Space that a compaction frees again is not growth.
fn growth(samples: &[Sample], end: f64, value: fn(&Sample) -> f64) -> f64 {
    let least = |from: f64, to: f64| {
        let within = samples.iter().filter(|s| s.at_s >= end * from && s.at_s <= end * to);
        within.map(value).fold(f64::INFINITY, f64::min)
    };
    let hours = end * 0.25 / 3600.0;
    (least(0.75, 1.0) - least(0.5, 0.75)) / MB / hours
}

/// The curve: stored and live bytes, and their ratio.
pub(super) fn picture(samples: &[Sample]) -> String {
    let step = samples.len().div_ceil(POINTS_MAX).max(1);
    let line = |name: &str, value: fn(&Sample) -> f64| Line {
        name: name.to_owned(),
        points: samples.iter().step_by(step).map(|s| (s.at_s / 60.0, value(s))).collect(),
    };
    let panel = |title: &str, y: &str, lines: Vec<Line>| Panel {
        title: title.to_owned(),
        x: "minutes".to_owned(),
        y: y.to_owned(),
        lines,
    };
    let bytes =
        vec![line("stored", |sample| sample.stored / MB), line("live", |sample| sample.live / MB)];
    let ratio = vec![line("stored / live", Sample::ratio), line("bound", |_| 4.0)];
    svg(&[panel("Bytes on the disk", "MB", bytes), panel("Stored per live byte", "", ratio)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_measured_between_minima() {
        let tooth = |at: u32| 100.0 * MB + f64::from(at % 60) * MB + f64::from(at) * 1e3;
        let sample = |at: u32| Sample {
            at_s: f64::from(at),
            readings: 0,
            stored: tooth(at),
            live: 50.0 * MB,
            compactions: 0.0,
            memory: 0.0,
        };
        let samples: Vec<Sample> = (0..=1200).map(sample).collect();
        // 1 kB a second: 3.6 MB an hour.
        let found = growth(&samples, 1200.0, |sample| sample.stored - sample.live);
        assert!((found - 3.6).abs() < 1e-6, "{found}");
    }
}
