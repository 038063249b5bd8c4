//! `palpate serve`: the service, until Ctrl-C or SIGTERM.

mod settings;

use std::io::{ErrorKind, IsTerminal as _};
use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;
use clap::{Args, ValueEnum};
use palpate_server::{Config, Server, StartError};
use palpate_store::private;
use serde_json::json;

use crate::admin_key::{AdminKeyFile, chosen};
use crate::forwarder::{self, ForwardArgs};
use crate::listen::{DEFAULT_LISTEN, listen_address};
use crate::output::Output;
use crate::supervisor::{self, Notice, Signals};

/// Arguments of `palpate serve`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  palpate serve\n  \
    palpate serve --data /var/lib/palpate --listen 127.0.0.1:7411")]
#[expect(clippy::struct_excessive_bools, reason = "flags, each for itself")]
pub(crate) struct ServeArgs {
    /// Folder of the database; created if missing.
    #[arg(long, env = "PALPATE_DATA", value_name = "DIR", default_value = "palpate-data")]
    data: PathBuf,
    #[command(flatten)]
    store: crate::cluster::StoreArgs,
    #[command(flatten)]
    forward: ForwardArgs,
    /// Address to listen on, or a port of this machine alone; port 0 takes any free port.
    #[arg(long, env = "PALPATE_LISTEN", value_name = "ADDR", default_value = DEFAULT_LISTEN,
        value_parser = listen_address)]
    listen: SocketAddr,
    /// Allow an address that other machines can reach although the server requires no keys.
    #[arg(long)]
    insecure_bind: bool,
    /// With --insecure-bind: a network name of this machine, repeatable. Requests for other names
    /// are refused; addresses are always accepted.
    #[arg(
        long = "host-name",
        env = "PALPATE_HOST_NAME",
        value_name = "NAME",
        value_delimiter = ','
    )]
    host_names: Vec<String>,
    /// When requests need an API key: `auto` if a key is stored, `keys` always (the first admin key
    /// is created), `open` never.
    #[arg(long, env = "PALPATE_ACCESS", value_name = "HOW", default_value = "auto")]
    access: AccessChoice,
    /// Create one more admin key, if the others are lost.
    #[arg(long)]
    new_admin_key: bool,
    /// File for an admin key created at the start, readable only by its owner [default: printed on
    /// a terminal, else DIR/admin.key].
    #[arg(long, env = "PALPATE_ADMIN_KEY_FILE", value_name = "FILE")]
    admin_key_file: Option<PathBuf>,
    /// File with the first admin key, if you choose it yourself; requests then need keys. Its secret
    /// must be random: `palpate_`, 32 hexadecimal digits, `_`, 64 hexadecimal digits. Not used once
    /// there is a valid admin key [default: a key is created].
    #[arg(long, env = "PALPATE_FIRST_ADMIN_KEY_FILE", value_name = "FILE")]
    first_admin_key_file: Option<PathBuf>,
    /// Serve /metrics without a key.
    #[arg(long, env = "PALPATE_OPEN_METRICS")]
    open_metrics: bool,
    /// Allow webhooks to this machine and to private networks, and without encryption (http).
    #[arg(long, env = "PALPATE_WEBHOOK_ALLOW_PRIVATE")]
    webhook_allow_private: bool,
    /// TLS certificate: a PEM file with the chain up to the authority.
    #[arg(long, env = "PALPATE_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Private key of the TLS certificate: a PEM file.
    #[arg(long, env = "PALPATE_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// OTLP/HTTP collector to send a span of every request to, such as http://localhost:4318.
    /// Needs a build with `--features otlp`.
    #[arg(long, env = "OTEL_EXPORTER_OTLP_ENDPOINT", value_name = "URL")]
    pub(crate) otlp_endpoint: Option<String>,
    /// Allow browser pages of this origin to use the API; repeatable.
    #[arg(
        long = "cors-origin",
        env = "PALPATE_CORS_ORIGIN",
        value_name = "ORIGIN",
        value_delimiter = ','
    )]
    cors_origins: Vec<String>,
    /// Number of audit log entries to keep for changes; the oldest are dropped.
    #[arg(
        long,
        env = "PALPATE_AUDIT_ENTRIES",
        value_name = "N",
        default_value_t = 100_000,
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    audit_entries: u64,
    /// Number of audit log entries to keep for refused and failed requests of key holders.
    #[arg(
        long,
        env = "PALPATE_AUDIT_REFUSED",
        value_name = "N",
        default_value_t = 20_000,
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    audit_refused: u64,
    /// Number of audit log entries to keep for refused and failed requests without a key.
    #[arg(
        long,
        env = "PALPATE_AUDIT_STRANGERS",
        value_name = "N",
        default_value_t = 10_000,
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    audit_strangers: u64,
    /// Number of changes per key that may fail within a minute. Beyond it, the key has to wait
    /// (429).
    #[arg(long, env = "PALPATE_FAILED_CHANGES", value_name = "N", default_value = "300")]
    failed_changes: NonZeroU32,
    /// Memory for models, in MB. Of each version, only the parts that sessions use are loaded, and
    /// the least recently used are unloaded. A model larger than this is refused (503).
    #[arg(
        long,
        env = "PALPATE_MODEL_MEMORY_MB",
        value_name = "MB",
        default_value_t = 1000,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000_000)
    )]
    model_memory_mb: u64,
    /// Memory for the beliefs of sessions, in MB. The least recently used are dropped and rebuilt
    /// from their readings when needed.
    #[arg(
        long,
        env = "PALPATE_BELIEF_MEMORY_MB",
        value_name = "MB",
        default_value_t = 500,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    belief_memory_mb: u64,
    /// Memory for the bodies of all requests in progress and the values in them, in MB. A request
    /// that does not fit is refused (503). One takes at most 168 MB, and one client three quarters
    /// of the whole: with less than 224 MB, the largest requests are always refused.
    #[arg(
        long,
        env = "PALPATE_BODY_MEMORY_MB",
        value_name = "MB",
        default_value_t = 256,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    body_memory_mb: u64,
    /// Maximum number of open sessions; one more is refused (429).
    #[arg(
        long,
        env = "PALPATE_SESSIONS_OPEN",
        value_name = "N",
        default_value_t = 10_000,
        value_parser = clap::value_parser!(u64).range(1..=10_000_000)
    )]
    sessions_open: u64,
    /// Seconds without a new reading after which a session expires, unless it sets its own limit; 0
    /// is never.
    #[arg(long, env = "PALPATE_SESSION_TTL_S", value_name = "S", default_value_t = 86_400)]
    session_ttl_s: u64,
    /// Seconds after its end at which a session is deleted with its readings [default: never].
    #[arg(
        long,
        env = "PALPATE_KEEP_SESSIONS_S",
        value_name = "S",
        value_parser = clap::value_parser!(u64).range(1..)
    )]
    keep_sessions_s: Option<u64>,
    /// Memory for answers not yet read by clients, in MB. A request whose answer does not fit is
    /// refused (503).
    #[arg(
        long,
        env = "PALPATE_ANSWER_MEMORY_MB",
        value_name = "MB",
        default_value_t = 256,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000_000)
    )]
    answer_memory_mb: u64,
    /// Maximum number of open connections, less if the system allows fewer open files. At the
    /// maximum, only health checks are answered.
    #[arg(
        long,
        env = "PALPATE_CONNECTIONS",
        value_name = "N",
        default_value_t = 4096,
        value_parser = clap::value_parser!(u32).range(1..=1_000_000)
    )]
    connections: u32,
    /// Maximum requests per second of each client (the holder of a key, or an address on a server
    /// without keys); more are refused (429) [default: only the limits on all clients together].
    #[arg(long, env = "PALPATE_RATE", value_name = "N")]
    rate: Option<NonZeroU32>,
    /// Maximum number of requests in progress; more are refused (503) [default: 128 per core].
    #[arg(
        long,
        env = "PALPATE_REQUESTS",
        value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    requests: Option<u64>,
    /// Memory for the database's page cache, in MB.
    #[arg(
        long,
        env = "PALPATE_STORE_CACHE_MB",
        value_name = "MB",
        default_value_t = 64,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    store_cache_mb: u64,
    /// Maximum number of computations that wait for a thread; more are refused (503).
    #[arg(
        long,
        env = "PALPATE_COMPUTE_QUEUE",
        value_name = "N",
        default_value_t = 256,
        value_parser = clap::value_parser!(u64).range(0..=1_000_000)
    )]
    compute_queue: u64,
    /// Seconds that one training may take; then it fails, and the next one starts.
    #[arg(
        long,
        env = "PALPATE_TRAINING_MAX_S",
        value_name = "S",
        default_value_t = 86_400,
        value_parser = clap::value_parser!(u64).range(1..=31_536_000)
    )]
    training_max_s: u64,
    /// Memory that one training may take, in MB, as estimated before it starts; a larger one is
    /// refused.
    #[arg(
        long,
        env = "PALPATE_TRAINING_MEMORY_MB",
        value_name = "MB",
        default_value_t = 2000,
        value_parser = clap::value_parser!(u64).range(1..=1_000_000)
    )]
    training_memory_mb: u64,
    /// Migrate stored data of an older layout at the start; take a snapshot or a copy first.
    /// Without it, such data is refused.
    #[arg(long, env = "PALPATE_MIGRATE")]
    migrate: bool,
    /// Disk space to keep free, in MB. With less, writes are refused (507) and reads still work.
    #[arg(
        long,
        env = "PALPATE_DISK_RESERVE_MB",
        value_name = "MB",
        default_value_t = 64,
        value_parser = clap::value_parser!(u64).range(0..=1_000_000_000)
    )]
    disk_reserve_mb: u64,
    /// Garbage beyond 1.5 times the live data at which the database compacts itself, in MB.
    #[arg(
        long,
        env = "PALPATE_STORE_SLACK_MB",
        value_name = "MB",
        default_value_t = 32,
        value_parser = clap::value_parser!(u64).range(0..=1_000_000_000)
    )]
    store_slack_mb: u64,
    /// Stored data that one API key may hold, in MB: its sessions, readings, objects and versions.
    /// More is refused (409) until some of it is removed. 0 is no bound.
    #[arg(
        long,
        env = "PALPATE_STORE_QUOTA_MB",
        value_name = "MB",
        default_value_t = 10_000,
        value_parser = clap::value_parser!(u64).range(0..=1_000_000_000)
    )]
    store_quota_mb: u64,
}

