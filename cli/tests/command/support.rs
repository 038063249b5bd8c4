//! The command, and a server of it in a process of its own.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;

/// The command with these arguments, and without settings of the environment.
pub(crate) fn palpate(arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.args(arguments.split_whitespace());
    for name in ["SERVER", "DATA", "LISTEN", "KEY", "CA", "ACCESS", "TLS_CERT", "TLS_KEY"] {
        command.env_remove(format!("PALPATE_{name}"));
    }
    command.env_remove("RUST_LOG");
    command
}

pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A server that stops when it is dropped, and its answer when it started.
pub(crate) struct Server {
    child: Child,
    pub(crate) started: Value,
    log: File,
}

impl Server {
    pub(crate) fn start(data: &Path, arguments: &str) -> Self {
        Self::start_with(data, arguments, &[])
    }

    /// A server with these variables in its environment.
    pub(crate) fn start_with(data: &Path, arguments: &str, variables: &[(&str, &str)]) -> Self {
        let listen = if arguments.contains("--listen") { "" } else { "--listen 127.0.0.1:0" };
        let mut command = palpate(&format!("serve --json {listen}"));
        command.args(arguments.split_whitespace()).arg("--data").arg(data);
        command.envs(variables.iter().copied());
        let log = tempfile::tempfile().unwrap();
        command.stdout(Stdio::piped()).stderr(log.try_clone().unwrap());
        let mut child = command.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        Self { child, started: serde_json::from_str(&line).unwrap(), log }
    }

    pub(crate) fn said(&self, what: &str) -> &str {
        self.started[what].as_str().unwrap()
    }

    /// Sends a signal, such as `STOP`.
    pub(crate) fn signal(&self, signal: &str) {
        let (signal, process) = (format!("-{signal}"), self.process().to_string());
        assert!(Command::new("kill").args([signal, process]).status().unwrap().success());
    }

    /// Waits for its end and returns whether it succeeded.
    pub(crate) fn ended_well(mut self) -> bool {
        self.child.wait().unwrap().success()
    }

    pub(crate) fn process(&self) -> u32 {
        self.child.id()
    }

    /// Runs a command against it, with a key unless it is empty.
    pub(crate) fn run(&self, key: &str, arguments: &str) -> Output {
        let mut command = palpate(arguments);
        command.env("PALPATE_SERVER", self.said("server"));
        if !key.is_empty() {
            command.env("PALPATE_KEY", key);
        }
        command.output().unwrap()
    }

    /// Stops it and returns its log.
    pub(crate) fn log(mut self) -> String {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        let mut log = String::new();
        self.log.rewind().unwrap();
        self.log.read_to_string(&mut log).unwrap();
        log
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
