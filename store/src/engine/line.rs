//! A line: what servers that share a store say to each other without storing it.
//!
//! Laws: a message may be lost, but is never changed, and a question is answered at most once.
//! Every wait has an end. Nothing here survives a process.

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use thiserror::Error;
use tokio::sync::{mpsc, oneshot};
use uuid::Uuid;

use super::EngineError;

/// Longest question or answer, bytes.
pub const MESSAGE_BYTES_MAX: usize = 32 << 20;

/// A line that is being opened; `None` where no other server can share the store.
pub type OpeningLine = Pin<Box<dyn Future<Output = Result<Option<Line>, EngineError>> + Send>>;
/// A message to all that is being sent.
pub type Telling = Pin<Box<dyn Future<Output = Result<(), LineError>> + Send>>;
/// A question that is being asked.
pub type Asking = Pin<Box<dyn Future<Output = Result<Vec<u8>, LineError>> + Send>>;

/// A server's end of the line.
#[derive(Debug)]
pub struct Line {
    /// What servers, this one included, tell all; the newest are dropped while it is full.
    pub told: mpsc::Receiver<Vec<u8>>,
    /// Questions to this server; more are refused while it is full.
    pub questions: mpsc::Receiver<Question>,
    /// Speaks on the line.
    pub speaker: Arc<dyn Speaker>,
}

/// A question of another server.
#[derive(Debug)]
pub struct Question {
    /// What it asks.
    pub bytes: Vec<u8>,
    /// Takes the answer; without one the asker waits until its patience ends.
    pub answer: oneshot::Sender<Vec<u8>>,
}

/// Times that an asker waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Until the other server says that it has the question.
    pub taken: Duration,
    /// Until its answer.
    pub answered: Duration,
}

/// Speaks to the other servers.
pub trait Speaker: Send + Sync + fmt::Debug {
    /// Tells all servers that listen.
    fn tell(&self, message: Vec<u8>) -> Telling;

    /// Asks the server with an id.
    fn ask(&self, server: Uuid, question: Vec<u8>, patience: Patience) -> Asking;
}

/// Reason why a message was not sent, or a question has no answer.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum LineError {
    /// No server listens under the id.
    #[error("no server listens under this id")]
    Nobody,
    /// It did not say in time that it has the question.
    #[error("the server did not take the question in time")]
    Silent,
    /// It took the question and did not answer in time.
    #[error("the server did not answer in time")]
    Late,
    /// It has too many questions.
    #[error("the server has too many questions")]
    Busy,
    /// A question, an answer or a message to all is too long.
    #[error("a message of servers has {found} bytes, expected at most {max}")]
    TooLarge {
        /// Its length, bytes.
        found: usize,
        /// The longest possible.
        max: usize,
    },
    /// The line failed.
    #[error("the line to the other servers failed: {detail}")]
    Failed {
        /// The engine's message.
        detail: String,
    },
}
