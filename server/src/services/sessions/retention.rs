//! Deletion of ended sessions after a configured time, which limits the use of the disk.

use std::sync::Arc;
use std::time::Duration;

use futures::stream::{self, StreamExt};
use palpate_store::error::StoreError;
use tokio::sync::watch;
use uuid::Uuid;

use super::Sessions;
use super::error::SessionError;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::live::status;

/// Interval of the search, unless sessions are kept for less.
const LOOK_EVERY: Duration = Duration::from_secs(60);
/// Number of sessions per piece, deleted at once: deletions share a flush.
const PAGE: usize = 256;
const AT_ONCE: usize = 16;

impl Sessions {
    /// Deletes sessions that ended longer than `keep` ago, until the server stops.
    pub(crate) async fn forget(
        self: Arc<Self>,
        keep: Duration,
        mut stopping: watch::Receiver<bool>,
    ) {
        loop {
            tokio::select! {
                () = tokio::time::sleep(keep.min(LOOK_EVERY)) => {}
                _ = stopping.wait_for(|stopping| *stopping) => return,
            }
            match self.forget_ended(keep).await {
                Ok(0) => {}
                Ok(n) => tracing::info!("Deleted {n} sessions that ended {keep:?} ago or earlier"),
                Err(error) => tracing::error!("Cannot delete sessions that ended: {error}"),
            }
        }
    }

    /// Deletes the sessions that ended before; their number.
    async fn forget_ended(&self, keep: Duration) -> Result<usize, SessionError> {
        let before_ms = now_ms().saturating_sub(keep.as_millis() as u64);
        let (mut after, mut n_deleted) = (None, 0);
        loop {
            let (ended, next) = self.ended(after, before_ms)?;
            let mut deleting = stream::iter(ended)
                .map(|id| async move { self.delete(&id.to_string()).await })
                .buffer_unordered(AT_ONCE);
            while let Some(deleted) = deleting.next().await {
                match deleted {
                    Ok(()) => n_deleted += 1,
                    // A client was quicker.
                    Err(SessionError::Cause(Cause::NotFound { .. })) => {}
                    Err(error) => return Err(error),
                }
            }
            match next {
                Some(next) => after = Some(next),
                None => return Ok(n_deleted),
            }
        }
    }

    /// Sessions of one piece that had ended by then, and the start of the next piece.
    fn ended(
        &self,
        after: Option<Uuid>,
        before_ms: u64,
    ) -> Result<(Vec<Uuid>, Option<Uuid>), StoreError> {
        let page = self.store.sessions().list_whole(after, PAGE)?;
        let mut ended = Vec::new();
        for session in &page.items {
            // Ids are in the order of creation: later ones cannot have ended by then.
            if session.created_at_ms > before_ms {
                return Ok((ended, None));
            }
            let end = status(&self.store, session, now_ms())?.end;
            if end.is_some_and(|end| end.at_ms <= before_ms) {
                ended.push(session.id);
            }
        }
        Ok((ended, page.next))
    }
}
