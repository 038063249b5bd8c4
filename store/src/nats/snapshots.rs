//! Snapshots in an object store of a cluster, which may be another one than the data's.
//!
//! A snapshot is one object of the bucket `NAME-snapshots`, under the name of its file. NATS checks
//! its hash when it is read. Not here: what a snapshot is (`snapshot`), and which ones are kept.

use std::path::Path;

use async_nats::jetstream::context::ContextBuilder;
use async_nats::jetstream::object_store::{GetErrorKind, InfoErrorKind, Object};
use async_nats::jetstream::stream::LastRawMessageErrorKind;
use tokio::fs::File;
use tokio::runtime::{Builder, Runtime};

use super::bucket::{Bucket, LOOKS, PAUSE};
use super::options::NatsOptions;
use super::setup::{self, ANSWER_WITHIN, REPLICAS};
use crate::engine::opening::OpenError;

/// Age from which on content without a name was left by an interrupted backup. Chosen: far more
/// than the pauses of one under way.
const LEFT_AFTER_S: i64 = 6 * 3600;

/// A bucket of snapshots.
#[derive(Debug)]
pub struct Snapshots {
    runtime: Runtime,
    bucket: Bucket,
}

/// A snapshot in a bucket.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredSnapshot {
    /// Its name.
    pub name: String,
    /// Its length in bytes.
    pub bytes: u64,
}

impl Snapshots {
    /// Opens the bucket of an address, made if it is missing. Blocks.
    ///
    /// # Errors
    /// [`OpenError`] says what the cluster lacks.
    pub fn open(options: &NatsOptions) -> Result<Self, OpenError> {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build();
        let runtime = runtime.map_err(|source| OpenError::Thread { source })?;
        let opening = async {
            let client = setup::connect(options).await?;
            let is_cluster = client.server_info().cluster.is_some();
            let replicas = options.replicas.unwrap_or(if is_cluster { REPLICAS } else { 1 });
            let context = ContextBuilder::new().timeout(ANSWER_WITHIN).build(client);
            Bucket::open(&context, options.snapshots(), replicas).await
        };
        let fault = |fault| OpenError::Cluster { servers: options.servers.join(","), fault };
        let bucket = runtime.block_on(opening).map_err(fault)?;
        Ok(Self { runtime, bucket })
    }

    /// Name of the bucket.
    #[must_use]
    pub fn bucket(&self) -> &str {
        &self.bucket.name
    }

    /// Stores a file under a name. Blocks.
    ///
    /// # Errors
    /// What failed.
    pub fn put(&self, name: &str, file: &Path) -> Result<(), String> {
        self.runtime.block_on(async {
            let mut file = File::open(file).await.map_err(|error| error.to_string())?;
            self.bucket.put_all(name, &mut file).await
        })
    }

    /// Writes a snapshot into a file, which exists and is empty. Blocks.
    ///
    /// # Errors
    /// What failed; the bucket's name and the snapshot's if there is none.
    pub fn get(&self, name: &str, file: std::fs::File) -> Result<(), String> {
        self.runtime.block_on(async {
            let mut object = self.bucket.open_object(name).await?;
            let mut file = File::from_std(file);
            let copied = tokio::io::copy(&mut object, &mut file).await;
            let n_bytes = copied.map_err(|error| format!("cannot read {name}: {error}"))?;
            if n_bytes != object.info().size as u64 {
                return Err(format!(
                    "{name} ends after {n_bytes} bytes, expected {}",
                    object.info().size
                ));
            }
            file.sync_all().await.map_err(|error| error.to_string())
        })
    }

    /// All objects, by name. Blocks.
    ///
    /// # Errors
    /// What failed.
    pub fn list(&self) -> Result<Vec<StoredSnapshot>, String> {
        let listed = self.runtime.block_on(self.bucket.objects())?;
        let named = |(name, bytes)| StoredSnapshot { name, bytes };
        let mut snapshots: Vec<_> = listed.into_iter().map(named).collect();
        snapshots.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(snapshots)
    }

    /// Removes a snapshot; a missing one is no error. Blocks.
    ///
    /// # Errors
    /// What failed.
    pub fn remove(&self, name: &str) -> Result<(), String> {
        self.runtime.block_on(self.bucket.remove(name))
    }

    /// Removes what interrupted backups left hours before a snapshot was stored. Blocks.
    ///
    /// # Errors
    /// What failed.
    pub fn remove_interrupted(&self, newest: &str) -> Result<(), String> {
        self.runtime.block_on(async {
            let Some(now) = self.bucket.stored_at_s(newest).await? else { return Ok(()) };
            for id in self.bucket.list().await?.nameless {
                let at = self.bucket.nameless_at_s(&id).await?;
                if at.is_some_and(|at| now - at > LEFT_AFTER_S) {
                    self.bucket.remove_nameless(&id).await?;
                }
            }
            Ok(())
        })
    }
}

impl Bucket {
    /// Names and lengths of its objects.
    async fn objects(&self) -> Result<Vec<(String, u64)>, String> {
        let infos = self.infos().await?.into_iter();
        Ok(infos.map(|info| (info.name, info.size as u64)).collect())
    }

    /// Puts an object of any length, in chunks.
    async fn put_all(&self, name: &str, from: &mut File) -> Result<(), String> {
        let put = self.store.put(name, from).await;
        put.map(drop).map_err(|error| error.to_string())
    }

    /// An object that is read from its beginning, with its hash checked at its end.
    async fn open_object(&self, name: &str) -> Result<Object, String> {
        let get = async || self.store.get(name).await;
        let object = looked_for(get, |error| error.kind() == GetErrorKind::NotFound).await;
        object.map_err(|error| format!("cannot read {name} of {}: {error}", self.name))
    }

    /// When the last chunk of an object was stored, seconds since 1970 by the cluster's clock.
    async fn stored_at_s(&self, name: &str) -> Result<Option<i64>, String> {
        let get = async || self.store.info(name).await;
        let info = looked_for(get, |error| error.kind() == InfoErrorKind::NotFound).await;
        self.nameless_at_s(&info.map_err(|error| error.to_string())?.nuid).await
    }

    /// The same of content by its id.
    async fn nameless_at_s(&self, id: &str) -> Result<Option<i64>, String> {
        match self.stream.get_last_raw_message_by_subject(&self.chunks(id)).await {
            Ok(message) => Ok(Some(message.time.unix_timestamp())),
            Err(error) if error.kind() == LastRawMessageErrorKind::NoMessageFound => Ok(None),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// Asks again while the object is missing, at most [`LOOKS`] times. Any copy of the bucket answers,
/// and one that is behind does not have what another has just acknowledged.
async fn looked_for<T, E>(
    ask: impl AsyncFn() -> Result<T, E>,
    is_missing: impl Fn(&E) -> bool,
) -> Result<T, E> {
    for _ in 1..LOOKS {
        match ask().await {
            Err(error) if is_missing(&error) => tokio::time::sleep(PAUSE).await,
            answer => return answer,
        }
    }
    ask().await
}
