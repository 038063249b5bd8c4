//! The bucket: the object store of NATS beside the stream, which holds large content.
//!
//! An object is put before a message names it, and is never changed. It is one chunk, so that
//! one request reads it. Not here: which objects are put and removed (`content`, `sweep`).

use std::collections::HashSet;
use std::fmt;
use std::time::Duration;

use async_nats::jetstream;
use async_nats::jetstream::object_store::{
    Config, InfoErrorKind, ObjectInfo, ObjectMetadata, ObjectStore,
};
use async_nats::jetstream::stream::{
    Config as StreamConfig, DirectGetErrorKind, DiscardPolicy, StorageType, Stream,
};
use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE;
use futures::{StreamExt, TryStreamExt};
use tokio::io::AsyncReadExt;

/// Maximum number of attempts to find or make the bucket while a cluster elects its leaders.
const SETUP_ATTEMPTS: u32 = 40;
/// Pause between attempts.
pub(super) const PAUSE: Duration = Duration::from_millis(250);
/// Number of times that an object is looked for. A copy that is behind does not have it yet.
pub(super) const LOOKS: u32 = 8;
/// Time in which a listing goes on.
const LISTED_WITHIN: Duration = Duration::from_secs(30);

/// An object store of NATS.
pub(super) struct Bucket {
    pub(super) store: ObjectStore,
    pub(super) stream: Stream,
    pub(super) name: String,
}

impl fmt::Debug for Bucket {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Bucket").field("name", &self.name).finish()
    }
}

/// The reason for which an object was not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum GetFault {
    /// The bucket does not have it.
    Missing,
    /// The cluster did not answer, or with an error.
    Failed(String),
}

/// What a bucket has.
#[derive(Debug, Default)]
pub(super) struct Listing {
    /// Names of its objects.
    pub(super) names: Vec<String>,
    /// Content without a name, as an interrupted put leaves it.
    pub(super) nameless: Vec<String>,
}

impl Bucket {
    /// The bucket `name`, made with this many copies if it is missing.
    pub(super) async fn open(
        context: &jetstream::Context,
        name: String,
        replicas: usize,
    ) -> Result<Self, String> {
        let mut fault = String::new();
        for _ in 0..SETUP_ATTEMPTS {
            match context.get_stream(format!("OBJ_{name}")).await {
                Ok(stream) => {
                    check(&stream.cached_info().config, &name)?;
                    let store = context.get_object_store(&name).await;
                    match store {
                        Ok(store) => return Ok(Self { store, stream, name }),
                        Err(error) => fault = error.to_string(),
                    }
                }
                Err(_) => {
                    let config = Config {
                        bucket: name.clone(),
                        description: Some("Large content of a store of Palpate".to_owned()),
                        max_bytes: -1,
                        storage: StorageType::File,
                        num_replicas: replicas,
                        ..Config::default()
                    };
                    // Another server may have made it: the next attempt finds it.
                    match context.create_object_store(config).await {
                        Ok(_) => continue,
                        Err(error) => fault = error.to_string(),
                    }
                }
            }
            tokio::time::sleep(PAUSE).await;
        }
        Err(format!("cannot make or find the object store {name}: {fault}"))
    }

    /// Puts an object.
    pub(super) async fn put(&self, name: &str, bytes: &[u8]) -> Result<(), String> {
        let chunk_size = Some(bytes.len().max(1));
        let metadata = ObjectMetadata { name: name.to_owned(), chunk_size, ..Default::default() };
        let mut rest = bytes;
        let put = self.store.put(metadata, &mut rest).await;
        put.map(drop).map_err(|error| error.to_string())
    }

    /// The bytes of an object.
    pub(super) async fn get(&self, name: &str) -> Result<Vec<u8>, GetFault> {
        let mut fault = GetFault::Missing;
        for look in 0..LOOKS {
            if look > 0 {
                tokio::time::sleep(PAUSE).await;
            }
            let info = match self.store.info(name).await {
                Ok(info) if info.deleted => {
                    fault = GetFault::Missing;
                    continue;
                }
                Ok(info) => info,
                Err(error) => {
                    fault = match error.kind() {
                        InfoErrorKind::NotFound => GetFault::Missing,
                        _ => GetFault::Failed(error.to_string()),
                    };
                    continue;
                }
            };
            match self.content(info).await {
                Ok(bytes) => return Ok(bytes),
                Err(found) => fault = found,
            }
        }
        Err(fault)
    }

