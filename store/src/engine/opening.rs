//! Errors of an engine that cannot be opened: what is wrong with the folder, and what to do.

use std::path::PathBuf;

use thiserror::Error;

/// Error of an engine that could not be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// Another process has the folder open.
    #[error("the database in {folder} is in use by another process (it holds {lock})")]
    InUse {
        /// The database's folder.
        folder: PathBuf,
        /// The locked file.
        lock: PathBuf,
    },
    /// The folder or a file in it cannot be used.
    #[error("cannot use {path} for the database: {source}")]
    Io {
        /// The path.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The disk is too full to open it.
    #[error(
        "the disk is full: the database in {folder} is not damaged, but needs some room to open \
         ({detail}); make room and start again"
    )]
    NoRoom {
        /// The database's folder.
        folder: PathBuf,
        /// The engine's message.
        detail: String,
    },
    /// The engine found its own files damaged.
    #[error(
        "the database in {folder} is damaged and was left as it is ({detail}); \
         restore a snapshot or a copy of the folder"
    )]
    Damaged {
        /// The database's folder.
        folder: PathBuf,
        /// The engine's message.
        detail: String,
    },
    /// Acknowledged commits are missing.
    #[error(
        "the database in {folder} has lost its newest commits: {acknowledged} were acknowledged, \
         {found} are there; restore a snapshot, or accept the loss: `palpate fsck --accept`"
    )]
    LostCommits {
        /// The database's folder.
        folder: PathBuf,
        /// Number of commits acknowledged at least.
        acknowledged: u64,
        /// Number of commits in the files.
        found: u64,
    },
    /// The records differ from the last written ones.
    #[error(
        "the database in {folder} is damaged: its records are not those that were written \
         ({found} of them do not give the stored sum); restore a snapshot, or see what is \
         missing with `palpate fsck` and accept the loss: `palpate fsck --accept`"
    )]
    Altered {
        /// The database's folder.
        folder: PathBuf,
        /// Number of pairs.
        found: u64,
    },
    /// The file with the number of acknowledged commits is missing or damaged.
    #[error(
        "{path} {fault}, so nobody knows whether acknowledged commits are missing; if the files \
         were copied without it, accept what is there: `palpate fsck --accept`"
    )]
    Mark {
        /// The file.
        path: PathBuf,
        /// The fault.
        fault: &'static str,
    },
    /// The cluster cannot be reached, or lacks what a store needs.
    #[error("cannot open the store on NATS at {servers}: {fault}")]
    Cluster {
        /// Addresses of its servers.
        servers: String,
        /// The fault.
        fault: String,
    },
    /// The operating system refused a thread for the writer.
    #[error("cannot start the database's writer thread: {source}")]
    Thread {
        /// The cause.
        source: std::io::Error,
    },
}
