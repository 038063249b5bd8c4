//! `palpate serve`: the service, until Ctrl-C or a supervisor's SIGTERM.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use palpate_server::tls::TlsFiles;
use palpate_server::{Access, Config, Server};
use serde_json::json;

use crate::args::DEFAULT_LISTEN;
use crate::output::Output;

/// Arguments of `palpate serve`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate serve\n  \
    palpate serve --data /var/lib/palpate --listen 127.0.0.1:7411")]
#[expect(clippy::struct_excessive_bools, reason = "flags, each for itself")]
pub(crate) struct ServeArgs {
    /// The folder of the database; made if it does not exist.
    #[arg(long, env = "PALPATE_DATA", value_name = "DIR", default_value = "palpate-data")]
    data: PathBuf,
    /// Where to listen; port 0 takes any free one.
    #[arg(long, env = "PALPATE_LISTEN", value_name = "ADDR", default_value = DEFAULT_LISTEN)]
    listen: SocketAddr,
    /// Allow an address that other machines can reach, though nobody is asked for a key.
    #[arg(long)]
    insecure_bind: bool,
    /// Whether requests need an API key: `auto` as soon as one is stored, `keys` always (the
    /// first admin's key is made and printed), `open` never.
    #[arg(long, env = "PALPATE_ACCESS", value_name = "HOW", default_value = "auto")]
    access: AccessChoice,
    /// Make one more admin's key and print it, for those who have lost theirs.
    #[arg(long)]
    new_admin_key: bool,
    /// Let everybody read /metrics, also without a key.
    #[arg(long, env = "PALPATE_OPEN_METRICS")]
    open_metrics: bool,
    /// Speak TLS with this certificate, a PEM file with the chain up to the authority's.
    #[arg(long, env = "PALPATE_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The certificate's private key, a PEM file.
    #[arg(long, env = "PALPATE_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Let pages of this origin use the API from a browser; may be given several times.
    #[arg(
        long = "cors-origin",
        env = "PALPATE_CORS_ORIGIN",
        value_name = "ORIGIN",
        value_delimiter = ','
    )]
    cors_origins: Vec<String>,
    /// How many entries the audit log keeps; older ones go.
    #[arg(
        long,
        env = "PALPATE_AUDIT_ENTRIES",
        value_name = "N",
        default_value_t = 100_000,
        value_parser = clap::value_parser!(u64).range(1..=100_000_000)
    )]
    audit_entries: u64,
    /// Memory for the models that sessions recognise by, in MB. Of a version the part is loaded
    /// that a session's method needs; what was not used for longest leaves. A model that needs
    /// more by itself is refused (503).
    #[arg(
        long,
        env = "PALPATE_MODEL_MEMORY_MB",
        value_name = "MB",
        default_value_t = 1000,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000_000)
    )]
    model_memory_mb: u64,
    /// Bring stored data of an older layout to this version's; take a snapshot or a copy before.
    /// Without it such data is refused.
    #[arg(long, env = "PALPATE_MIGRATE")]
    migrate: bool,
    /// How much of the disk stays free, in MB: with less, writes are refused (507) and reading
    /// goes on.
    #[arg(
        long,
        env = "PALPATE_DISK_RESERVE_MB",
        value_name = "MB",
        default_value_t = 64,
        value_parser = clap::value_parser!(u64).range(0..=1_000_000_000)
    )]
    disk_reserve_mb: u64,
}

/// Whether requests need an API key.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AccessChoice {
    /// As soon as one is stored.
    Auto,
    /// Always.
    Keys,
    /// Never.
    Open,
}

const ADMIN_KEY: &str = "\nAn admin's key was made. It is shown this once; keep it, and make others \
    with it:\n`PALPATE_KEY=… palpate keys create NAME --role robot`";

/// Serves until told to stop.
pub(crate) async fn run(args: ServeArgs, output: Output) -> anyhow::Result<()> {
    let data = args.data.clone();
    let mut server = Server::start(config(args)).await?;
    let address = server.address();
    let mut started = json!({ "server": address, "docs": format!("{address}/docs"), "data": data });
    let admin_key = server.take_admin_key();
    if let Some(key) = &admin_key {
        started["admin_key"] = json!(key);
    }
    output.answer(&started, |_| {
        let data = data.display();
        let serving = format!(
            "serving {address}, documentation at {address}/docs, data in {data}; Ctrl-C stops"
        );
        match &admin_key {
            Some(key) => format!("{serving}\n{ADMIN_KEY}\n\n{key}\n"),
            None => serving,
        }
    })?;
    let stopped = until_told_to_stop().await;
    // A second Ctrl-C does not wait for what is under way.
    tokio::select! {
        () = server.shutdown() => {}
        _ = tokio::signal::ctrl_c() => {}
    }
    stopped
}

/// The settings that the arguments are.
fn config(args: ServeArgs) -> Config {
    let access = match args.access {
        AccessChoice::Auto => Access::Auto,
        AccessChoice::Keys => Access::Keys,
        AccessChoice::Open => Access::Open,
    };
    let tls = args.tls_cert.zip(args.tls_key);
    Config {
        listen: args.listen,
        insecure_bind: args.insecure_bind,
        access,
        new_admin_key: args.new_admin_key,
        open_metrics: args.open_metrics,
        tls: tls.map(|(certificate, key)| TlsFiles { certificate, key }),
        cors_origins: args.cors_origins,
        audit_entries_max: args.audit_entries,
        model_memory_bytes_max: args.model_memory_mb * 1_000_000,
        migrate: args.migrate,
        disk_reserve_bytes: args.disk_reserve_mb << 20,
        ..Config::new(args.data)
    }
}

/// Ctrl-C, or SIGTERM where there is such a thing.
#[cfg(unix)]
pub(crate) async fn until_told_to_stop() -> anyhow::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut terminate = signal(SignalKind::terminate())?;
    tokio::select! {
        interrupted = tokio::signal::ctrl_c() => interrupted?,
        _ = terminate.recv() => {}
    }
    Ok(())
}

/// Ctrl-C.
#[cfg(not(unix))]
pub(crate) async fn until_told_to_stop() -> anyhow::Result<()> {
    Ok(tokio::signal::ctrl_c().await?)
}
