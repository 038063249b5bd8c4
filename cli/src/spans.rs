//! Spans of requests, sent to a collector by OTLP over HTTP.

use std::sync::OnceLock;

use anyhow::Context as _;
use opentelemetry::trace::TracerProvider as _;
use opentelemetry_otlp::{Protocol, SpanExporter, WithExportConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing::Subscriber;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::registry::LookupSpan;

/// Provider of the spans, for the life of the process.
static SPANS: OnceLock<SdkTracerProvider> = OnceLock::new();

/// Sends the server's spans to the collector at this address, independently of the log's level.
pub(crate) fn layer<S>(address: &str) -> anyhow::Result<impl Layer<S>>
where
    S: Subscriber + for<'a> LookupSpan<'a>,
{
    let provider = provider(address)?;
    let layer = tracing_opentelemetry::layer().with_tracer(provider.tracer("palpate"));
    let _ = SPANS.set(provider);
    Ok(layer.with_filter(Targets::new().with_target("palpate_server", LevelFilter::INFO)))
}

/// Sends the remaining spans at the end of the process.
pub(crate) fn flush() {
    if let Some(spans) = SPANS.get()
        && let Err(error) = spans.shutdown()
    {
        eprintln!("some spans did not reach the collector: {error}");
    }
}

fn provider(address: &str) -> anyhow::Result<SdkTracerProvider> {
    let endpoint = format!("{}/v1/traces", address.trim_end_matches('/'));
    // The exporter's client uses it for TLS, and requires it even without TLS at the collector.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let exporter = SpanExporter::builder()
        .with_http()
        .with_protocol(Protocol::HttpBinary)
        .with_endpoint(&endpoint)
        .build()
        .with_context(|| format!("cannot send spans to {endpoint}"))?;
    opentelemetry::global::set_text_map_propagator(TraceContextPropagator::new());
    let resource = Resource::builder()
        .with_service_name("palpate")
        .with_attribute(opentelemetry::KeyValue::new("service.version", env!("CARGO_PKG_VERSION")))
        .build();
    Ok(SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build())
}
