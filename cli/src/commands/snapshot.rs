//! `palpate snapshot`: everything a server has stored, as one file. Taken while the server runs;
//! verified and restored without it.

mod backup;
mod bucket;

use std::fs::{self, File};
use std::io::{BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, anyhow, bail};
use clap::{Args, Subcommand, ValueEnum};
use futures::StreamExt;
use palpate_client::Client;
use palpate_store::access::AccessKey;
use palpate_store::database::Database;
use palpate_store::fsck::Report;
use palpate_store::nats::snapshots::StoredSnapshot;
use palpate_store::private;
use palpate_store::sled::{SledEngine, SledOptions};
use palpate_store::snapshot::{KeysFrom, SnapshotManifest, keys, restore, verify};
use serde_json::{Value, json};

use crate::cluster::ClusterArgs;
use crate::commands::Context;
use crate::commands::fsck::findings;
use crate::exit::Ended;
use crate::output::Output;

/// Arguments of `palpate snapshot`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate snapshot create monday.snapshot\n  \
    palpate snapshot verify monday.snapshot\n  \
    palpate snapshot backup /var/backups/palpate --keep 14\n  \
    palpate snapshot backup nats://10.0.0.1:4222/backup --keep 14\n  \
    palpate snapshot list nats://10.0.0.1:4222/backup\n  \
    palpate snapshot restore monday.snapshot --data ./restored --keys newer \
    --current ./palpate-data\n  \
    palpate serve --data ./restored")]
pub(crate) struct SnapshotArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Take a snapshot of a running server.
    Create {
        /// File to write; it must not exist.
        file: PathBuf,
    },
    /// Take a snapshot of a running server into a folder, or into an object store of a NATS cluster,
    /// named by its time, and remove the oldest ones there. Nothing is removed unless the new one is
    /// complete and undamaged.
    Backup {
        /// Folder of the snapshots, or nats://HOST:PORT/NAME for the object store NAME-snapshots;
        /// created if missing.
        folder: PathBuf,
        /// Number of snapshots to keep, the new one included.
        #[arg(long, value_name = "N", default_value_t = 14,
            value_parser = clap::value_parser!(u32).range(1..=100_000))]
        keep: u32,
        #[command(flatten)]
        cluster: ClusterArgs,
    },
    /// List the snapshots in an object store of a NATS cluster.
    List {
        /// nats://HOST:PORT/NAME, as for backup.
        place: PathBuf,
        #[command(flatten)]
        cluster: ClusterArgs,
    },
    /// Verify a snapshot: read all of it and check every record.
    Verify {
        /// Snapshot file, or nats://HOST:PORT/NAME/SNAPSHOT.
        file: PathBuf,
        #[command(flatten)]
        cluster: ClusterArgs,
    },
    /// Restore a snapshot into a new folder for `palpate serve`.
    Restore {
        /// Snapshot file, or nats://HOST:PORT/NAME/SNAPSHOT.
        file: PathBuf,
        #[command(flatten)]
        cluster: ClusterArgs,
        /// Folder to write to; it must not exist, or be empty.
        #[arg(long, value_name = "DIR")]
        data: PathBuf,
        /// Treatment of the snapshot's API keys and webhooks; required if it holds any keys that were
        /// not revoked.
        #[arg(long, value_name = "WHICH")]
        keys: Option<KeysChoice>,
        /// Folder that the restored one replaces, for `--keys newer`; no server may have it open.
        #[arg(long, value_name = "DIR", required_if_eq("keys", "newer"))]
        current: Option<PathBuf>,
    },
}

/// API keys of a restored folder, and its webhooks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum KeysChoice {
    /// Keep the snapshot's keys and webhooks. Keys revoked since then are valid again.
    Keep,
    /// Drop all keys and webhooks. A server started with `--access keys` creates the first admin
    /// key.
    Drop,
    /// Take the keys and webhooks of the folder being replaced (`--current`): revocations, rotations
    /// and new keys since the snapshot stay in force.
    Newer,
}

/// Runs the command.
pub(crate) async fn run(
    args: SnapshotArgs,
    output: Output,
    context: impl FnOnce() -> anyhow::Result<Context>,
) -> anyhow::Result<()> {
    match args.action {
        Action::Create { file } => {
            let (manifest, report) = create(&file, &context()?.client).await?;
            said(&manifest, &report, output)
        }
        Action::Backup { folder, keep, cluster } if bucket::is_on_cluster(&folder) => {
            back_up_on_cluster(folder, cluster, keep as usize, &context()?.client, output).await
        }
        Action::List { place, cluster } => {
            let stored = blocking(move || list(&place, &cluster)).await?;
            let answer = stored.iter().map(|one| json!({"name": one.name, "bytes": one.bytes}));
            output.answer(&json!(answer.collect::<Vec<_>>()), |_| lines(&stored))
        }
        Action::Backup { folder, keep, .. } => {
            back_up(&folder, keep as usize, &context()?.client, output).await
        }
        Action::Verify { file, cluster } => {
            let verify = move || {
                let (file, _folder) = bucket::local(&file, &cluster)?;
                verified(&file)
            };
            let (manifest, report) = blocking(verify).await?;
            said(&manifest, &report, output)
        }
        Action::Restore { file, cluster, data, keys, current } => {
            let restore = move || {
                let (file, _folder) = bucket::local(&file, &cluster)?;
                restored(&file, &data, keys, current.as_deref())
            };
            let (manifest, held) = blocking(restore).await?;
            let mut answer = shown(&manifest);
            answer["keys"] = json!(held.iter().map(|key| &key.name).collect::<Vec<_>>());
            output.answer(&answer, |_| {
                let names = names(&held);
                format!("restored, with {} keys{names}; serve it with --data", held.len())
            })
        }
    }
}

