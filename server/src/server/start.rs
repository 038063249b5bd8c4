//! What is checked before a server starts, and why it does not start.

use std::net::SocketAddr;

use palpate_migrations::MigrateError;
use palpate_store::database::DatabaseError;
use palpate_store::error::StoreError;
use thiserror::Error;

use crate::config::{Access, Config};
use crate::middleware::headers::is_origin;
use crate::services::keys::error::OpenError;
use crate::tls::TlsError;

/// Error of a server that does not start.
#[derive(Debug, Error)]
pub enum StartError {
    /// The address is reachable from other machines, and keys are not required.
    #[error(
        "{address} can be reached from other machines and this server requires no keys: \
         ask for keys with `--access keys` (the first one is made and printed), listen at \
         127.0.0.1, or, in a network that you trust, allow it expressly with `--insecure-bind`"
    )]
    InsecureBind {
        /// The given address.
        address: SocketAddr,
    },
    /// The server cannot listen at the address.
    #[error("cannot listen at {address}: {source}")]
    Listen {
        /// The given address.
        address: SocketAddr,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// An origin is not valid.
    #[error(
        "{found:?} is no origin, expected one as browsers send it, such as https://lab.example \
         or http://localhost:3000, without a path"
    )]
    Origin {
        /// The given origin.
        found: String,
    },
    /// The files do not permit TLS.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The operating system has no random bits for the first key.
    #[error("cannot make the first key: {0}")]
    Random(#[from] getrandom::Error),
    /// A first admin key for a server without keys.
    #[error("the access is `open`, which needs no keys, but a first admin key is given")]
    NeedlessKey,
    /// The operating system gives no threads.
    #[error("cannot start threads: {0}")]
    Threads(#[from] std::io::Error),
    /// The training threads do not start.
    #[error("cannot start the training threads: {0}")]
    TrainingThreads(#[from] rayon::ThreadPoolBuildError),
    /// The database cannot be opened.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// The database cannot be migrated to today's layout.
    #[error("cannot migrate the database: {0}")]
    Migrate(#[from] MigrateError),
    /// The database cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The open sessions cannot be counted.
    #[error("cannot read the sessions: {reason}")]
    Sessions {
        /// The cause.
        reason: String,
    },
    /// The webhooks cannot be read.
    #[error("cannot read the webhooks: {reason}")]
    Webhooks {
        /// The cause.
        reason: String,
    },
    /// Unfinished jobs cannot be resumed.
    #[error("cannot take up unfinished jobs: {reason}")]
    Jobs {
        /// The cause.
        reason: String,
    },
}

impl From<OpenError> for StartError {
    fn from(error: OpenError) -> Self {
        match error {
            OpenError::Store(error) => Self::Store(error),
            OpenError::Random(error) => Self::Random(error),
        }
    }
}

/// Checks what can be checked before anything is stored.
///
/// # Errors
/// [`StartError`].
pub fn check(config: &Config) -> Result<(), StartError> {
    let address = config.listen;
    let makes_key = config.new_admin_key || config.first_admin_key.is_some();
    // A folder that is not there holds no keys.
    let is_new = config.cluster.is_none() && !config.data.exists();
    let is_open = match config.access {
        Access::Open => true,
        Access::Auto => is_new && !makes_key,
        Access::Keys => false,
    };
    if is_exposed(config) && is_open {
        return Err(StartError::InsecureBind { address });
    }
    if config.access == Access::Open && config.first_admin_key.is_some() {
        return Err(StartError::NeedlessKey);
    }
    match config.cors_origins.iter().find(|origin| !is_origin(origin)) {
        Some(found) => Err(StartError::Origin { found: found.clone() }),
        None => Ok(()),
    }
}

/// Whether other machines can reach the server without the operator's express wish.
pub(super) fn is_exposed(config: &Config) -> bool {
    !config.listen.ip().is_loopback() && !config.insecure_bind
}

#[cfg(test)]
mod tests {
    use palpate_store::nats::NatsOptions;

    use super::*;

    #[test]
    fn only_what_has_no_keys_for_certain_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let new = Config {
            listen: ([0, 0, 0, 0], 0).into(),
            access: Access::Auto,
            ..Config::new(folder.path().join("new"))
        };
        let spool = folder.path().join("spool");
        let cluster = Some(NatsOptions::parse("nats://127.0.0.1:4222", spool).unwrap());
        let is_refused =
            |config: &Config| matches!(check(config), Err(StartError::InsecureBind { .. }));
        assert!(is_refused(&new));
        assert!(!is_refused(&Config { cluster, ..new.clone() }), "keys may be in a shared store");
        assert!(!is_refused(&Config { new_admin_key: true, ..new.clone() }));
        assert!(is_refused(&Config { access: Access::Open, new_admin_key: true, ..new }));
    }
}
