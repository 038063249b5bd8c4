//! Logs to standard error, and on request spans to a collector.

use anyhow::{Context as _, ensure};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::{Layer, layer::SubscriberExt, util::SubscriberInitExt};

use crate::args::{Cli, Command, LogFormat};
use crate::progress;

/// Installs logging to standard error: what `RUST_LOG` selects, else warnings, and with `serve` or
/// `--verbose` also normal events. Spans go to the collector that `serve` names, if any.
pub(crate) fn install(cli: &Cli) -> anyhow::Result<()> {
    let talkative = cli.verbose || matches!(cli.command, Command::Serve(_));
    let default = if talkative { "info" } else { "warn" };
    let filter = filter(std::env::var("RUST_LOG").ok(), default)?;
    let log = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    let log = match cli.log_format {
        LogFormat::Human => log.with_ansi(progress::is_watched()).boxed(),
        LogFormat::Json => log.json().flatten_event(true).boxed(),
    };
    let collector = match &cli.command {
        Command::Serve(args) => args.otlp_endpoint.as_deref(),
        _ => None,
    };
    check_collector(collector, cfg!(feature = "otlp"))?;
    let subscriber = tracing_subscriber::registry().with(log.with_filter(filter));
    #[cfg(feature = "otlp")]
    let subscriber = subscriber.with(collector.map(crate::spans::layer).transpose()?);
    subscriber.init();
    Ok(())
}

/// The log filter: `RUST_LOG`, such as `warn,palpate_server=debug`, otherwise the default.
fn filter(asked: Option<String>, default: &str) -> anyhow::Result<Targets> {
    let asked = asked.filter(|asked| !asked.is_empty());
    asked.as_deref().unwrap_or(default).parse().context("RUST_LOG is no list of levels")
}

/// Refuses a collector in a build that cannot send spans.
fn check_collector(collector: Option<&str>, is_built_in: bool) -> anyhow::Result<()> {
    ensure!(
        is_built_in || collector.is_none(),
        "--otlp-endpoint (OTEL_EXPORTER_OTLP_ENDPOINT) needs the feature `otlp`, which this \
         palpate was built without: build it with `--features otlp`"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rust_log_says_what_is_logged() {
        let asked = filter(Some("warn,palpate_server=debug".to_owned()), "info").unwrap();
        assert!(asked.would_enable("palpate_server::live", &tracing::Level::DEBUG));
        assert!(!asked.would_enable("hyper", &tracing::Level::INFO));
        let default = filter(Some(String::new()), "info").unwrap();
        assert!(default.would_enable("hyper", &tracing::Level::INFO));
        assert!(filter(Some("palpate=loudly".to_owned()), "info").is_err());
    }

    #[test]
    fn a_collector_is_refused_by_a_build_without_otlp() {
        let error = check_collector(Some("http://localhost:4318"), false).unwrap_err();
        assert!(error.to_string().contains("--features otlp"), "{error}");
        assert!(check_collector(None, false).is_ok());
        assert!(check_collector(Some("http://localhost:4318"), true).is_ok());
    }
}
