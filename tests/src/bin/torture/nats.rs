//! A cluster of NATS servers on loopback: started, killed, started again.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use reqwest::Client;
use serde_json::Value;

/// Number of servers, and of copies of the stream.
pub(crate) const SIZE: usize = 3;
/// Maximum time until a server answers.
const READY_WITHIN: Duration = Duration::from_secs(60);
/// Pause between two questions.
const PAUSE: Duration = Duration::from_millis(50);

/// A cluster, killed on drop.
pub(crate) struct Cluster {
    program: PathBuf,
    folder: PathBuf,
    clients: Vec<u16>,
    monitors: Vec<u16>,
    processes: Vec<Option<Child>>,
    http: Client,
}

impl Cluster {
    /// Starts the servers with files in `folder`; returns when all answer.
    pub(crate) async fn start(
        program: &Path,
        folder: &Path,
        http: &Client,
    ) -> anyhow::Result<Self> {
        std::fs::create_dir_all(folder).context("cannot make a folder for NATS servers")?;
        let ports = free_ports(3 * SIZE)?;
        let (clients, rest) = ports.split_at(SIZE);
        let (routes, monitors) = rest.split_at(SIZE);
        let peers: Vec<_> = routes.iter().map(|port| format!("nats://127.0.0.1:{port}")).collect();
        for number in 0..SIZE {
            let text = format!(
                "server_name: n{number}\nlisten: 127.0.0.1:{}\nhttp: 127.0.0.1:{}\n\
                 jetstream {{ store_dir: \"{}\", sync_interval: always, max_file: 8GB }}\n\
                 cluster {{ name: torture, listen: 127.0.0.1:{}, routes: [{}] }}\n",
                clients[number],
                monitors[number],
                folder.join(format!("n{number}")).display(),
                routes[number],
                peers.join(", ")
            );
            std::fs::write(folder.join(format!("n{number}.conf")), text)
                .context("cannot write the settings of a NATS server")?;
        }
        let mut cluster = Self {
            program: program.to_owned(),
            folder: folder.to_owned(),
            clients: clients.to_vec(),
            monitors: monitors.to_vec(),
            processes: (0..SIZE).map(|_| None).collect(),
            http: http.clone(),
        };
        for number in 0..SIZE {
            cluster.run(number)?;
        }
        for number in 0..SIZE {
            cluster.ready(number).await?;
        }
        Ok(cluster)
    }

    /// The address of a store on it.
    pub(crate) fn address(&self) -> String {
        let hosts: Vec<_> = self.clients.iter().map(|port| format!("127.0.0.1:{port}")).collect();
        format!("nats://{}", hosts.join(","))
    }

    /// The server that leads the stream of the store; `None` during an election.
    pub(crate) async fn leader(&self) -> Option<usize> {
        for (number, process) in self.processes.iter().enumerate() {
            if process.is_none() {
                continue;
            }
            let path = "jsz?accounts=true&streams=true";
            let Some(shown) = self.ask(number, path).await else { continue };
            let accounts = shown["account_details"].as_array()?;
            let streams = accounts.iter().filter_map(|it| it["stream_detail"].as_array());
            let mut leaders = streams.flatten().filter_map(|it| it["cluster"]["leader"].as_str());
            let leader = leaders.next().and_then(|name| name.strip_prefix('n')?.parse().ok());
            if leader.is_some() {
                return leader;
            }
        }
        None
    }

    /// Kills a server at once.
    pub(crate) fn kill(&mut self, number: usize) -> anyhow::Result<()> {
        let Some(mut process) = self.processes[number].take() else { return Ok(()) };
        process.kill().context("cannot kill a NATS server")?;
        process.wait().context("cannot wait for a NATS server")?;
        Ok(())
    }

    /// Starts a killed server again; returns when it has what the others have.
    pub(crate) async fn restart(&mut self, number: usize) -> anyhow::Result<()> {
        self.run(number)?;
        self.ready(number).await
    }

    fn run(&mut self, number: usize) -> anyhow::Result<()> {
        let file = |end: &str| self.folder.join(format!("n{number}.{end}"));
        let process = Command::new(&self.program)
            .arg("-c")
            .arg(file("conf"))
            .arg("-l")
            .arg(file("log"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .with_context(|| format!("cannot start {}", self.program.display()))?;
        self.processes[number] = Some(process);
        Ok(())
    }

    async fn ready(&self, number: usize) -> anyhow::Result<()> {
        let begun = Instant::now();
        while self.ask(number, "healthz").await.is_none_or(|shown| shown["status"] != "ok") {
            if begun.elapsed() > READY_WITHIN {
                bail!("NATS server {number} is not ready after {READY_WITHIN:?}");
            }
            tokio::time::sleep(PAUSE).await;
        }
        Ok(())
    }

    async fn ask(&self, number: usize, path: &str) -> Option<Value> {
        let url = format!("http://127.0.0.1:{}/{path}", self.monitors[number]);
        let answer = self.http.get(url).timeout(Duration::from_secs(2)).send().await.ok()?;
        serde_json::from_str(&answer.text().await.ok()?).ok()
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for number in 0..SIZE {
            // What cannot be killed has ended.
            let _ = self.kill(number);
        }
    }
}

/// Ports of loopback that nobody uses.
fn free_ports(n: usize) -> anyhow::Result<Vec<u16>> {
    let bind = |_| TcpListener::bind("127.0.0.1:0").context("no port is free");
    let listeners: Vec<TcpListener> = (0..n).map(bind).collect::<anyhow::Result<_>>()?;
    let port = |listener: &TcpListener| Ok(listener.local_addr().context("no address")?.port());
    listeners.iter().map(port).collect()
}
