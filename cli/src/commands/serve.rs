//! `palpate serve`: the service, until Ctrl-C or a supervisor's SIGTERM.

use std::io::IsTerminal as _;
use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;
use clap::{Args, ValueEnum};
use palpate_server::tls::TlsFiles;
use palpate_server::{Access, Config, Server};
use palpate_store::audit::RingSizes;
use palpate_store::private;
use serde_json::json;

use crate::admin_key::AdminKeyFile;
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
    /// With --insecure-bind, a name that this machine has in the network; may be given several
    /// times. Requests for other names are refused, addresses are always taken.
    #[arg(
        long = "host-name",
        env = "PALPATE_HOST_NAME",
        value_name = "NAME",
        value_delimiter = ','
    )]
    host_names: Vec<String>,
    /// Whether requests need an API key: `auto` as soon as one is stored, `keys` always (the
    /// first admin's key is made), `open` never.
    #[arg(long, env = "PALPATE_ACCESS", value_name = "HOW", default_value = "auto")]
    access: AccessChoice,
    /// Make one more admin's key, for those who have lost theirs.
    #[arg(long)]
    new_admin_key: bool,
    /// Write an admin's key that is made at the start to this file, which only its owner may
    /// read [default: printed on a terminal, else DIR/admin.key].
    #[arg(long, env = "PALPATE_ADMIN_KEY_FILE", value_name = "FILE")]
    admin_key_file: Option<PathBuf>,
    /// Let everybody read /metrics, also without a key.
    #[arg(long, env = "PALPATE_OPEN_METRICS")]
    open_metrics: bool,
    /// Speak TLS with this certificate, a PEM file with the chain up to the authority's.
    #[arg(long, env = "PALPATE_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The certificate's private key, a PEM file.
    #[arg(long, env = "PALPATE_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Send a span of every request to the collector at this address, by OTLP over HTTP, such as
    /// http://localhost:4318.
    #[arg(long, env = "OTEL_EXPORTER_OTLP_ENDPOINT", value_name = "URL")]
    pub(crate) otlp_endpoint: Option<String>,
    /// Let pages of this origin use the API from a browser; may be given several times.
    #[arg(
        long = "cors-origin",
        env = "PALPATE_CORS_ORIGIN",
        value_name = "ORIGIN",
        value_delimiter = ','
    )]
    cors_origins: Vec<String>,
    /// How many entries of what changed something the audit log keeps; older ones go.
    #[arg(
        long,
        env = "PALPATE_AUDIT_ENTRIES",
        value_name = "N",
        default_value_t = 100_000,
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    audit_entries: u64,
    /// How many entries it keeps of what was refused to holders of keys, or failed.
    #[arg(
        long,
        env = "PALPATE_AUDIT_REFUSED",
        value_name = "N",
        default_value_t = 20_000,
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    audit_refused: u64,
    /// How many entries it keeps of what callers without a key tried.
    #[arg(
        long,
        env = "PALPATE_AUDIT_STRANGERS",
        value_name = "N",
        default_value_t = 10_000,
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    audit_strangers: u64,
    /// How many changes of one key may fail within a minute; after that it has to wait (429).
    #[arg(long, env = "PALPATE_FAILED_CHANGES", value_name = "N", default_value = "300")]
    failed_changes: NonZeroU32,
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
    /// Memory for the beliefs of sessions, in MB; those that were not used for longest are
    /// rebuilt from their readings when they are needed again.
    #[arg(
        long,
        env = "PALPATE_BELIEF_MEMORY_MB",
        value_name = "MB",
        default_value_t = 500,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    belief_memory_mb: u64,
    /// Memory for the bodies of all requests under way, in MB; what finds no room is told to
    /// come back (503). A mesh of 64 MB must fit.
    #[arg(
        long,
        env = "PALPATE_BODY_MEMORY_MB",
        value_name = "MB",
        default_value_t = 256,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    body_memory_mb: u64,
    /// How many sessions may be open at once; one more is refused (429).
    #[arg(
        long,
        env = "PALPATE_SESSIONS_OPEN",
        value_name = "N",
        default_value_t = 10_000,
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    sessions_open: u64,
    /// Seconds without a new reading after which sessions expire that do not say it themselves;
    /// 0 is never.
    #[arg(long, env = "PALPATE_SESSION_TTL_S", value_name = "S", default_value_t = 86_400)]
    session_ttl_s: u64,
    /// Seconds after their end in which sessions are deleted, with their readings; without it they
    /// are kept until somebody deletes them.
    #[arg(
        long,
        env = "PALPATE_KEEP_SESSIONS_S",
        value_name = "S",
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    keep_sessions_s: Option<u64>,
    /// Memory for answers that are not read yet, in MB; a request whose answer finds no room is
    /// told to come back (503).
    #[arg(
        long,
        env = "PALPATE_ANSWER_MEMORY_MB",
        value_name = "MB",
        default_value_t = 256,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000_000)
    )]
    answer_memory_mb: u64,
    /// How many connections may be open at once; fewer where the system allows fewer open files.
    /// When all are taken, health checks alone are answered.
    #[arg(
        long,
        env = "PALPATE_CONNECTIONS",
        value_name = "N",
        default_value_t = 4096,
        value_parser = clap::value_parser!(u32).range(1..=1_000_000)
    )]
    connections: u32,
    /// How many requests a second each client may make, which is a key's holder, or an address
    /// where nobody is asked for a key; more are refused (429). Without it only the bounds on
    /// all clients together count.
    #[arg(long, env = "PALPATE_RATE", value_name = "N")]
    rate: Option<NonZeroU32>,
    /// How many requests may be under way at once; more are told to come back (503) [default: 128
    /// for each core].
    #[arg(
        long,
        env = "PALPATE_REQUESTS",
        value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    requests: Option<u64>,
    /// Memory for pages of the database, in MB.
    #[arg(
        long,
        env = "PALPATE_STORE_CACHE_MB",
        value_name = "MB",
        default_value_t = 64,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    store_cache_mb: u64,
    /// How many pieces of computing may wait for a thread; more are told to come back (503).
    #[arg(
        long,
        env = "PALPATE_COMPUTE_QUEUE",
        value_name = "N",
        default_value_t = 256,
        value_parser = clap::value_parser!(u64).range(0..=1_000_000)
    )]
    compute_queue: u64,
    /// How long one training may take, in seconds; then it fails, and the next one begins.
    #[arg(
        long,
        env = "PALPATE_TRAINING_MAX_S",
        value_name = "S",
        default_value_t = 86_400,
        value_parser = clap::value_parser!(u64).range(1..=31_536_000)
    )]
    training_max_s: u64,
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
    /// Room on the disk beyond 1.5 times the live data at which it is compacted by itself, in MB.
    #[arg(
        long,
        env = "PALPATE_STORE_SLACK_MB",
        value_name = "MB",
        default_value_t = 32,
        value_parser = clap::value_parser!(u64).range(0..=1_000_000_000)
    )]
    store_slack_mb: u64,
    /// How much stored data one API key may hold, in MB: sessions, readings, objects, versions and
    /// what else it wrote; more is refused (409) until something of it is removed. 0 is no bound.
    #[arg(
        long,
        env = "PALPATE_STORE_QUOTA_MB",
        value_name = "MB",
        default_value_t = 10_000,
        value_parser = clap::value_parser!(u64).range(0..=1_000_000_000)
    )]
    store_quota_mb: u64,
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

