//! A server in a process of its own, on a NATS cluster: its memory is that of one server.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use anyhow::Context as _;
use palpate_client::{Client, ClientOptions};
use serde_json::Value;
use tempfile::TempDir;

/// A running server; it is killed when it is dropped.
pub(crate) struct ServerProcess {
    child: Child,
    pub(crate) client: Client,
    _folder: TempDir,
}

impl ServerProcess {
    /// Starts the program `palpate` as a server that shares the store of a NATS cluster; returns
    /// when it listens.
    pub(crate) async fn start(
        palpate: &Path,
        cluster: &str,
        more: &[&str],
    ) -> anyhow::Result<Self> {
        let folder = tempfile::Builder::new().prefix("palpate-process-").tempdir()?;
        let mut command = Command::new(palpate);
        command.args(["serve", "--listen", "127.0.0.1:0", "--access", "open", "--json"]);
        command.args(["--store", cluster, "--store-shared"]).args(more);
        command.arg("--data").arg(folder.path().join("data"));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        let program = palpate.display();
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

    /// The value of a metric, by its name and labels as `/metrics` writes them.
    pub(crate) async fn metric(&self, metric: &str) -> anyhow::Result<f64> {
        let text = self.client.metrics().await?;
        let value = |line: &str| line.strip_prefix(metric)?.strip_prefix(' ')?.parse().ok();
        text.lines().find_map(value).with_context(|| format!("a server states no {metric}"))
    }

    /// Bytes of memory of the process.
    pub(crate) fn resident_bytes(&self) -> anyhow::Result<f64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kilobytes = line.and_then(|line| line.split_whitespace().next());
        Ok(kilobytes.context("Linux states the memory of a process")?.parse::<f64>()? * 1024.0)
    }

    /// Stops it, so that others know that it is gone.
    pub(crate) async fn stop(self) -> anyhow::Result<()> {
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