/// Downloads into a temporary file, which is renamed when it is complete.
async fn create(file: &Path, client: &Client) -> anyhow::Result<(SnapshotManifest, Report)> {
    if file.exists() {
        bail!("{} exists already, expected a new file", file.display());
    }
    let mut name = file.file_name().context("expected the name of a file")?.to_owned();
    name.push(".part");
    let part = file.with_file_name(name);
    let received = receive(&part, client).await;
    let checked = match received {
        Ok(()) => {
            let part = part.clone();
            blocking(move || verified(&part)).await
        }
        Err(error) => Err(error),
    };
    let (manifest, report) = match checked {
        Ok(checked) => checked,
        Err(error) => {
            // The partial file is not a snapshot.
            let _ = fs::remove_file(&part);
            return Err(error);
        }
    };
    fs::rename(&part, file).with_context(|| format!("cannot write {}", file.display()))?;
    Ok((manifest, report))
}

/// Takes a snapshot into a folder and removes the oldest ones.
async fn back_up(
    folder: &Path,
    keep: usize,
    client: &Client,
    output: Output,
) -> anyhow::Result<()> {
    private::create_folder(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let name = backup::name();
    let file = folder.join(&name);
    let (manifest, report) = create(&file, client).await?;
    if report.n_damaged > 0 {
        return said(&manifest, &report, output);
    }
    let removed = backup::prune(folder, &name, keep)?;
    let mut answer = shown(&manifest);
    answer["file"] = json!(file);
    answer["removed"] = json!(removed);
    output.answer(&answer, |_| {
        let (megabytes, n_removed) = (manifest.bytes as f64 / 1e6, removed.len());
        format!("{}: {megabytes:.1} MB, whole; {n_removed} old files removed", file.display())
    })
}

/// Takes a snapshot into an object store and removes the oldest ones.
async fn back_up_on_cluster(
    place: PathBuf,
    cluster: ClusterArgs,
    keep: usize,
    client: &Client,
    output: Output,
) -> anyhow::Result<()> {
    let bucket = blocking(move || bucket::open(&place, &cluster)).await?;
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let name = backup::name();
    let file = folder.path().join(&name);
    let (manifest, report) = create(&file, client).await?;
    if report.n_damaged > 0 {
        return said(&manifest, &report, output);
    }
    let mut answer = shown(&manifest);
    let stored = name.clone();
    let keeping = move || bucket::keep(&bucket, (&file, &stored), &manifest, keep);
    let (removed, left) = blocking(keeping).await?;
    answer["name"] = json!(name);
    answer["removed"] = json!(removed);
    answer["kept"] = json!(left.iter().map(|stored| &stored.name).collect::<Vec<_>>());
    output.answer(&answer, |_| {
        let (n_removed, kept) = (removed.len(), lines(&left));
        format!("{name}: stored and read back; {n_removed} old ones removed\n{kept}")
    })
}

fn list(place: &Path, cluster: &ClusterArgs) -> anyhow::Result<Vec<StoredSnapshot>> {
    if !bucket::is_on_cluster(place) {
        bail!("{} is no object store, expected nats://HOST:PORT/NAME", place.display());
    }
    bucket::open(place, cluster)?.list().map_err(|fault| anyhow!(fault))
}

/// Snapshots, one a line.
fn lines(stored: &[StoredSnapshot]) -> String {
    let line = |one: &StoredSnapshot| format!("{}  {:.1} MB", one.name, one.bytes as f64 / 1e6);
    stored.iter().map(line).collect::<Vec<_>>().join("\n")
}

async fn receive(part: &Path, client: &Client) -> anyhow::Result<()> {
    let mut stream = client.snapshot().await?;
    let context = || format!("cannot write {}", part.display());
    let mut to = private::create(part).with_context(context)?;
    while let Some(chunk) = stream.next().await {
        to.write_all(&chunk?).with_context(context)?;
    }
    to.sync_all().with_context(context)
}

fn verified(file: &Path) -> anyhow::Result<(SnapshotManifest, Report)> {
    Ok(verify(opened(file)?)?)
}

/// Restores into a temporary folder, which is renamed when it is complete. Also returns the keys
/// that are valid from then on.
fn restored(
    file: &Path,
    data: &Path,
    choice: Option<KeysChoice>,
    current: Option<&Path>,
) -> anyhow::Result<(SnapshotManifest, Vec<AccessKey>)> {
    let is_free = match fs::read_dir(data) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => true,
        Err(error) => return Err(error).with_context(|| format!("cannot use {}", data.display())),
    };
    if !is_free {
        bail!("{} is not empty, expected a new or empty folder", data.display());
    }
    verify(opened(file)?)?;
    let mut held = keys(opened(file)?)?;
    held.retain(|key| key.revoked_at_ms.is_none());
    let choice = match choice {
        Some(choice) => choice,
        None if held.is_empty() => KeysChoice::Keep,
        None => bail!(
            "the snapshot would bring back {} keys{}, also what was revoked since it was taken: \
             expected --keys keep, --keys drop, or --keys newer with --current DIR",
            held.len(),
            names(&held)
        ),
    };
    let current = current.filter(|_| choice == KeysChoice::Newer);
    let current = current.map(opened_folder).transpose()?;
    if let Some(engine) = &current {
        held = Database::with_engine(Arc::<SledEngine>::clone(engine))?.keys().all()?;
        held.retain(|key| key.revoked_at_ms.is_none());
    }
    let from = match (choice, &current) {
        (KeysChoice::Drop, _) => KeysFrom::Nowhere,
        (_, Some(engine)) => KeysFrom::Engine(&**engine),
        (_, None) => KeysFrom::Snapshot,
    };
    if choice == KeysChoice::Drop {
        held.clear();
    }
    let mut name = data.file_name().context("expected the name of a folder")?.to_owned();
    name.push(".restoring");
    let beside = data.with_file_name(name);
    if beside.exists() {
        bail!("{} is left from an interrupted restoration: remove it", beside.display());
    }
    let outcome = SledEngine::open(&beside, &SledOptions::default())
        .map_err(anyhow::Error::from)
        .and_then(|engine| Ok(restore(opened(file)?, &engine, from)?))
        .and_then(|manifest| {
            fs::rename(&beside, data)
                .with_context(|| format!("cannot make {}", data.display()))
                .map(|()| manifest)
        });
    if outcome.is_err() {
        // The folder is incomplete.
        let _ = fs::remove_dir_all(&beside);
    }
    outcome.map(|manifest| (manifest, held))
}