/// How often to look whether the files of the certificate changed.
const CERTIFICATE_LOOK_EVERY: Duration = Duration::from_secs(30);
const ADMIN_KEY: &str = "An admin's key was made. It is shown this once; keep it, and make others \
    with it:\n`PALPATE_KEY=… palpate keys create NAME --role robot`";
/// File in the data folder that gets the admin's key when standard output is no terminal.
const ADMIN_KEY_FILE: &str = "admin.key";

/// Serves until told to stop.
pub(crate) async fn run(args: ServeArgs, output: Output) -> anyhow::Result<()> {
    let data = args.data.clone();
    let key_file = key_file(&args)?;
    let mut server = Server::start(config(args)).await?;
    let address = server.address();
    let mut started = json!({ "server": address, "docs": format!("{address}/docs"), "data": data });
    let admin_key = server.take_admin_key();
    let (mut written, mut shown) = (None, None);
    match (key_file, admin_key) {
        (Some(file), Some(key)) => {
            let path = file.write(&key)?;
            started["admin_key_file"] = json!(path);
            written = Some(path);
        }
        (None, Some(key)) => {
            started["admin_key"] = json!(key);
            shown = Some(key);
        }
        (_, None) => {}
    }
    output.answer(&started, |_| {
        let data = data.display();
        let serving = format!(
            "serving {address}, documentation at {address}/docs, data in {data}; Ctrl-C stops"
        );
        match (&shown, &written) {
            (Some(key), _) => format!("{serving}\n\n{ADMIN_KEY}\n\n{key}\n"),
            (None, Some(file)) => {
                format!("{serving}\n\nAn admin's key was made and written to {}", file.display())
            }
            (None, None) => serving,
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

/// Where an admin's key goes that is made; `None`: to the terminal that the answer goes to.
fn key_file(args: &ServeArgs) -> anyhow::Result<Option<AdminKeyFile>> {
    let path = match &args.admin_key_file {
        Some(path) => path.clone(),
        None if std::io::stdout().is_terminal() => return Ok(None),
        None => {
            private::create_folder(&args.data)
                .with_context(|| format!("cannot make {}", args.data.display()))?;
            args.data.join(ADMIN_KEY_FILE)
        }
    };
    // Without access by keys no key is made.
    match args.access {
        AccessChoice::Open if !args.new_admin_key => Ok(None),
        _ => AdminKeyFile::prepare(&path).map(Some),
    }
}

/// The settings that the arguments are.
fn config(args: ServeArgs) -> Config {
    let access = match args.access {
        AccessChoice::Auto => Access::Auto,
        AccessChoice::Keys => Access::Keys,
        AccessChoice::Open => Access::Open,
    };
    let tls = args.tls_cert.zip(args.tls_key);
    let usual = Config::new(args.data);
    Config {
        listen: args.listen,
        insecure_bind: args.insecure_bind,
        host_names: args.host_names,
        access,
        new_admin_key: args.new_admin_key,
        open_metrics: args.open_metrics,
        tls: tls.map(|(certificate, key)| TlsFiles {
            certificate,
            key,
            look_every: CERTIFICATE_LOOK_EVERY,
        }),
        cors_origins: args.cors_origins,
        audit_entries_max: RingSizes {
            changes: args.audit_entries,
            refused: args.audit_refused,
            strangers: args.audit_strangers,
        },
        failed_changes_per_minute: args.failed_changes,
        model_memory_bytes_max: args.model_memory_mb * 1_000_000,
        belief_memory_bytes_max: args.belief_memory_mb as usize * 1_000_000,
        bodies_bytes_max: (args.body_memory_mb as usize) << 20,
        answers_bytes_max: (args.answer_memory_mb as usize) << 20,
        connections_max: args.connections as usize,
        sessions_open_max: args.sessions_open as usize,
        session_time_to_live: Duration::from_secs(args.session_ttl_s),
        session_kept: args.keep_sessions_s.map(Duration::from_secs),
        rate_per_second: args.rate,
        requests_max: args.requests.map_or(usual.requests_max, |requests| requests as usize),
        store_cache_bytes: args.store_cache_mb << 20,
        compute_queue_max: args.compute_queue as usize,
        training_time_max: Duration::from_secs(args.training_max_s),
        migrate: args.migrate,
        disk_reserve_bytes: args.disk_reserve_mb << 20,
        store_slack_bytes: args.store_slack_mb << 20,
        store_quota_bytes: Some(args.store_quota_mb * 1_000_000).filter(|bytes| *bytes > 0),
        ..usual
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
