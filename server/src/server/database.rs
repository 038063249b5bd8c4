//! The database of a server: opened and migrated at its start, closed after its last user.

use std::sync::Arc;
use std::time::Duration;

use palpate_migrations::migrate;
use palpate_store::database::{Database, DatabaseError};
use palpate_store::engine::Engine;
use palpate_store::nats::NatsEngine;
use palpate_store::sled::{SledEngine, SledOptions};

use super::{SHUTDOWN_PATIENCE, StartError};
use crate::config::Config;

/// Opens the engine of the cluster, or else of the data folder.
pub(super) async fn open(config: &Config) -> Result<Arc<dyn Engine>, StartError> {
    if let Some(options) = config.cluster.clone() {
        let opening = tokio::task::spawn_blocking(move || NatsEngine::open(&options));
        let opened = opening.await.map_err(std::io::Error::other)?;
        return Ok(Arc::new(opened.map_err(DatabaseError::from)?));
    }
    let folder = config.data.clone();
    let options = SledOptions {
        reserve_bytes: config.disk_reserve_bytes,
        cache_bytes: config.store_cache_bytes,
        slack_bytes: config.store_slack_bytes,
        free_space: config.free_space.clone(),
        ..SledOptions::default()
    };
    let opening = tokio::task::spawn_blocking(move || SledEngine::open(&folder, &options));
    let opened = opening.await.map_err(std::io::Error::other)?;
    Ok(Arc::new(opened.map_err(DatabaseError::from)?))
}

/// The database of an engine, in today's layout.
pub(super) async fn database(
    engine: Arc<dyn Engine>,
    migrates: bool,
) -> Result<Database, StartError> {
    let opening = tokio::task::spawn_blocking(move || {
        if migrates {
            migrate(&*engine)?;
        }
        Ok(Database::with_engine(engine)?)
    });
    opening.await.map_err(std::io::Error::other)?
}

/// Closes the engine after its last user: the last tasks of the runtime release it a moment
/// after they have answered, and the next server may need the folder's lock.
pub(super) async fn close(engine: Arc<dyn Engine>) {
    let waiting = async {
        while Arc::strong_count(&engine) > 1 {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    };
    if tokio::time::timeout(SHUTDOWN_PATIENCE, waiting).await.is_err() {
        tracing::warn!("The database is still in use after {SHUTDOWN_PATIENCE:?}");
    }
    if tokio::task::spawn_blocking(move || drop(engine)).await.is_err() {
        tracing::error!("The database panicked when it was closed");
    }
}
