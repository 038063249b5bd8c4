//! The forwarder of a cell: brings what its server acknowledged to the central service, and the
//! central service's catalogues and sensors back.
//!
//! It runs beside the server, in the same process, and keeps nothing of its own: what is forwarded
//! follows from the two stores. One loop sends and one fetches, so that a large catalogue does not
//! hold up readings. Each pauses longer after every failure in a row.

mod fetching;
mod sending;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use palpate_client::schemas::ProblemType;
use palpate_client::{Client, ClientOptions, Error, RetryPolicy};
use palpate_server::{Forward, Outbox, OutboxError};

/// Pauses after failures: the first, and the longest.
const PAUSE_MIN: Duration = Duration::from_millis(500);
const PAUSE_MAX: Duration = Duration::from_secs(30);
/// Time limits of a connection and of an answer. Chosen: a request of some hundred kilobytes gets
/// through at 100 kbit/s.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(60);

/// Where a cell forwards to.
#[derive(Clone, Debug, Args)]
pub(crate) struct ForwardArgs {
    /// Make this server a cell: forward its sessions to the central service at this address
    /// whenever that can be reached, and take catalogues and sensors from there (docs/scaling.md).
    #[arg(long, env = "PALPATE_FORWARD_TO", value_name = "URL", requires = "cell")]
    forward_to: Option<String>,
    /// File with a key of the role robot at the central service, if that requires keys.
    #[arg(long, env = "PALPATE_FORWARD_KEY_FILE", value_name = "FILE", requires = "forward_to")]
    forward_key_file: Option<PathBuf>,
    /// Certificate authority of the central service: a PEM file [default: the system's].
    #[arg(long, env = "PALPATE_FORWARD_CA", value_name = "FILE", requires = "forward_to")]
    forward_ca: Option<PathBuf>,
    /// Name under which the central service shows the sessions of this cell.
    #[arg(long, env = "PALPATE_CELL", value_name = "NAME", requires = "forward_to")]
    cell: Option<String>,
    /// Catalogue whose current version comes from the central service; repeatable.
    #[arg(
        long = "forward-catalogue",
        env = "PALPATE_FORWARD_CATALOGUE",
        value_name = "NAME",
        value_delimiter = ',',
        default_value = "default"
    )]
    forward_catalogues: Vec<String>,
}

impl ForwardArgs {
    /// The central service and a client of it, if this server is a cell.
    ///
    /// # Errors
    /// When a file cannot be read, or the address or the key is not valid.
    pub(crate) fn prepared(&self) -> anyhow::Result<Option<(Forward, Client)>> {
        let Some(to) = &self.forward_to else { return Ok(None) };
        // A file of settings is not checked by the parser of arguments.
        let cell =
            self.cell.as_ref().context("`forward_to` needs `cell`, the name of this cell")?;
        let n = cell.chars().count();
        anyhow::ensure!((1..=64).contains(&n), "--cell has {n} characters, expected 1 to 64");
        let read = |path: &PathBuf| {
            std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
        };
        let key = self.forward_key_file.as_ref().map(|path| {
            let text = String::from_utf8(read(path)?);
            let text = text.with_context(|| format!("{} is no text", path.display()))?;
            Ok::<_, anyhow::Error>(text.trim().to_owned())
        });
        let options = ClientOptions {
            connect_timeout: CONNECT_TIMEOUT,
            request_timeout: ANSWER_TIMEOUT,
            retry: RetryPolicy::never(),
            key: key.transpose()?,
            authority_pem: self.forward_ca.as_ref().map(read).transpose()?,
        };
        let client = Client::with_options(to, options)?;
        let forward = Forward {
            to: client.address().to_owned(),
            cell: cell.clone(),
            catalogues: self.forward_catalogues.clone(),
        };
        Ok(Some((forward, client)))
    }
}

