//! A server in a process of its own, on a NATS cluster: its memory is that of one server.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use anyhow::Context as _;
use palpate_client::{Client, ClientOptions};
use serde_json::Value;
use tempfile::TempDir;

use super::DividedServers;

/// The metric of the surfaces in memory.
const SURFACE_BYTES: &str = "palpate_model_bytes{part=\"surface\"}";
/// Memory for models, in MB: more than any catalogue here takes.
const MODEL_MEMORY_MB: &str = "20000";

/// A running server; it is killed when it is dropped.
pub(super) struct ServerProcess {
    child: Child,
    pub(super) client: Client,
    _folder: TempDir,
}

impl ServerProcess {
    /// Starts a server on the cluster; it divides catalogues if there are `copies`.
    pub(super) async fn start(
        config: &DividedServers,
        copies: Option<u32>,
    ) -> anyhow::Result<Self> {
        let folder = tempfile::Builder::new().prefix("palpate-divided-").tempdir()?;
        let mut command = Command::new(&config.palpate);
        command.args(["serve", "--listen", "127.0.0.1:0", "--access", "open", "--json"]);
        command.args(["--store", &config.nats, "--store-shared"]);
        command.args(["--model-memory-mb", MODEL_MEMORY_MB]);
        command.arg("--data").arg(folder.path().join("data"));
        if let Some(copies) = copies {
            command.args(["--divide-copies", &copies.to_string(), "--divide-wait-ms", "60000"]);
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        let program = config.palpate.display();
        let mut child = command.spawn().with_context(|| format!("cannot start {program}"))?;
        let output = child.stdout.take().context("its output is piped")?;
        let reading = tokio::task::spawn_blocking(move || {
            let mut line = String::new();
            BufReader::new(output).read_line(&mut line).map(|_| line)
        });
        let line = reading.await??;
        let started: Value = serde_json::from_str(&line)
            .with_context(|| format!("{program} did not start a server: {line:?}"))?;
        let address = started["server"].as_str().context("a server states its address")?;
        let client = Client::with_options(address, ClientOptions::default())?;
        Ok(Self { child, client, _folder: folder })
    }

    /// Bytes of surfaces in its memory.
    pub(super) async fn surface_bytes(&self) -> anyhow::Result<f64> {
        let text = self.client.metrics().await?;
        let found = text.lines().find_map(|line| line.strip_prefix(SURFACE_BYTES));
        Ok(found.context("a server states the bytes of its models")?.trim().parse()?)
    }

    /// Bytes of memory of the process.
    pub(super) fn resident_bytes(&self) -> anyhow::Result<f64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kilobytes = line.and_then(|line| line.split_whitespace().next());
        Ok(kilobytes.context("Linux states the memory of a process")?.parse::<f64>()? * 1024.0)
    }

    /// Stops it, so that others know that it is gone.
    pub(super) async fn stop(self) -> anyhow::Result<()> {
        let told = Command::new("kill").arg(self.child.id().to_string()).status()?;
        anyhow::ensure!(told.success(), "a server cannot be stopped");
        tokio::task::spawn_blocking(move || {
            let mut stopping = self;
            stopping.child.wait().map(drop)
        })
        .await??;
        Ok(())
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        // It may have stopped already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
