//! Metrics that exist from the start, and the buckets of histograms.
//!
//! Prometheus computes an increase from two values. A counter that first appears at 1 has not
//! increased, so that an alert would miss the first failure. Not here: metrics with another source
//! of a first value (`app`), and metrics whose labels are not known in advance (`storage`).

pub(crate) mod help;

use palpate_store::engine::EngineStats;
use palpate_store::engine::content::FailedFetches;

use crate::clock::now_ms;

/// Upper ends of the duration histogram's buckets, in seconds. Dense around the second at which the
/// alert `PalpateSlow` begins: a quantile is interpolated within its bucket.
pub(crate) const DURATION_BUCKETS: [f64; 16] =
    [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0];

/// Upper ends of the buckets of probabilities.
pub(crate) const SHARE_BUCKETS: [f64; 8] = [0.05, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 1.0];

/// The route of robots' readings, whose answers the alerts watch.
const READINGS: [(&str, &str); 2] =
    [("method", "POST"), ("route", "/v1/sessions/{session}/readings")];
/// Statuses of that route: a success, and those that an alert counts.
const STATUSES: [&str; 5] = ["200", "429", "500", "503", "507"];
/// Counters without labels.
const PLAIN: [&str; 5] = [
    "palpate_beliefs_resumed_total",
    "palpate_connections_displaced_total",
    "palpate_readings_folded_total",
    "palpate_readings_total",
    "palpate_snapshots_total",
];

/// Figures of a cell; other servers stay at 0.
const OF_CELLS: [&str; 5] = [
    "palpate_forwarding_down_seconds",
    "palpate_forwarding_sessions_waiting",
    "palpate_forwarding_entries_waiting",
    "palpate_forwarding_sessions_refused",
    "palpate_forwarding_oldest_waiting_seconds",
];

/// Registers the metrics at 0, and the version and start of this process.
pub(crate) fn register() {
    help::describe();
    for name in PLAIN {
        metrics::counter!(name).increment(0);
    }
    for status in STATUSES {
        let [method, route] = READINGS;
        let labels = [method, route, ("status", status)];
        metrics::counter!("palpate_http_requests_total", &labels).increment(0);
    }
    // A histogram without values has all its buckets at 0.
    let _ = metrics::histogram!("palpate_http_request_seconds", &READINGS);
    for state in ["Succeeded", "Failed", "Cancelled"] {
        metrics::counter!("palpate_jobs_total", "state" => state).increment(0);
    }
    for status in ["401", "403", "429"] {
        metrics::counter!("palpate_requests_denied_total", "status" => status).increment(0);
    }
    for outcome in ["delivered", "failed"] {
        metrics::counter!("palpate_webhook_attempts_total", "outcome" => outcome).increment(0);
    }
    for outcome in ["delivered", "abandoned", "displaced", "too_large"] {
        metrics::counter!("palpate_webhook_deliveries_total", "outcome" => outcome).increment(0);
    }
    for answer in ["right", "wrong"] {
        for object in ["known", "unknown"] {
            let labels = [("answer", answer), ("object", object)];
            metrics::counter!("palpate_feedback_total", &labels).increment(0);
        }
    }
    let _ = metrics::histogram!("palpate_feedback_probability");
    for name in OF_CELLS {
        metrics::gauge!(name).set(0.0);
    }
    metrics::gauge!("palpate_snapshot_timestamp_seconds").set(0.0);
    metrics::gauge!("palpate_start_timestamp_seconds").set(now_ms() as f64 / 1000.0);
    metrics::gauge!("palpate_build_info", "version" => env!("CARGO_PKG_VERSION")).set(1.0);
}

/// Shows what the store keeps on a cluster, and in objects beside its records; 0 in a folder.
pub(crate) fn of_cluster(stats: &EngineStats) {
    let EngineStats { received_bytes, content, .. } = stats;
    metrics::counter!("palpate_store_received_bytes_total").absolute(*received_bytes);
    metrics::gauge!("palpate_content_objects").set(content.n_objects as f64);
    metrics::gauge!("palpate_content_bytes").set(content.bytes as f64);
    metrics::gauge!("palpate_content_cached_bytes").set(content.cached_bytes as f64);
    metrics::gauge!("palpate_content_missing").set(content.n_missing as f64);
    metrics::counter!("palpate_content_puts_total").absolute(content.n_put);
    metrics::counter!("palpate_content_fetches_total").absolute(content.n_fetched);
    metrics::counter!("palpate_content_fetched_bytes_total").absolute(content.fetched_bytes);
    metrics::counter!("palpate_content_cache_hits_total").absolute(content.n_cache_hits);
    let FailedFetches { missing, damaged, removed, unanswered } = content.failed;
    let failed = [
        ("missing", missing),
        ("damaged", damaged),
        ("removed", removed),
        ("unanswered", unanswered),
    ];
    for (reason, n) in failed {
        metrics::counter!("palpate_content_fetches_failed_total", "reason" => reason).absolute(n);
    }
    for (reason, n) in [("unnamed", content.n_removed), ("leftover", content.n_leftovers)] {
        metrics::counter!("palpate_content_removals_total", "reason" => reason).absolute(n);
    }
}

/// Counts a snapshot that was sent to its end, and notes the time.
pub(crate) fn sent_snapshot() {
    metrics::counter!("palpate_snapshots_total").increment(1);
    metrics::gauge!("palpate_snapshot_timestamp_seconds").set(now_ms() as f64 / 1000.0);
}