/// Condition under which requests need an API key.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AccessChoice {
    /// If a key is stored.
    Auto,
    /// Always.
    Keys,
    /// Never.
    Open,
}

/// Interval at which the certificate files are checked for changes.
const CERTIFICATE_LOOK_EVERY: Duration = Duration::from_secs(30);
const ADMIN_KEY: &str = "An admin's key was made. It is shown this once; keep it, and make others \
    with it:\n`PALPATE_KEY=… palpate keys create NAME --role robot`";
/// File in the data folder for the admin key if standard output is not a terminal.
const ADMIN_KEY_FILE: &str = "admin.key";

/// Serves until told to stop.
pub(crate) async fn run(args: ServeArgs, output: Output) -> anyhow::Result<()> {
    let cluster = args.store.options(&args.data)?;
    let data = crate::cluster::place(cluster.as_ref(), &args.data);
    let first_admin_key = args.first_admin_key_file.as_deref().map(chosen).transpose()?;
    let (forward, central) = args.forward.prepared()?.unzip();
    anyhow::ensure!(
        forward.is_none() || cluster.is_none(),
        "a cell stores in a folder: `forward_to` excludes `store`"
    );
    let config = settings::config(args.clone());
    let config = Config { first_admin_key, cluster, forward: forward.clone(), ..config };
    // Before anything is written: a server that may not start leaves no folder behind.
    palpate_server::check(&config)?;
    let key_file = key_file(&args)?;
    let mut signals = Signals::listen()?;
    let server = tokio::select! {
        server = Server::start(config) => server,
        () = signals.told_to_stop() => return Ok(()),
    };
    let mut server = server.map_err(|error| match error {
        StartError::Listen { ref source, .. } if source.kind() == ErrorKind::AddrInUse => {
            anyhow::Error::from(error)
                .context("another program listens there: choose a port with --listen")
        }
        error => error.into(),
    })?;
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
        let serving = format!(
            "serving {address}, documentation at {address}/docs, data in {data}; Ctrl-C stops"
        );
        match (&shown, &written) {
            (Some(key), _) => format!("{serving}\n\n{ADMIN_KEY}\n\n{key}\n"),
            (None, Some(file)) => {
                format!("{serving}\n\nAn admin key was created and written to {}", file.display())
            }
            (None, None) => serving,
        }
    })?;
    supervisor::tell(Notice::Ready);
    let (scheme, listening) = (server.scheme(), server.local_addr());
    let watching = tokio::spawn(async move { supervisor::watch(scheme, listening).await });
    let outbox = server.take_outbox().zip(central).zip(forward);
    let forwarding = outbox
        .map(|((outbox, central), forward)| tokio::spawn(forwarder::run(outbox, central, forward)));
    signals.told_to_stop().await;
    supervisor::tell(Notice::Stopping);
    if let Some(forwarding) = forwarding {
        forwarding.abort();
    }
    // A second Ctrl-C does not wait for requests in progress.
    tokio::select! {
        () = server.shutdown() => {}
        _ = tokio::signal::ctrl_c() => {}
    }
    watching.abort();
    Ok(())
}

/// The file for a new admin key; `None` for the terminal.
fn key_file(args: &ServeArgs) -> anyhow::Result<Option<AdminKeyFile>> {
    // Without access by keys, or with a chosen first key, no key is created.
    let is_given = args.first_admin_key_file.is_some();
    if !args.new_admin_key && (is_given || matches!(args.access, AccessChoice::Open)) {
        return Ok(None);
    }
    let path = match &args.admin_key_file {
        Some(path) => path.clone(),
        None if std::io::stdout().is_terminal() => return Ok(None),
        None => {
            private::create_folder(&args.data)
                .with_context(|| format!("cannot make {}", args.data.display()))?;
            args.data.join(ADMIN_KEY_FILE)
        }
    };
    let file = AdminKeyFile::prepare(&path);
    let file = file.with_context(|| format!("cannot write to the folder {}", args.data.display()));
    file.map(Some)
}
