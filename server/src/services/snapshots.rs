//! Snapshots of the running service: a stream of bytes of one moment of the database.
//!
//! Readings go on meanwhile. A receiver that stalls is abandoned, and one whose key ends gets
//! no more.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use palpate_schemas::WebhookSnapshot;
use palpate_store::database::{Database, LAYOUT};
use palpate_store::snapshot::{SnapshotHeader, SnapshotWriter};
use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};
use tokio::time::timeout;

use crate::cause::Cause;
use crate::clock::now_ms;
use crate::figures;
use crate::notices::Notices;

/// Maximum number of chunks that wait for the receiver.
const CHUNKS_MAX: usize = 4;
/// Memory of a snapshot in progress, in bytes: waiting chunks of at most 1 MB, one being made
/// and one being sent.
pub(crate) const IN_MEMORY: usize = (CHUNKS_MAX + 2) << 20;
/// Time limit of a receiver for a chunk.
const PATIENCE: Duration = Duration::from_secs(60);

/// A chunk, or the reason for the end.
pub(crate) type Chunk = Result<Bytes, std::io::Error>;

/// Starts a snapshot of everything acknowledged by now. It breaks off when `ended` resolves.
pub(crate) async fn take(
    store: &Database,
    notices: &Arc<Notices>,
    ended: impl Future<Output = ()> + Send + 'static,
) -> Result<mpsc::Receiver<Chunk>, Cause> {
    let (store, notices, started) = (store.clone(), Arc::clone(notices), Instant::now());
    let begun = tokio::task::spawn_blocking(move || store.cut());
    let cut = begun.await.map_err(|_| Cause::Panicked)??;
    let header = SnapshotHeader {
        layout: LAYOUT,
        created_at_ms: now_ms(),
        made_by: concat!("palpate ", env!("CARGO_PKG_VERSION")).to_owned(),
    };
    let (sender, receiver) = mpsc::channel(CHUNKS_MAX);
    let writer = SnapshotWriter::new(cut, &header);
    let (end, has_ended) = watch::channel(false);
    tokio::spawn(async move {
        tokio::select! {
            () = ended => { end.send_replace(true); }
            () = end.closed() => {}
        }
    });
    tokio::task::spawn_blocking(move || {
        let (bytes, reason) = send(writer, &sender, has_ended);
        let duration_s = started.elapsed().as_secs_f64();
        notices.snapshot(now_ms(), WebhookSnapshot { bytes, duration_s, reason });
    });
    Ok(receiver)
}

/// Sends a snapshot; the number of bytes sent, and why it was not sent to its end.
fn send(
    mut writer: SnapshotWriter,
    sender: &mpsc::Sender<Chunk>,
    mut has_ended: watch::Receiver<bool>,
) -> (u64, Option<String>) {
    let mut n_sent = 0;
    let runtime = Handle::current();
    let mut put = |chunk| {
        runtime.block_on(async {
            tokio::select! {
                sent = timeout(PATIENCE, sender.send(chunk)) => matches!(sent, Ok(Ok(()))),
                _ = has_ended.wait_for(|has_ended| *has_ended) => false,
            }
        })
    };
    loop {
        match writer.next_chunk() {
            Ok(Some(chunk)) => {
                let n_bytes = chunk.len() as u64;
                if !put(Ok(chunk.into())) {
                    // The reader must see that this is not the end.
                    let broken = std::io::Error::other("the key or the server has ended");
                    let _ = sender.try_send(Err(broken));
                    tracing::warn!("A snapshot was not received to its end");
                    let reason = "it was not received to its end";
                    return (n_sent, Some(reason.to_owned()));
                }
                n_sent += n_bytes;
            }
            Ok(None) => {
                figures::sent_snapshot();
                tracing::info!("Sent a snapshot");
                return (n_sent, None);
            }
            Err(error) => {
                tracing::error!(%error, "A snapshot was not sent to its end: {error}");
                let reason = error.to_string();
                put(Err(std::io::Error::other(error)));
                return (n_sent, Some(reason));
            }
        }
    }
}
