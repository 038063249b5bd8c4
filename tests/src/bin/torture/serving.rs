//! A real `palpate serve` as a child process: started, killed, started again.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context, bail};
use serde_json::Value;

use crate::Access;

/// Maximum time until a server listens; one that takes longer counts as hung.
const START_PATIENCE: Duration = Duration::from_secs(60);

/// A server in its own process, killed on drop.
pub(crate) struct Serving {
    child: Ending,
    said: JoinHandle<String>,
    /// Base URL, such as `http://127.0.0.1:40123`.
    pub(crate) url: String,
    /// The first admin's key, if this start created it.
    pub(crate) admin_key: Option<String>,
}

/// The standard error of a server that did not start.
#[derive(Debug)]
pub(crate) struct Refused(pub(crate) String);

/// Builds the command with the profile of this binary, and returns its path.
pub(crate) fn build() -> anyhow::Result<PathBuf> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut build = Command::new(cargo);
    build.args(["build", "--quiet", "-p", "palpate", "--manifest-path"]);
    build.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml"));
    let is_release = !cfg!(debug_assertions);
    if is_release {
        build.arg("--release");
    }
    // The standard output is reserved for the result.
    build.stdout(Stdio::null());
    let status = build.status().context("cannot run cargo")?;
    if !status.success() {
        bail!("cannot build the command: name one with --palpate FILE");
    }
    let own = std::env::current_exe().context("cannot find this program's folder")?;
    let profile = if is_release { "release" } else { "debug" };
    let folder = own
        .ancestors()
        .find(|folder| folder.file_name().is_some_and(|name| name == profile))
        .context("cannot find the folder of the build: name the command with --palpate FILE")?;
    Ok(folder.join(format!("palpate{}", std::env::consts::EXE_SUFFIX)))
}

impl Serving {
    /// Starts a server on a folder and returns when it listens.
    pub(crate) fn start(
        command: &Path,
        data: &Path,
        access: Access,
    ) -> anyhow::Result<Result<Self, Refused>> {
        Self::start_with(command, data, access, &[])
    }

    /// Like `start`, with further arguments.
    pub(crate) fn start_with(
        command: &Path,
        data: &Path,
        access: Access,
        more: &[String],
    ) -> anyhow::Result<Result<Self, Refused>> {
        let more: Vec<&str> = more.iter().map(String::as_str).collect();
        Self::start_as(Command::new(command), data, access, &more)
    }

    /// Like `start`, with further arguments and limited memory.
    pub(crate) fn start_within(
        command: &Path,
        data: &Path,
        access: Access,
        memory_kib: u64,
        arguments: &[&str],
    ) -> anyhow::Result<Result<Self, Refused>> {
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -v \"$0\" && exec \"$@\""]);
        shell.arg(memory_kib.to_string()).arg(command);
        Self::start_as(shell, data, access, arguments)
    }

    fn start_as(
        mut command: Command,
        data: &Path,
        access: Access,
        arguments: &[&str],
    ) -> anyhow::Result<Result<Self, Refused>> {
        let program = command.get_program().to_owned();
        let mut child = command
            .args(["serve", "--listen", "127.0.0.1:0", "--json", "--access"])
            .arg(access.name())
            .arg("--data")
            .arg(data)
            .args(arguments)
            .env("RUST_LOG", "info")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {}", program.display()))?;
        let stdout = child.stdout.take().context("the child has no standard output")?;
        let mut stderr = child.stderr.take().context("the child has no standard error")?;
        let said = std::thread::spawn(move || {
            let mut said = Vec::new();
            // A log that is not read would fill the pipe and block the server.
            let _ = stderr.read_to_end(&mut said);
            String::from_utf8_lossy(&said).trim().to_owned()
        });
        let (sender, listening) = mpsc::channel();
        std::thread::spawn(move || {
            let mut line = String::new();
            let _ = BufReader::new(stdout).read_line(&mut line);
            // The receiver is gone if the server took too long.
            let _ = sender.send(line);
        });
        let line = listening.recv_timeout(START_PATIENCE).unwrap_or_default();
        let answer: Option<Value> = serde_json::from_str(&line).ok();
        if let Some(url) = answer.as_ref().and_then(|answer| answer["server"].as_str()) {
            let file = answer.as_ref().and_then(|answer| answer["admin_key_file"].as_str());
            let admin_key = file.map(std::fs::read_to_string).transpose()?;
            let admin_key = admin_key.map(|key| key.trim().to_owned());
            return Ok(Ok(Self { url: url.to_owned(), admin_key, child: Ending(child), said }));
        }
        let _ = child.kill();
        child.wait().context("cannot wait for the child")?;
        Ok(Err(Refused(said.join().unwrap_or_default())))
    }

    /// The process id.
    pub(crate) fn process(&self) -> u32 {
        self.child.0.id()
    }

    /// Kills the process at once, like a loss of power.
    pub(crate) fn kill(self) -> anyhow::Result<()> {
        self.end().map(|_| ())
    }

    /// Kills the process; its standard error.
    pub(crate) fn end(mut self) -> anyhow::Result<String> {
        self.child.0.kill().context("cannot kill the server")?;
        self.child.0.wait().context("cannot wait for the server")?;
        Ok(self.said.join().unwrap_or_default())
    }
}

/// A child process that is killed on drop.
struct Ending(Child);

impl Drop for Ending {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