    async fn content(&self, info: ObjectInfo) -> Result<Vec<u8>, GetFault> {
        if info.chunks == 1 {
            let subject = self.chunks(&info.nuid);
            let chunk = self.stream.direct_get_last_for_subject(subject).await;
            return chunk.map(|chunk| chunk.payload.to_vec()).map_err(|error| match error.kind() {
                DirectGetErrorKind::NotFound => GetFault::Missing,
                _ => GetFault::Failed(error.to_string()),
            });
        }
        let name = info.name;
        let failed = |error: &dyn fmt::Display| GetFault::Failed(error.to_string());
        let mut object = self.store.get(name).await.map_err(|error| failed(&error))?;
        let mut bytes = Vec::new();
        object.read_to_end(&mut bytes).await.map_err(|error| failed(&error))?;
        Ok(bytes)
    }

    /// Removes an object; a missing one is no error. Its name goes last, so that an interrupted
    /// removal is repeated.
    pub(super) async fn remove(&self, name: &str) -> Result<(), String> {
        match self.store.info(name).await {
            Ok(info) => self.purge(&self.chunks(&info.nuid)).await?,
            Err(error) if error.kind() == InfoErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(error.to_string()),
        }
        self.purge(&format!("$O.{}.M.{}", self.name, URL_SAFE.encode(name))).await
    }

    /// Removes content without a name.
    pub(super) async fn remove_nameless(&self, id: &str) -> Result<(), String> {
        self.purge(&self.chunks(id)).await
    }

    /// Subject of the content with an id.
    pub(super) fn chunks(&self, id: &str) -> String {
        format!("$O.{}.C.{id}", self.name)
    }

    async fn purge(&self, subject: &str) -> Result<(), String> {
        let purged = self.stream.purge().filter(subject).await;
        purged.map(drop).map_err(|error| error.to_string())
    }

    /// What it has. Content whose name comes while this runs may be among the nameless.
    pub(super) async fn list(&self) -> Result<Listing, String> {
        let prefix = self.chunks("");
        let mut nameless = HashSet::new();
        let subjects = self.stream.info_with_subjects(format!("{prefix}>")).await;
        let mut subjects = subjects.map_err(|error| error.to_string())?;
        while let Some((subject, _)) =
            subjects.try_next().await.map_err(|error| error.to_string())?
        {
            nameless.extend(subject.strip_prefix(&prefix).map(str::to_owned));
        }
        let mut names = Vec::new();
        for object in self.infos().await? {
            nameless.remove(&object.nuid);
            names.push(object.name);
        }
        Ok(Listing { names, nameless: nameless.into_iter().collect() })
    }

    /// Its objects.
    pub(super) async fn infos(&self) -> Result<Vec<ObjectInfo>, String> {
        let mut infos = Vec::new();
        let mut objects = self.store.list().await.map_err(|error| error.to_string())?;
        loop {
            let next = tokio::time::timeout(LISTED_WITHIN, objects.next()).await;
            let next = next.map_err(|_| "the listing does not go on".to_owned())?;
            match next.transpose().map_err(|error| error.to_string())? {
                Some(info) => infos.push(info),
                None => return Ok(infos),
            }
        }
    }
}

/// Checks the bucket that was found.
fn check(found: &StreamConfig, name: &str) -> Result<(), String> {
    let wanted = [
        (found.storage == StorageType::File, "storage: file"),
        (found.discard == DiscardPolicy::New, "discard: new"),
        (found.max_age.is_zero(), "max_age: 0"),
        (found.max_messages_per_subject <= 0, "max_msgs_per_subject: -1"),
        (found.allow_rollup, "allow_rollup_hdrs"),
        (found.allow_direct, "allow_direct"),
        (found.mirror.is_none() && found.sources.is_none(), "no mirror and no sources"),
    ];
    match wanted.iter().find(|(holds, _)| !holds) {
        None => Ok(()),
        Some((_, what)) => Err(format!("the object store {name} lacks {what}")),
    }
}
