//! Snapshots in an object store of a NATS cluster: stored and read again, listed, and read for the
//! commands that take a file.

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, bail};
use palpate_store::nats::snapshots::{Snapshots, StoredSnapshot};
use palpate_store::snapshot::SnapshotManifest;
use tempfile::TempDir;

use super::backup;
use crate::cluster::ClusterArgs;

/// Whether a place is on a cluster, and no folder or file.
pub(super) fn is_on_cluster(place: &Path) -> bool {
    place.to_str().is_some_and(|place| place.contains("://"))
}

/// Opens the bucket of an address.
pub(super) fn open(place: &Path, cluster: &ClusterArgs) -> anyhow::Result<Snapshots> {
    let address = place.to_str().context("expected nats://HOST:PORT[/NAME]")?;
    // It makes no temporary files.
    let options = cluster.options(address, PathBuf::new())?;
    Ok(Snapshots::open(&options)?)
}

/// A snapshot's file: itself, or a copy of an object, which is removed with what is returned.
pub(super) fn local(
    file: &Path,
    cluster: &ClusterArgs,
) -> anyhow::Result<(PathBuf, Option<TempDir>)> {
    if !is_on_cluster(file) {
        return Ok((file.to_owned(), None));
    }
    let (address, name) = divided(file)?;
    let bucket = open(Path::new(address), cluster)?;
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let copy = folder.path().join("copy");
    read(&bucket, name, &copy)?;
    Ok((copy, Some(folder)))
}

/// The address of a bucket and the name of a snapshot: `nats://HOST:PORT/NAME/FILE`.
fn divided(file: &Path) -> anyhow::Result<(&str, &str)> {
    let place = file.to_str().context("expected nats://HOST:PORT/NAME/SNAPSHOT")?;
    let is_whole = place.split("://").nth(1).is_some_and(|rest| rest.matches('/').count() == 2);
    match place.rsplit_once('/') {
        Some((address, name)) if is_whole && !name.is_empty() => Ok((address, name)),
        _ => bail!("{place:?} names no snapshot, expected nats://HOST:PORT/NAME/SNAPSHOT"),
    }
}

fn read(bucket: &Snapshots, name: &str, copy: &Path) -> anyhow::Result<()> {
    let file = File::create(copy).with_context(|| format!("cannot write {}", copy.display()))?;
    bucket.get(name, file).map_err(|fault| anyhow!(fault))
}

/// Stores a verified snapshot, reads it again, and removes the oldest ones; returns the removed
/// ones and those that are left.
pub(super) fn keep(
    bucket: &Snapshots,
    (file, name): (&Path, &str),
    expected: &SnapshotManifest,
    keep: usize,
) -> anyhow::Result<(Vec<String>, Vec<StoredSnapshot>)> {
    let fault = |fault: String| anyhow!(fault);
    if bucket.list().map_err(fault)?.iter().any(|stored| stored.name == name) {
        bail!("{} has {name} already, expected a new name", bucket.bucket());
    }
    bucket.put(name, file).map_err(fault)?;
    let copy = file.with_extension("copy");
    let found = read(bucket, name, &copy).and_then(|()| super::verified(&copy));
    match found {
        Ok((found, _)) if found == *expected => {}
        outcome => {
            // It is no snapshot.
            let _ = bucket.remove(name);
            let fault =
                outcome.err().map_or_else(|| "it differs".to_owned(), |error| error.to_string());
            bail!("{name} was stored, but not read back: {fault}");
        }
    }
    let stored = bucket.list().map_err(fault)?;
    let names = stored.iter().map(|stored| stored.name.clone()).collect();
    let removed = backup::surplus(names, name, keep);
    for old in &removed {
        bucket.remove(old).map_err(fault)?;
    }
    bucket.remove_interrupted(name).map_err(fault)?;
    let is_left = |stored: &StoredSnapshot| !removed.contains(&stored.name);
    let left = stored.into_iter().filter(is_left).collect();
    Ok((removed, left))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_of_a_snapshot_has_a_name_and_a_file() {
        let divided = |place| divided(Path::new(place)).map_err(|error| error.to_string());
        let (address, name) = divided("nats://a:1,b:2/backup/palpate-1.snapshot").unwrap();
        assert_eq!((address, name), ("nats://a:1,b:2/backup", "palpate-1.snapshot"));
        for wrong in ["nats://a:1", "nats://a:1/backup", "nats://a:1/backup/", "nats://a/b/c/d"] {
            let error = divided(wrong).unwrap_err();
            assert!(error.contains("expected nats://HOST:PORT/NAME/SNAPSHOT"), "{error}");
        }
        assert!(is_on_cluster(Path::new("nats://a/b")) && !is_on_cluster(Path::new("./a/b")));
    }
}
