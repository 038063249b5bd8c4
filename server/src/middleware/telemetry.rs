//! Observability: request ids, logs and metrics.
//!
//! Metrics belong to the process: several servers in one process (tests) share them. Logs go
//! to the process's `tracing` subscriber, which is installed elsewhere.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderName, HeaderValue, Method};
use axum::middleware::Next;
use axum::response::Response;
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use tokio::sync::watch;
use tracing::Instrument;
use uuid::Uuid;

use crate::clock::pause;
use crate::figures::{self, DURATION_BUCKETS, SHARE_BUCKETS};
use crate::problem;
use crate::secret::redacted;

/// The header with a request's id, in requests and answers.
pub(crate) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Maximum length of a request id chosen by a client.
const REQUEST_ID_BYTES_MAX: usize = 64;

/// Maximum length of a path in spans, in characters.
const PATH_CHARS_MAX: usize = 512;

/// Interval at which measured times are sorted into buckets.
const TIDY_EVERY: Duration = Duration::from_secs(5);

/// The process's metrics, installed at the first call.
pub(crate) fn metrics_handle() -> &'static PrometheusHandle {
    static HANDLE: OnceLock<PrometheusHandle> = OnceLock::new();
    HANDLE.get_or_init(|| {
        let probability = Matcher::Full("palpate_feedback_probability".to_owned());
        let builder = PrometheusBuilder::new()
            .set_buckets(&DURATION_BUCKETS)
            .and_then(|builder| builder.set_buckets_for_metric(probability, &SHARE_BUCKETS))
            .expect("the lists of buckets are not empty");
        let recorder = builder.build_recorder();
        let handle = recorder.handle();
        if metrics::set_global_recorder(recorder).is_err() {
            tracing::warn!("Another metrics recorder is installed: /metrics stays empty");
        }
        figures::register();
        handle
    })
}

/// Sorts measurements into their buckets periodically, until the server stops: otherwise
/// every time of every request would stay in memory until the next scrape.
pub(crate) async fn tidy(mut stopping: watch::Receiver<bool>) {
    while pause(TIDY_EVERY, &mut stopping).await {
        metrics_handle().run_upkeep();
    }
}

/// Assigns an id to the request, times, logs and counts it, and gives an error its body.
pub(crate) async fn observe(mut request: Request, next: Next) -> Response {
    let id = request_id(&request);
    let header = HeaderValue::from_str(&id).expect("request ids are visible ASCII");
    request.headers_mut().insert(REQUEST_ID, header.clone());
    let path = redacted(request.uri().path()).into_owned();
    let method = known(request.method());
    let matched = request.extensions().get::<MatchedPath>();
    let route = matched.map_or("(none)", MatchedPath::as_str).to_owned();
    let shown: String = path.chars().take(PATH_CHARS_MAX).collect();
    let span = tracing::info_span!(
        "request", otel.kind = "server", otel.name = format!("{method} {route}"),
        otel.status_code = tracing::field::Empty, request_id = %id, method, path = shown, route,
        status = tracing::field::Empty,
    );
    #[cfg(feature = "otlp")]
    join_trace(&span, request.headers());
    let start = Instant::now();
    let response = next.run(request).instrument(span.clone()).await;
    let mut response = problem::body::finish(response, &path, &id);
    response.headers_mut().insert(REQUEST_ID, header);
    let status = response.status().as_u16();
    span.record("status", status);
    if response.status().is_server_error() {
        span.record("otel.status_code", "ERROR");
    }
    let elapsed = start.elapsed().as_secs_f64();
    span.in_scope(|| tracing::debug!(status, elapsed_s = elapsed, "Answered {status}"));
    let labels = [("method", method.to_owned()), ("route", route), ("status", status.to_string())];
    metrics::counter!("palpate_http_requests_total", &labels).increment(1);
    metrics::histogram!("palpate_http_request_seconds", &labels[..2]).record(elapsed);
    response
}

/// A method for labels and spans, from a closed set: callers may invent methods, and a metric
/// keeps every value of a label for ever.
fn known(method: &Method) -> &'static str {
    const KNOWN: [&str; 7] = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"];
    KNOWN.into_iter().find(|known| *known == method.as_str()).unwrap_or("(other)")
}

/// Makes the span a part of the caller's trace (W3C trace context), where the headers name one.
#[cfg(feature = "otlp")]
fn join_trace(span: &tracing::Span, headers: &axum::http::HeaderMap) {
    use tracing_opentelemetry::OpenTelemetrySpanExt as _;

    let caller = opentelemetry::global::get_text_map_propagator(|propagator| {
        propagator.extract(&opentelemetry_http::HeaderExtractor(headers))
    });
    // Fails without a subscriber of spans.
    let _ = span.set_parent(caller);
}

/// The client's own id if it is fit for headers and logs, otherwise a new one.
fn request_id(request: &Request) -> String {
    let given = request.headers().get(REQUEST_ID).and_then(|value| value.to_str().ok());
    let is_fit = |id: &&str| {
        (1..=REQUEST_ID_BYTES_MAX).contains(&id.len())
            && id.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.:".contains(&byte))
    };
    given.filter(is_fit).map_or_else(|| Uuid::now_v7().to_string(), str::to_owned)
}
