//! What servers that share a database need of each other: news, and rights that one has at a time.

use std::time::{Duration, Instant};

use super::Database;
use crate::engine::EngineError;
use crate::engine::lease::Lease;
use crate::engine::news::News;
use crate::key::Space;

/// Spaces whose records servers keep copies of in memory.
const NEWS: [Space; 14] = [
    Space::AccessKey,
    Space::RobotHolder,
    Space::Sensor,
    Space::Calibration,
    Space::SensorDay,
    Space::Version,
    Space::Session,
    Space::Job,
    Space::Webhook,
    Space::Delivery,
    Space::Notice,
    Space::Audit,
    Space::AuditRefused,
    Space::AuditStrangers,
];
/// Pause between two attempts to take a lease.
const ALONE_PAUSE: Duration = Duration::from_millis(20);

impl Database {
    /// Whether other servers may write to the database.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        self.engine.is_shared()
    }

    /// News of what other servers change from now on.
    #[must_use]
    pub fn news(&self) -> News {
        self.engine.news(&NEWS)
    }

    /// Takes the right `name` unless another server has it. Where one server has the whole
    /// database, each call succeeds: calls within a server do not exclude each other.
    ///
    /// # Errors
    /// The engine's.
    pub async fn lease(&self, name: &str) -> Result<Option<Lease>, EngineError> {
        self.engine.lease(name).await
    }

    /// Waits for the right to do `what`, and until reads see what other servers did under it. A
    /// server that died with the right keeps others waiting for 20 s.
    ///
    /// # Errors
    /// [`EngineError::Elsewhere`] when another server keeps it; the engine's.
    pub async fn alone(&self, what: &str, within: Duration) -> Result<Lease, EngineError> {
        let begun = Instant::now();
        loop {
            let fault = match self.engine.lease(what).await {
                Ok(Some(lease)) => {
                    self.engine.catch_up().await?;
                    return Ok(lease);
                }
                Ok(None) => EngineError::Elsewhere { what: what.to_owned() },
                // A cluster that elects a leader answers again soon.
                Err(error @ EngineError::Failed { .. }) => error,
                Err(error) => return Err(error),
            };
            if begun.elapsed() > within {
                return Err(fault);
            }
            tokio::time::sleep(ALONE_PAUSE).await;
        }
    }
}
