//! `palpate copy`: copies all stored data between a folder and a NATS cluster, and compares both.

use std::io::{self, Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, bail};
use clap::Args;
use palpate_store::database::{Database, LAYOUT};
use palpate_store::engine::{Cut, Engine};
use palpate_store::nats::NatsEngine;
use palpate_store::sled::{SledEngine, SledOptions};
use palpate_store::snapshot::{KeysFrom, SnapshotHeader, SnapshotWriter, restore};
use serde_json::json;

use crate::cluster::ClusterArgs;
use crate::commands::fsck::require_data;
use crate::output::Output;

/// Number of pairs that are compared at once.
const PAIRS_PER_READ: usize = 1024;

/// Arguments of `palpate copy`.
#[derive(Debug, Args)]
#[command(after_help = "No server may use either side. The target must be empty; an interrupted \
    copy is not usable: remove it and copy again.\n\nExamples:\n  \
    palpate copy --from sled:/var/lib/palpate --to nats://10.0.0.1:4222,10.0.0.2:4222\n  \
    palpate copy --from nats://10.0.0.1:4222/palpate --to sled:palpate-data")]
pub(crate) struct CopyArgs {
    /// Source: `sled:DIR`, or `nats://HOST:PORT[,HOST:PORT][/STREAM]`.
    #[arg(long, value_name = "STORE")]
    from: String,
    /// Target, of the same form; created if missing.
    #[arg(long, value_name = "STORE")]
    to: String,
    #[command(flatten)]
    cluster: ClusterArgs,
}

/// Runs the command.
pub(crate) async fn run(args: CopyArgs, output: Output) -> anyhow::Result<()> {
    let copied = tokio::task::spawn_blocking(move || copy(&args)).await??;
    let answer = json!({"n_pairs": copied.n_pairs, "bytes": copied.bytes});
    output.answer(&answer, |_| {
        let megabytes = copied.bytes as f64 / 1e6;
        format!("copied {} pairs, {megabytes:.1} MB; both sides are equal", copied.n_pairs)
    })
}

/// What was copied and compared.
struct Copied {
    n_pairs: u64,
    bytes: u64,
}

fn copy(args: &CopyArgs) -> anyhow::Result<Copied> {
    let spool = tempfile::tempdir().context("cannot make a temporary folder")?;
    if let Some(folder) = args.from.strip_prefix("sled:") {
        require_data(Path::new(folder))?;
    }
    let open = |place: &str| open(place, args, spool.path());
    let from = open(&args.from).with_context(|| format!("cannot open {}", args.from))?;
    // It has today's layout.
    Database::with_engine(Arc::clone(&from))?;
    let to = open(&args.to).with_context(|| format!("cannot open {}", args.to))?;
    if !to.scan(&[], None, 1)?.is_empty() {
        bail!("{} is not empty, expected a new or empty store", args.to);
    }
    let made_by = concat!("palpate ", env!("CARGO_PKG_VERSION")).to_owned();
    let header = SnapshotHeader { layout: LAYOUT, created_at_ms: 0, made_by };
    let reader =
        Chunks { writer: SnapshotWriter::new(from.cut()?, &header), rest: Cursor::default() };
    restore(reader, &*to, KeysFrom::Snapshot)?;
    // Read again from where it is stored.
    drop(to);
    let to = open(&args.to).with_context(|| format!("cannot open {} again", args.to))?;
    compare(from.cut()?, to.cut()?)
}

/// Opens a store by its name.
fn open(place: &str, args: &CopyArgs, spool: &Path) -> anyhow::Result<Arc<dyn Engine>> {
    match place.strip_prefix("sled:") {
        Some(folder) => {
            Ok(Arc::new(SledEngine::open(&PathBuf::from(folder), &SledOptions::default())?))
        }
        None if place.contains("://") => {
            Ok(Arc::new(NatsEngine::open(&args.cluster.options(place, spool.to_owned())?)?))
        }
        None => bail!("{place:?} is no store, expected sled:DIR or nats://HOST:PORT[/STREAM]"),
    }
}

/// Compares all pairs.
fn compare(mut from: Box<dyn Cut>, mut to: Box<dyn Cut>) -> anyhow::Result<Copied> {
    let mut copied = Copied { n_pairs: 0, bytes: 0 };
    loop {
        let (expected, found) = (from.next(PAIRS_PER_READ)?, to.next(PAIRS_PER_READ)?);
        if expected != found {
            bail!("the copy differs after {} pairs: remove it and copy again", copied.n_pairs);
        }
        if expected.is_empty() {
            return Ok(copied);
        }
        copied.n_pairs += expected.len() as u64;
        let sizes = expected.iter().map(|(key, value)| key.len() + value.len());
        copied.bytes += sizes.sum::<usize>() as u64;
    }
}

/// A snapshot that is read while it is written.
struct Chunks {
    writer: SnapshotWriter,
    rest: Cursor<Vec<u8>>,
}

impl Read for Chunks {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let n_bytes = self.rest.read(buffer)?;
            if n_bytes > 0 || buffer.is_empty() {
                return Ok(n_bytes);
            }
            match self.writer.next_chunk().map_err(io::Error::other)? {
                Some(chunk) => self.rest = Cursor::new(chunk),
                None => return Ok(0),
            }
        }
    }
}