/// Reason for which something was not forwarded or fetched.
#[derive(Debug)]
enum Trouble {
    /// Nothing gets through: the line is down, the key is not valid, or the service takes no
    /// writes. The service may say how long to wait.
    Line { error: String, wait: Option<Duration> },
    /// The central service refused this one thing.
    Refused(String),
    /// The cell's own server failed.
    Own(OutboxError),
}

impl From<OutboxError> for Trouble {
    fn from(error: OutboxError) -> Self {
        Self::Own(error)
    }
}

impl From<Error> for Trouble {
    fn from(error: Error) -> Self {
        let wait = error.retry_after();
        let is_of_all = match error.kind() {
            // No answer, or not from Palpate.
            None => true,
            Some(ProblemType::QuotaExceeded | ProblemType::StorageFull) => true,
            Some(_) => matches!(error.status(), Some(401 | 403 | 408 | 429 | 500..)),
        };
        let error = error.to_string();
        if is_of_all { Self::Line { error, wait } } else { Self::Refused(error) }
    }
}

/// Pause before the next attempt, which grows from failure to failure.
struct Pause(Duration);

impl Pause {
    fn new() -> Self {
        Self(PAUSE_MIN)
    }

    /// The next pause, at least `wait`; the one after that is twice as long.
    fn next(&mut self, wait: Option<Duration>) -> Duration {
        let pause = self.0;
        self.0 = (2 * pause).min(PAUSE_MAX);
        // Cells that lost the same line do not come back in the same moment.
        let jitter = pause.mul_f64(0.5 * fraction());
        wait.map_or(pause + jitter, |wait| wait.max(pause))
    }
}

/// A number from 0 to 1 that differs from call to call and from process to process.
fn fraction() -> f64 {
    use std::hash::{BuildHasher as _, RandomState};
    RandomState::new().hash_one(0) as f64 / u64::MAX as f64
}

/// Forwards and fetches until it is dropped.
pub(crate) async fn run(outbox: Outbox, client: Client, forward: Forward) {
    tracing::info!("Forwarding to {} as cell {:?}", forward.to, forward.cell);
    tokio::join!(
        sending::run(&outbox, &client),
        fetching::run(&outbox, &client, &forward.catalogues)
    );
}

/// Notes trouble with the line: a warning for the first failure in a row.
fn note_line(outbox: &Outbox, error: String) {
    let said = format!("Cannot forward: {error}. What is acknowledged here waits");
    if outbox.failed(error) {
        tracing::warn!("{said}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest() {
        let mut pause = Pause::new();
        let lengths: Vec<Duration> = (0..9).map(|_| pause.next(None)).collect();
        for (length, least) in lengths.iter().zip([0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 30.0])
        {
            let within = least..=least * 1.5;
            assert!(within.contains(&length.as_secs_f64()), "{lengths:?}");
        }
        assert_eq!(Pause::new().next(Some(Duration::from_secs(7))), Duration::from_secs(7));
    }

    #[test]
    fn what_concerns_all_is_trouble_of_the_line() {
        let status = |status| {
            let (url, body, retry_after) = (String::new(), String::new(), None);
            Trouble::from(Error::Status { url, status, body, retry_after })
        };
        // A proxy's page, whatever its status.
        assert!(matches!(status(404), Trouble::Line { .. }));
        let problem = |kind, status| {
            let text = String::new;
            let problem = palpate_client::schemas::Problem {
                kind,
                title: text(),
                status,
                detail: text(),
                instance: text(),
                request_id: text(),
                errors: Vec::new(),
            };
            Trouble::from(Error::Problem { problem: Box::new(problem), retry_after: None })
        };
        assert!(matches!(problem(ProblemType::Forbidden, 403), Trouble::Line { .. }));
        assert!(matches!(problem(ProblemType::Overloaded, 503), Trouble::Line { .. }));
        assert!(matches!(problem(ProblemType::QuotaExceeded, 409), Trouble::Line { .. }));
        assert!(matches!(problem(ProblemType::NotFound, 404), Trouble::Refused(_)));
        assert!(matches!(problem(ProblemType::SessionEnded, 410), Trouble::Refused(_)));
    }
}
