//! The catalogues of a server, and its part in their division among the servers of a cluster.

use std::sync::Arc;

use palpate_store::database::{Database, DatabaseError};
use tokio::sync::watch;

use super::StartError;
use crate::compute::Pool;
use crate::config::Config;
use crate::members::Members;
use crate::services::catalogues::Catalogues;

/// Opens the catalogues; with a division this server takes part in it until it stops.
pub(super) async fn catalogues(
    config: &Config,
    store: &Database,
    pool: Pool,
    stopping: &watch::Receiver<bool>,
) -> Result<Arc<Catalogues>, StartError> {
    let Some(dividing) = config.dividing else {
        return Ok(Arc::new(Catalogues::new(store, pool, None, config)?));
    };
    let joined = Members::join(store, dividing, &config.data).await;
    let joined = joined.map_err(DatabaseError::from)?;
    let (members, heard) = joined.ok_or(StartError::DividedAlone)?;
    let catalogues = Arc::new(Catalogues::new(store, pool, Some(members), config)?);
    let pool = Pool::start(config.compute_threads, config.compute_queue_max)?;
    tokio::spawn(Arc::clone(&catalogues).take_part(heard, pool, stopping.clone()));
    Ok(catalogues)
}
