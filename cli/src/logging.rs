//! Logs to standard error, and on request traces to a collector.

use std::sync::OnceLock;

use anyhow::Context as _;
use opentelemetry::trace::TracerProvider as _;
use opentelemetry_otlp::{Protocol, SpanExporter, WithExportConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

use crate::args::{Cli, Command, LogFormat};
use crate::progress;

/// Exporter of spans, for the life of the process.
static SPANS: OnceLock<SdkTracerProvider> = OnceLock::new();

/// Installs logging to standard error: what `RUST_LOG` selects, else warnings, and with `serve` or
/// `--verbose` also normal events. Spans go to the collector that `serve` names, if any.
pub(crate) fn install(cli: &Cli) -> anyhow::Result<()> {
    let talkative = cli.verbose || matches!(cli.command, Command::Serve(_));
    let default = if talkative { "info" } else { "warn" };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    let log = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    let log = match cli.log_format {
        LogFormat::Human => log.with_ansi(progress::is_watched()).boxed(),
        LogFormat::Json => log.json().flatten_event(true).boxed(),
    };
    let collector = match &cli.command {
        Command::Serve(args) => args.otlp_endpoint.as_deref(),
        _ => None,
    };
    let spans = collector.map(provider).transpose()?;
    let spans = spans.map(|provider| {
        let tracer = provider.tracer("palpate");
        let layer = tracing_opentelemetry::layer().with_tracer(tracer);
        let _ = SPANS.set(provider);
        // Spans are sent regardless of the log level.
        layer.with_filter(EnvFilter::new("off,palpate_server=info"))
    });
    tracing_subscriber::registry().with(log.with_filter(filter)).with(spans).init();
    Ok(())
}

/// Sends the remaining spans, at the end of the process.
pub(crate) fn flush() {
    if let Some(spans) = SPANS.get()
        && let Err(error) = spans.shutdown()
    {
        eprintln!("some spans did not reach the collector: {error}");
    }
}

/// Exporter of spans by OTLP over HTTP.
fn provider(address: &str) -> anyhow::Result<SdkTracerProvider> {
    let endpoint = format!("{}/v1/traces", address.trim_end_matches('/'));
    // The exporter's client uses it for TLS and needs it even if the collector has no TLS.
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
