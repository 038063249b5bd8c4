//! A server that an experiment starts for itself, on a temporary folder and a free port.

use std::path::Path;
use std::time::Instant;

use palpate_client::{Client, ClientOptions};
use palpate_server::{Config, NatsOptions, Server};
use tempfile::TempDir;

/// A running server and a client of it.
pub(crate) struct OwnServer {
    folder: TempDir,
    server: Server,
    pub(crate) client: Client,
}

impl OwnServer {
    /// Starts a server with an empty store.
    pub(crate) async fn start() -> anyhow::Result<Self> {
        let folder = folder()?;
        let (server, client) = serve(folder.path(), None).await?;
        Ok(Self { folder, server, client })
    }

    /// Starts a server that shares the store of a NATS cluster, `nats://HOST:PORT/STREAM`.
    pub(crate) async fn start_on(cluster: &str) -> anyhow::Result<Self> {
        Self::start_with(cluster, |options| options).await
    }

    /// As [`Self::start_on`], with changed options.
    pub(crate) async fn start_with(
        cluster: &str,
        change: impl FnOnce(NatsOptions) -> NatsOptions,
    ) -> anyhow::Result<Self> {
        let folder = folder()?;
        let options = NatsOptions::parse(cluster, folder.path().join("spool"))
            .map_err(|fault| anyhow::anyhow!("{cluster}: {fault}"))?;
        let options = change(NatsOptions { is_shared: true, ..options });
        let (server, client) = serve(folder.path(), Some(options)).await?;
        Ok(Self { folder, server, client })
    }

    /// Stops it and starts it again on the same folder. Also returns the seconds until it listens.
    pub(crate) async fn restart(self) -> anyhow::Result<(Self, f64)> {
        let Self { folder, server, .. } = self;
        server.shutdown().await;
        let begun = Instant::now();
        let (server, client) = serve(folder.path(), None).await?;
        Ok((Self { folder, server, client }, begun.elapsed().as_secs_f64()))
    }

    /// Its address, as clients need it.
    pub(crate) fn address(&self) -> String {
        format!("http://{}", self.server.local_addr())
    }

    /// Stops it and removes its folder.
    pub(crate) async fn stop(self) {
        self.server.shutdown().await;
    }
}

fn folder() -> anyhow::Result<TempDir> {
    Ok(tempfile::Builder::new().prefix("palpate-experiment-").tempdir()?)
}

async fn serve(folder: &Path, cluster: Option<NatsOptions>) -> anyhow::Result<(Server, Client)> {
    let any_port = std::net::SocketAddr::from(([127, 0, 0, 1], 0));
    let config = Config { listen: any_port, cluster, ..Config::new(folder.join("data")) };
    let server = Server::start(config).await?;
    let address = format!("http://{}", server.local_addr());
    Ok((server, Client::with_options(&address, ClientOptions::default())?))
}

/// Runs asynchronous work to its end; fails at Ctrl-C.
pub(crate) fn block_on<T>(work: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    tokio::runtime::Runtime::new()?.block_on(async {
        tokio::select! {
            outcome = work => outcome,
            _ = tokio::signal::ctrl_c() => anyhow::bail!("interrupted"),
        }
    })
}