/// Checks that a folder exists and that no server has it open.
fn opened_folder(folder: &Path) -> anyhow::Result<Arc<SledEngine>> {
    if !folder.is_dir() {
        bail!("there is no folder {}, expected the one that is replaced", folder.display());
    }
    Ok(Arc::new(SledEngine::open(folder, &SledOptions::default())?))
}

/// Names of keys, as the end of a clause.
fn names(keys: &[AccessKey]) -> String {
    match keys {
        [] => String::new(),
        keys => {
            let named = keys.iter().map(|key| key.name.as_str()).collect::<Vec<_>>();
            format!(" ({})", named.join(", "))
        }
    }
}

fn opened(file: &Path) -> anyhow::Result<BufReader<File>> {
    let opened = File::open(file).with_context(|| format!("cannot read {}", file.display()))?;
    Ok(BufReader::with_capacity(1 << 20, opened))
}

/// Prints what a snapshot holds. Fails if records in it are damaged.
fn said(manifest: &SnapshotManifest, report: &Report, output: Output) -> anyhow::Result<()> {
    let mut answer = shown(manifest);
    answer["records"] = json!(report.records);
    answer["n_damaged"] = json!(report.n_damaged);
    answer["findings"] = json!(findings(report));
    let n_records: u64 = report.records.values().sum();
    output.answer(&answer, |_| {
        let megabytes = manifest.bytes as f64 / 1e6;
        let n_damaged = report.n_damaged;
        let whole = format!("whole: {n_records} records, {megabytes:.1} MB, {n_damaged} damaged");
        let damaged = report
            .findings
            .iter()
            .map(|finding| format!("\n{} {}: {}", finding.space, finding.key, finding.fault));
        whole + &damaged.collect::<String>()
    })?;
    if report.n_damaged == 0 { Ok(()) } else { Err(Ended::Damaged.into()) }
}

fn shown(manifest: &SnapshotManifest) -> Value {
    let hash: String = manifest.hash.iter().map(|byte| format!("{byte:02x}")).collect();
    json!({
        "layout": manifest.header.layout,
        "created_at_ms": manifest.header.created_at_ms,
        "made_by": manifest.header.made_by,
        "pairs": manifest.pairs.values().sum::<u64>(),
        "bytes": manifest.bytes,
        "hash": hash,
    })
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> anyhow::Result<T> + Send + 'static,
) -> anyhow::Result<T> {
    tokio::task::spawn_blocking(work).await?
}
