//! Snapshots of the running service: a stream of bytes, read from one moment of the database
//! while readings go on. One at a time; a receiver that stalls is given up.

use std::time::Duration;

use bytes::Bytes;
use palpate_store::database::{Database, LAYOUT};
use palpate_store::snapshot::{SnapshotHeader, SnapshotWriter};
use tokio::runtime::Handle;
use tokio::sync::{mpsc, watch};
use tokio::time::timeout;

use crate::clock::now_ms;
use crate::refusal::Refusal;

/// How many chunks wait for the receiver.
const CHUNKS_MAX: usize = 4;
/// Memory of a snapshot that is sent, in bytes: chunks of at most 1 MB that wait, one that is made
/// and one that is sent.
pub(crate) const IN_MEMORY: usize = (CHUNKS_MAX + 2) << 20;
/// How long a receiver may take for a chunk.
const PATIENCE: Duration = Duration::from_secs(60);

/// A chunk, or why there is no more.
pub(crate) type Chunk = Result<Bytes, std::io::Error>;

/// Begins a snapshot of everything that is acknowledged by now.
pub(crate) async fn take(
    store: &Database,
    stopping: watch::Receiver<bool>,
) -> Result<mpsc::Receiver<Chunk>, Refusal> {
    let store = store.clone();
    let begun = tokio::task::spawn_blocking(move || store.cut());
    let cut = begun.await.map_err(|_| Refusal::Panicked)??;
    let header = SnapshotHeader {
        layout: LAYOUT,
        created_at_ms: now_ms(),
        made_by: concat!("palpate ", env!("CARGO_PKG_VERSION")).to_owned(),
    };
    let (sender, receiver) = mpsc::channel(CHUNKS_MAX);
    let writer = SnapshotWriter::new(cut, &header);
    tokio::task::spawn_blocking(move || send(writer, &sender, &stopping));
    Ok(receiver)
}

fn send(
    mut writer: SnapshotWriter,
    sender: &mpsc::Sender<Chunk>,
    stopping: &watch::Receiver<bool>,
) {
    let runtime = Handle::current();
    let put = |chunk| {
        let sent = runtime.block_on(timeout(PATIENCE, sender.send(chunk)));
        matches!(sent, Ok(Ok(())))
    };
    loop {
        let chunk = match writer.next_chunk() {
            _ if *stopping.borrow() => Err("the server stops".to_owned()),
            Ok(Some(chunk)) => Ok(chunk),
            Ok(None) => return tracing::info!("Sent a snapshot"),
            Err(error) => Err(error.to_string()),
        };
        match chunk {
            Ok(chunk) => {
                if !put(Ok(chunk.into())) {
                    return tracing::warn!("A snapshot was not received to its end");
                }
            }
            Err(reason) => {
                tracing::error!("A snapshot was not sent to its end: {reason}");
                put(Err(std::io::Error::other(reason)));
                return;
            }
        }
    }
}
