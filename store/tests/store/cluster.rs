//! A cluster of NATS servers for the tests of this process, and stores on it.
//!
//! It runs where PALPATE_NATS_SERVER names the program, as `tests/nats` does it.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;

use palpate_store::nats::{NatsEngine, NatsOptions};
use tempfile::TempDir;
use uuid::Uuid;

/// Servers on loopback; they end with this process.
#[derive(Debug)]
pub(crate) struct Cluster {
    process: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    pub(crate) address: String,
}

impl Cluster {
    /// Starts this many servers; `None` where there is no program.
    pub(crate) fn start(size: usize) -> Option<Self> {
        std::env::var_os("PALPATE_NATS_SERVER")?;
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/nats_cluster.py");
        let mut process = Command::new("python3")
            .args([script, &size.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let input = process.stdin.take();
        let mut output = BufReader::new(process.stdout.take().unwrap());
        let address = line(&mut output);
        assert!(address.starts_with("nats://"), "the cluster did not start: {address:?}");
        Some(Self { process, input, output, address })
    }

    /// Kills (`kill`) or starts (`start`) a server.
    pub(crate) fn order(&mut self, order: &str, server: usize) {
        writeln!(self.input.as_mut().unwrap(), "{order} {server}").unwrap();
        assert_eq!(line(&mut self.output), "done");
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // The script stops its servers when its input ends.
        drop(self.input.take());
        let _ = self.process.wait();
    }
}

fn line(output: &mut impl BufRead) -> String {
    let mut line = String::new();
    output.read_line(&mut line).unwrap();
    line.trim_end().to_owned()
}

/// A store of its own on a cluster.
pub(crate) struct Store {
    pub(crate) options: NatsOptions,
    _folder: TempDir,
}

impl Store {
    pub(crate) fn on(address: &str) -> Self {
        let folder = TempDir::new().unwrap();
        let address = format!("{address}/test-{}", Uuid::now_v7());
        let options = NatsOptions::parse(&address, folder.path().to_owned()).unwrap();
        let options = NatsOptions { is_shared: true, ..options };
        Self { options, _folder: folder }
    }

    pub(crate) fn open(&self) -> NatsEngine {
        NatsEngine::open(&self.options).unwrap()
    }
}

/// A new store on the cluster of this process; `None` where there is no program.
pub(crate) fn store() -> Option<Store> {
    static CLUSTER: OnceLock<Option<Cluster>> = OnceLock::new();
    let cluster = CLUSTER.get_or_init(|| Cluster::start(3));
    cluster.as_ref().map(|cluster| Store::on(&cluster.address))
}
