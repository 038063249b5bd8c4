//! The real command: its path, and a server in its own process.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::thread::JoinHandle;

use serde_json::Value;

/// Path of the command: `PALPATE_COMMAND`, or built by cargo as `torture` builds it.
pub(crate) fn palpate() -> &'static Path {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| {
        if let Some(built) = std::env::var_os("PALPATE_COMMAND") {
            return built.into();
        }
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let built = Command::new(env!("CARGO"))
            .args(["build", "--quiet", "-p", "palpate"])
            .args(if cfg!(debug_assertions) { &[][..] } else { &["--release"] })
            .current_dir(root)
            .status()
            .unwrap();
        assert!(built.success());
        let torture = Path::new(env!("CARGO_BIN_EXE_torture"));
        torture.with_file_name(format!("palpate{}", std::env::consts::EXE_SUFFIX))
    })
}

/// A server in its own process, killed on drop.
pub(crate) struct Serving {
    child: Child,
    log: Option<JoinHandle<String>>,
    /// Base URL, such as `http://127.0.0.1:40123`.
    pub(crate) url: String,
}

impl Serving {
    /// Starts a server on a folder and returns when it listens.
    pub(crate) fn start(data: &Path, arguments: &[&str]) -> Self {
        Self::start_as(Command::new(palpate()), data, arguments)
    }

    /// Like `start`, after a line of shell, such as one that ignores a signal.
    pub(crate) fn start_after(data: &Path, line: &str) -> Self {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("{line} && exec \"$0\" \"$@\"")]).arg(palpate());
        Self::start_as(shell, data, &[])
    }

    /// Like `start`, with this much virtual memory, KiB.
    pub(crate) fn start_within(data: &Path, arguments: &[&str], memory_kib: u64) -> Self {
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -v \"$0\" && exec \"$@\""]);
        shell.arg(memory_kib.to_string()).arg(palpate());
        Self::start_as(shell, data, arguments)
    }

    fn start_as(mut command: Command, data: &Path, arguments: &[&str]) -> Self {
        let mut child = command
            .args(["serve", "--listen", "127.0.0.1:0", "--json", "--data"])
            .arg(data)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stderr = child.stderr.take().unwrap();
        let log = std::thread::spawn(move || {
            let mut said = String::new();
            let _ = stderr.read_to_string(&mut said);
            said
        });
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let started: Value = serde_json::from_str(&line).unwrap_or_default();
        let url = started["server"].as_str().unwrap_or_default().to_owned();
        let mut serving = Self { child, log: Some(log), url };
        assert!(!serving.url.is_empty(), "{}", serving.stop().1);
        serving
    }

    /// The process id.
    pub(crate) fn process(&self) -> u32 {
        self.child.id()
    }

    /// Stops it as a supervisor does; returns its exit status and its log.
    pub(crate) fn stop(&mut self) -> (ExitStatus, String) {
        self.signal("TERM");
        self.ended()
    }

    /// Sends a signal.
    pub(crate) fn signal(&self, name: &str) {
        let asked = Command::new("kill").args(["-s", name, &self.child.id().to_string()]).status();
        assert!(asked.unwrap().success());
    }

    /// Waits for its end; returns its exit status and its log.
    pub(crate) fn ended(&mut self) -> (ExitStatus, String) {
        let ended = self.child.wait().unwrap();
        (ended, self.log.take().unwrap().join().unwrap())
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
