//! `palpate serve`: the service, until Ctrl-C or a supervisor's SIGTERM.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use palpate_server::{Config, Server};
use serde_json::json;

use crate::args::DEFAULT_LISTEN;
use crate::output::Output;

/// Arguments of `palpate serve`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate serve\n  \
    palpate serve --data /var/lib/palpate --listen 127.0.0.1:7411")]
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

/// Serves until told to stop.
pub(crate) async fn run(args: ServeArgs, output: Output) -> anyhow::Result<()> {
    let ServeArgs { data, listen, insecure_bind, model_memory_mb, migrate, disk_reserve_mb } = args;
    let disk_reserve_bytes = disk_reserve_mb << 20;
    let model_memory_bytes_max = model_memory_mb * 1_000_000;
    let config = Config {
        listen,
        insecure_bind,
        model_memory_bytes_max,
        migrate,
        disk_reserve_bytes,
        ..Config::new(&data)
    };
    let server = Server::start(config).await?;
    let address = format!("http://{}", server.local_addr());
    let started = json!({ "server": address, "docs": format!("{address}/docs"), "data": data });
    output.answer(&started, |_| {
        let data = data.display();
        format!("serving {address}, documentation at {address}/docs, data in {data}; Ctrl-C stops")
    })?;
    let stopped = until_told_to_stop().await;
    // A second Ctrl-C does not wait for what is under way.
    tokio::select! {
        () = server.shutdown() => {}
        _ = tokio::signal::ctrl_c() => {}
    }
    stopped
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
